//! What Apple's cameras say of the depth in a HEIC photo. XMP of its own lies beside each auxiliary picture: `apdi`
//! names the numbers that the camera measured and the range that the picture's levels stand for, and `depthData` tells
//! whether their metres hold.

use super::{Range, parse, property};

const PIXELS: &str = "http://ns.apple.com/pixeldatainfo/1.0/";
const DEPTH: &str = "http://ns.apple.com/depthData/1.0/";
/// The formats of Core Video for depth, and what they hold: disparity in 1/m, or distance in m. Mattes have others.
const FORMATS: [(&[u8; 4], Range); 4] = [
    (b"hdis", Range::Inverse),
    (b"fdis", Range::Inverse),
    (b"hdep", Range::Linear),
    (b"fdep", Range::Linear),
];

/// What the levels of an auxiliary picture mean.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Meaning {
    /// Disparity, which is larger where it is nearer, or distance.
    pub(super) range: Range,
    /// The nearest and the farthest distance in metres, if the file says that they hold.
    pub(super) range_m: Option<(f64, f64)>,
}

/// Returns what the HEIC `file` says of its depth.
pub(super) fn meaning(file: &[u8]) -> Option<Meaning> {
    packets(file).find_map(|packet| of_packet(std::str::from_utf8(packet).ok()?))
}

/// Returns the packets of XMP in `file`, which lie whole among its data.
fn packets(file: &[u8]) -> impl Iterator<Item = &[u8]> {
    const END: &[u8] = b"</x:xmpmeta>";
    let find = |bytes: &[u8], word: &[u8]| bytes.windows(word.len()).position(|found| found == word);
    let mut rest = file;
    std::iter::from_fn(move || {
        let packet = &rest[find(rest, b"<x:xmpmeta")?..];
        let end = find(packet, END)? + END.len();
        rest = &packet[end..];
        Some(&packet[..end])
    })
}

fn of_packet(packet: &str) -> Option<Meaning> {
    if !packet.contains(PIXELS) {
        return None;
    }
    let xml = parse(packet).ok()?;
    let word = |space, name| property(xml.root(), space, name).map(str::trim);
    let number = |name| {
        word(PIXELS, name)?
            .parse::<f64>()
            .ok()
            .filter(|value| value.is_finite())
    };
    let format = word(PIXELS, "NativeFormat")?;
    // A number whose bytes are the four letters, or the letters.
    let code = format
        .parse()
        .map_or(format.as_bytes().to_vec(), |code: u32| code.to_be_bytes().to_vec());
    let (_, range) = FORMATS.iter().find(|(known, _)| known[..] == code[..])?;
    let holds = word(DEPTH, "Accuracy") == Some("absolute");
    let ends = (number("FloatMinValue"), number("FloatMaxValue"));
    let range_m = match (ends, range) {
        ((Some(least), Some(most)), _) if !(0.0 < least && least < most && holds) => None,
        ((Some(least), Some(most)), Range::Linear) => Some((least, most)),
        ((Some(least), Some(most)), Range::Inverse) => Some((1.0 / most, 1.0 / least)),
        _ => None,
    };
    Some(Meaning { range: *range, range_m })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// The properties that a phone writes, without its calibration.
    fn packet(format: &str, accuracy: &str) -> String {
        format!(
            r#"<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description rdf:about="" xmlns:apdi="{PIXELS}" xmlns:depthData="{DEPTH}"><apdi:NativeFormat>{format}</apdi:NativeFormat><apdi:FloatMinValue>0.5</apdi:FloatMinValue><apdi:FloatMaxValue>2.0</apdi:FloatMaxValue><depthData:Accuracy>{accuracy}</depthData:Accuracy></rdf:Description></rdf:RDF></x:xmpmeta>"#
        )
    }

    #[test]
    fn disparity_distance_and_mattes_are_told_apart() {
        let number = |letters: &[u8; 4]| u32::from_be_bytes(*letters).to_string();
        let of = |range, range_m| Some(Meaning { range, range_m });
        for (format, accuracy, want) in [
            (number(b"hdis"), "relative", of(Range::Inverse, None)),
            (number(b"fdis"), "absolute", of(Range::Inverse, Some((0.5, 2.0)))),
            (number(b"hdep"), "absolute", of(Range::Linear, Some((0.5, 2.0)))),
            ("fdep".into(), "relative", of(Range::Linear, None)),
            // One byte a pixel, as mattes have it.
            (number(b"L008"), "absolute", None),
        ] {
            assert_eq!(
                meaning(packet(&format, accuracy).as_bytes()),
                want,
                "{format} {accuracy}"
            );
        }
        // A portrait's matte may stand before its depth.
        let both = [
            &b"\0mdat"[..],
            packet("L008", "").as_bytes(),
            b"\x80\xFF",
            packet("fdis", "").as_bytes(),
        ]
        .concat();
        assert_eq!(meaning(&both), of(Range::Inverse, None));
        assert_eq!(meaning(&both[..both.len() - 1]), None);
        assert_eq!(meaning(b""), None);
    }
}
