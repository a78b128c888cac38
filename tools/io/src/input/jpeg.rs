//! The number of segments of a JPEG, checked before it is decoded: the decoder compares all parts of extended XMP after
//! each segment, so that a small file of many segments takes hours, and it keeps a colour profile of any size.

use std::io::{BufRead, Read};

/// The maximum number of segments. Photos with depth have up to 4000, each of 64 KiB.
const MOST_SEGMENTS: usize = 1 << 13;
/// The maximum number of segments of a profile, which are numbered in one byte from 1: ICC.1:2022, annex B.4.
const MOST_OF_PROFILE: usize = 255;

/// The segments of a JPEG up to the data of its first scan.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Segments {
    all: usize,
    profile: usize,
}

/// Checks the number of segments of the JPEG at the start of `from`, up to the data of its first scan.
///
/// # Errors
/// Returns an error if there are too many, or if `from` cannot be read.
pub(super) fn check(from: &mut impl BufRead) -> Result<(), String> {
    match count(from) {
        Ok(segments) if segments.all > MOST_SEGMENTS => {
            Err(format!("is a JPEG of over {MOST_SEGMENTS} segments; a photo has fewer"))
        }
        Ok(segments) if segments.profile > MOST_OF_PROFILE => Err(format!(
            "is a JPEG with a colour profile of over {MOST_OF_PROFILE} segments; the format allows no more"
        )),
        Ok(_) => Ok(()),
        Err(e) => Err(format!("cannot be read: {e}")),
    }
}

/// Counts segments until they are too many.
fn count(from: &mut impl BufRead) -> std::io::Result<Segments> {
    const START: u8 = 0xD8;
    const END: u8 = 0xD9;
    const SCAN: u8 = 0xDA;
    const PROFILE: u8 = 0xE2;
    const NAME: &[u8] = b"ICC_PROFILE\0";
    let mut segments = Segments::default();
    while segments.all <= MOST_SEGMENTS && segments.profile <= MOST_OF_PROFILE {
        let marker = match next_marker(from)? {
            None | Some(END | SCAN) => break,
            Some(START) if segments.all == 0 => continue,
            Some(marker) => marker,
        };
        segments.all += 1;
        let (Some(high), Some(low)) = (byte(from)?, byte(from)?) else {
            break;
        };
        let mut length = usize::from(u16::from_be_bytes([high, low])).saturating_sub(2);
        if marker == PROFILE && length > NAME.len() {
            let mut name = Vec::new();
            from.take(NAME.len() as u64).read_to_end(&mut name)?;
            segments.profile += usize::from(name == NAME);
            length -= NAME.len();
        }
        skip(from, length)?;
    }
    Ok(segments)
}

/// Returns the next marker: a byte other than 0 and 0xFF after bytes 0xFF.
fn next_marker(from: &mut impl BufRead) -> std::io::Result<Option<u8>> {
    let mut is_mark = false;
    loop {
        let buffer = from.fill_buf()?;
        if buffer.is_empty() {
            return Ok(None);
        }
        if is_mark {
            let byte = buffer[0];
            from.consume(1);
            match byte {
                0xFF => {}
                0 => is_mark = false,
                marker => return Ok(Some(marker)),
            }
        } else {
            let mark = buffer.iter().position(|byte| *byte == 0xFF);
            let passed = mark.map_or(buffer.len(), |at| at + 1);
            is_mark = mark.is_some();
            from.consume(passed);
        }
    }
}

fn byte(from: &mut impl BufRead) -> std::io::Result<Option<u8>> {
    let first = from.fill_buf()?.first().copied();
    from.consume(usize::from(first.is_some()));
    Ok(first)
}

fn skip(from: &mut impl BufRead, mut bytes: usize) -> std::io::Result<()> {
    while bytes > 0 {
        let passed = from.fill_buf()?.len().min(bytes);
        if passed == 0 {
            break;
        }
        from.consume(passed);
        bytes -= passed;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn segment(marker: u8, bytes: &[u8]) -> Vec<u8> {
        let length = (bytes.len() as u16 + 2).to_be_bytes();
        [&[0xFF, marker], &length[..], bytes].concat()
    }

    #[test]
    fn segments_are_counted_wherever_buffers_end() {
        let file = [
            b"\xFF\xD8".to_vec(),
            segment(0xE1, b"a thumbnail \xFF\xD8\xFF\xDA\xFF\xD9"),
            b"\xFF\xFF".to_vec(),
            segment(0xFE, b""),
            segment(0xE2, b"ICC_PROFILE\0\x01\x01profile"),
            segment(0xE2, b"MPF\0 and more bytes"),
            b"between\xFF\0".to_vec(),
            segment(0xC4, b"ab"),
            segment(0xDA, b"data"),
            segment(0xE1, b"after the start"),
        ]
        .concat();
        for capacity in 1..9 {
            let mut from = std::io::BufReader::with_capacity(capacity, &file[..]);
            let want = Segments { all: 5, profile: 1 };
            assert_eq!(count(&mut from).unwrap(), want, "{capacity}");
        }
        for end in 0..file.len() {
            count(&mut &file[..end]).unwrap();
        }
    }

    #[test]
    fn too_many_are_refused() {
        for marker in [0xE0, 0xE1, 0xE2, 0xFE, 0xDB, 0xD3, 0xD8] {
            let with = |number| {
                [
                    b"\xFF\xD8".to_vec(),
                    segment(0xE1, b"x"),
                    segment(marker, b"").repeat(number),
                ]
                .concat()
            };
            check(&mut &with(MOST_SEGMENTS - 1)[..]).unwrap();
            let why = check(&mut &with(MOST_SEGMENTS)[..]).unwrap_err();
            assert!(why.contains("over 8192 segments"), "{why}");
        }
    }

    #[test]
    fn a_profile_of_too_many_parts_is_refused() {
        let with = |number| {
            let part = segment(0xE2, b"ICC_PROFILE\0\x01\xFFpart");
            [b"\xFF\xD8".to_vec(), part.repeat(number)].concat()
        };
        check(&mut &with(MOST_OF_PROFILE)[..]).unwrap();
        let why = check(&mut &with(MOST_OF_PROFILE + 1)[..]).unwrap_err();
        assert!(why.contains("profile of over 255 segments"), "{why}");
    }
}
