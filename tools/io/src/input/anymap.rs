//! Grey pictures of the netpbm formats: PGM (P2, P5) and PFM (Pf).

use crate::input::decode::{MOST_PIXELS, Numbers, Plane, Said, broken, check};
use ndarray::Array2;
use phasefront::Size;

/// Checks whether a file is in one of these formats, of grey or of colour.
pub(crate) fn is(head: &[u8]) -> bool {
    matches!(head, [b'P', b'2' | b'3' | b'5' | b'6' | b'f' | b'F', after, ..] if after.is_ascii_whitespace())
}

/// Reads the grey picture of a whole file. A PFM begins with the bottom row.
pub(crate) fn read_plane(file: &[u8]) -> Said<Plane> {
    let mut rest = Tokens(file);
    let kind = rest.text()?;
    if !["P2", "P5", "Pf"].contains(&kind) {
        return Err("is a PPM or PFM of colours; depth is grey (P2, P5 or Pf)".into());
    }
    let size = Size {
        width: rest.number()?,
        height: rest.number()?,
    };
    check(size, MOST_PIXELS)?;
    let count = size.pixels();
    let cut = || broken(&"it ends too early");
    let (values, numbers) = if kind == "Pf" {
        let scale: f32 = rest.number()?;
        let (numbers, _) = rest.data()?.as_chunks::<4>();
        let numbers = numbers.get(..count).ok_or_else(cut)?;
        // The sign of the scale tells the order of the bytes.
        let value = |bytes: &[u8; 4]| match scale < 0.0 {
            true => f32::from_le_bytes(*bytes),
            false => f32::from_be_bytes(*bytes),
        };
        let rows = numbers.chunks(size.width.max(1)).rev();
        (rows.flatten().map(value).collect(), Numbers::Floats)
    } else {
        let most: u16 = rest.number()?;
        if most == 0 {
            return Err(broken(&"its largest level is 0"));
        }
        let values: Vec<f32> = match (kind, most) {
            ("P2", _) => (0..count)
                .map(|_| rest.number::<u16>().map(f32::from))
                .collect::<Said<_>>()?,
            (_, ..=255) => (rest.data()?.get(..count).ok_or_else(cut)?.iter())
                .map(|level| f32::from(*level))
                .collect(),
            _ => (rest.data()?.as_chunks::<2>().0.get(..count).ok_or_else(cut)?.iter())
                .map(|level| f32::from(u16::from_be_bytes(*level)))
                .collect(),
        };
        if let Some(over) = values.iter().find(|level| **level > f32::from(most)) {
            return Err(broken(&format!("a level of {over} is over its largest, {most}")));
        }
        (values, Numbers::Integers { most: most.into() })
    };
    let values = Array2::from_shape_vec(size.shape(), values).map_err(|e| broken(&e))?;
    Ok(Plane { values, numbers })
}

/// The rest of a file, of tokens between white space. `#` begins a comment.
struct Tokens<'a>(&'a [u8]);

impl<'a> Tokens<'a> {
    fn text(&mut self) -> Said<&'a str> {
        loop {
            self.0 = self.0.trim_ascii_start();
            if self.0.first() != Some(&b'#') {
                break;
            }
            let end = self.0.iter().position(|byte| *byte == b'\n');
            self.0 = &self.0[end.unwrap_or(self.0.len())..];
        }
        let end = self.0.iter().position(u8::is_ascii_whitespace);
        let (token, rest) = self.0.split_at(end.unwrap_or(self.0.len()));
        self.0 = rest;
        std::str::from_utf8(token).map_err(|_| broken(&"its header is no text"))
    }

    fn number<T: std::str::FromStr>(&mut self) -> Said<T> {
        let text = self.text()?;
        text.parse()
            .map_err(|_| broken(&format!("{text:?} is no number for it")))
    }

    /// Returns what follows the header and one byte of white space.
    fn data(&mut self) -> Said<&'a [u8]> {
        self.0.get(1..).ok_or_else(|| broken(&"it has no pixels"))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use ndarray::array;

    #[test]
    fn grey_of_every_kind_is_read() {
        let want = array![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]];
        let bytes = read_plane(b"P5\n# by a camera\n3 2\n255\n\x01\x02\x03\x04\x05\x06").unwrap();
        assert_eq!(
            (bytes.values, bytes.numbers),
            (want.clone(), Numbers::Integers { most: 255.0 })
        );
        let words = read_plane(b"P5 3 2 4095\n\0\x01\0\x02\0\x03\0\x04\0\x05\0\x06").unwrap();
        assert_eq!(
            (words.values, words.numbers),
            (want.clone(), Numbers::Integers { most: 4095.0 })
        );
        assert_eq!(read_plane(b"P2 3 2 7\n1 2 3\n4 5 6\n").unwrap().values, want);
        // Rows of a PFM run from the bottom up.
        let of = |bytes: fn(f32) -> [u8; 4]| [4.0, 5.0, 6.0, 1.0, 2.0, 3.0].map(bytes).concat();
        let little = [&b"Pf\n3 2\n-1.0\n"[..], &of(f32::to_le_bytes)].concat();
        let big = [&b"Pf\n3 2\n1.0\n"[..], &of(f32::to_be_bytes)].concat();
        for file in [little, big] {
            let plane = read_plane(&file).unwrap();
            assert_eq!((plane.values, plane.numbers), (want.clone(), Numbers::Floats));
            for end in 0..file.len() {
                assert!(read_plane(&file[..end]).is_err());
            }
        }
    }

    #[test]
    fn what_is_no_grey_picture_is_refused() {
        for (file, word) in [
            (&b"P6 1 1 255\n\x01\x02\x03"[..], "colours"),
            (b"P5 10 10 255\n\x01", "too early"),
            (b"P5 99999999999 99999999999 255\n\x01", "99999999999"),
            (b"P5 1 1 0\n\x01", "largest level"),
            (b"P5 1 1 70000\n\x01", "70000"),
            (b"P5 1 1 7\n\x08", "over its largest"),
            (b"P5 x 1 7\n\x08", "\"x\""),
        ] {
            let why = read_plane(file).unwrap_err();
            assert!(why.contains(word), "{why}");
        }
    }
}
