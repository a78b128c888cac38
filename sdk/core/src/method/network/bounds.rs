//! Bounds on the memory that a file may make the library allocate, checked before it is decoded. The bounds count
//! messages because a message of two bytes takes hundreds of bytes in memory.

use crate::runtime::error::Error;
use crate::runtime::error::Result;
use crate::runtime::file::MOST_NETWORK;

/// The largest number of messages and strings: nodes, attributes, tensors, types and their names. An int8 chain of 256
/// layers has fewer.
pub const MAX_PARTS: usize = 1 << 17;
/// The largest nesting depth of messages. A chain's messages are nested 8 deep.
const MAX_DEPTH: usize = 16;

/// The ONNX messages, as far as needed to know which of their fields hold other messages.
#[derive(Clone, Copy)]
enum Message {
    Model,
    Training,
    Function,
    Graph,
    Node,
    Attribute,
    Tensor,
    Sparse,
    /// A message, such as a type or a name entry, all of whose fields are read as messages.
    Any,
}

impl Message {
    /// Returns the message in field `number`, or `None` for data and text.
    fn field(self, number: u64) -> Option<Message> {
        match (self, number) {
            (Message::Model, 7) | (Message::Attribute, 6 | 11) | (Message::Training, 1 | 2) => Some(Message::Graph),
            (Message::Model, 20) => Some(Message::Training),
            (Message::Model, 25) => Some(Message::Function),
            (Message::Graph, 1) | (Message::Function, 7) => Some(Message::Node),
            (Message::Node, 5) | (Message::Function, 11) => Some(Message::Attribute),
            (Message::Graph, 5) | (Message::Attribute, 5 | 10) | (Message::Sparse, 1 | 2) => Some(Message::Tensor),
            (Message::Graph, 15) | (Message::Attribute, 22 | 23) => Some(Message::Sparse),
            (Message::Graph, 11..=14) | (Message::Function, 12) | (Message::Attribute, 14 | 15) | (Message::Any, _) => {
                Some(Message::Any)
            }
            _ => None,
        }
    }
}

/// Checks that a file is not too large and does not have too many parts.
///
/// # Errors
/// Returns [`Error::Network`] with the bound.
pub(super) fn check(file: &[u8]) -> Result<()> {
    if file.len() as u64 > MOST_NETWORK {
        return Err(Error::Network(format!(
            "the file has {} bytes; {MOST_NETWORK} are the most",
            file.len()
        )));
    }
    check_parts(file)
}

/// Checks that an ONNX file does not have too many parts.
///
/// # Errors
/// Returns [`Error::Network`] with the bound.
pub fn check_parts(file: &[u8]) -> Result<()> {
    count(file, Message::Model, 0, &mut 0)
}

fn count(mut bytes: &[u8], message: Message, depth: usize, parts: &mut usize) -> Result<()> {
    // Counting stops at data that is not protobuf. Decoding then reports it.
    while let Some((key, rest)) = varint(bytes) {
        bytes = rest;
        let (number, kind) = (key >> 3, key & 7);
        let skipped = match kind {
            0 => varint(bytes).map(|(_, rest)| rest),
            1 => bytes.get(8..),
            5 => bytes.get(4..),
            2 => {
                let Some((length, rest)) = varint(bytes) else {
                    return Ok(());
                };
                let Some((part, rest)) = usize::try_from(length).ok().and_then(|n| rest.split_at_checked(n)) else {
                    return Ok(());
                };
                *parts += 1;
                if *parts > MAX_PARTS {
                    return Err(Error::Network(format!(
                        "the file has over {MAX_PARTS} parts (nodes, attributes, tensors, names); a network has fewer"
                    )));
                }
                if let Some(field) = message.field(number) {
                    if depth == MAX_DEPTH {
                        return Err(Error::Network(format!(
                            "the file's parts lie over {MAX_DEPTH} deep in one another; a network's lie less deep"
                        )));
                    }
                    count(part, field, depth + 1, parts)?;
                }
                Some(rest)
            }
            _ => None,
        };
        let Some(rest) = skipped else {
            return Ok(());
        };
        bytes = rest;
    }
    Ok(())
}

/// Returns the number at the start of `bytes` and the remaining bytes.
fn varint(bytes: &[u8]) -> Option<(u64, &[u8])> {
    let mut value = 0;
    for (i, byte) in bytes.iter().enumerate().take(10) {
        value |= u64::from(byte & 0x7f) << (7 * i);
        if byte & 0x80 == 0 {
            return Some((value, &bytes[i + 1..]));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Returns a field that holds `bytes`.
    fn field(number: u8, bytes: &[u8]) -> Vec<u8> {
        let mut length = bytes.len();
        let mut field = vec![number << 3 | 2];
        while length > 0x7f {
            field.push(length as u8 | 0x80);
            length >>= 7;
        }
        field.push(length as u8);
        [field, bytes.to_vec()].concat()
    }

    #[test]
    fn empty_messages_are_counted_wherever_they_lie() {
        let many = |number| field(number, &[]).repeat(MAX_PARTS);
        let in_node = |attributes: &[u8]| field(7, &field(1, attributes));
        for file in [
            in_node(&many(5)),
            in_node(&many(1)),
            field(7, &many(5)),
            field(7, &field(5, &many(6))),
            field(7, &field(13, &field(2, &field(1, &field(2, &many(1)))))),
            in_node(&field(5, &field(6, &many(1)))),
        ] {
            let why = check(&file).unwrap_err().to_string();
            assert!(why.contains("over 131072 parts"), "{why}");
        }
        // Data counts as one part.
        check(&field(7, &field(5, &field(9, &[10; 1 << 20])))).unwrap();
        let mut deep = Vec::new();
        for _ in 0..20 {
            deep = field(1, &field(5, &field(6, &deep)));
        }
        let why = check(&field(7, &deep)).unwrap_err().to_string();
        assert!(why.contains("16 deep"), "{why}");
    }

    #[test]
    fn what_is_no_protobuf_is_left_to_decoding() {
        for bytes in [
            &b""[..],
            b"\xff",
            b"\x0a",
            b"\x0a\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff",
            b"\x07\x07",
        ] {
            check(bytes).unwrap();
        }
    }
}
