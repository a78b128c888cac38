//! The end of a JPEG, which tells whether it is whole: its decoder fills what is missing with grey, without an error.

const END_OF_IMAGE: u8 = 0xD9;
const START_OF_SCAN: u8 = 0xDA;

/// Returns where the first picture of `file` ends, behind the mark EOI after its last scan, or `None` if it is cut
/// short. Pictures inside segments, such as thumbnails, and pictures behind the first one do not count.
pub(crate) fn end(file: &[u8]) -> Option<usize> {
    let mut rest = file.get(2..).unwrap_or_default();
    while let Some((marker, after)) = next_marker(rest) {
        rest = match marker {
            END_OF_IMAGE => return Some(file.len() - after.len()),
            // Marks without a segment.
            0x01 | 0xD0..=0xD8 => after,
            _ => {
                let (length, _) = after.split_first_chunk()?;
                let behind = after.get(usize::from(u16::from_be_bytes(*length))..)?;
                if marker == START_OF_SCAN {
                    behind_scan(behind)
                } else {
                    behind
                }
            }
        };
    }
    None
}

/// Finds the next mark, and returns it and what follows. Any number of 0xFF may precede a mark.
fn next_marker(bytes: &[u8]) -> Option<(u8, &[u8])> {
    let start = bytes.iter().position(|byte| *byte == 0xFF)?;
    let at = start + bytes[start..].iter().position(|byte| *byte != 0xFF)?;
    Some((bytes[at], &bytes[at + 1..]))
}

/// Skips the data of a scan, in which 0xFF is followed by 0 or the number of a restart.
fn behind_scan(bytes: &[u8]) -> &[u8] {
    let is_marker = |pair: &[u8]| pair[0] == 0xFF && !matches!(pair[1], 0 | 0xD0..=0xD7 | 0xFF);
    let end = bytes.windows(2).position(is_marker);
    &bytes[end.unwrap_or(bytes.len())..]
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use image::{DynamicImage, ImageFormat, RgbImage};
    use phasefront::Size;
    use std::io::Cursor;

    fn jpeg(size: Size) -> Vec<u8> {
        let picture = RgbImage::from_fn(size.width as u32, size.height as u32, |x, y| {
            image::Rgb([(7 * x) as u8, (5 * y) as u8, (x * y) as u8])
        });
        let mut bytes = Cursor::new(Vec::new());
        DynamicImage::from(picture)
            .write_to(&mut bytes, ImageFormat::Jpeg)
            .unwrap();
        bytes.into_inner()
    }

    #[test]
    fn a_cut_picture_is_found_wherever_it_ends() {
        let whole = jpeg(Size { width: 40, height: 30 });
        assert_eq!(end(&whole), Some(whole.len()));
        for cut in 0..whole.len() {
            assert_eq!(end(&whole[..cut]), None, "{cut}");
        }
        // Some programs fill up the missing part with zeros.
        let mut filled = whole[..whole.len() / 2].to_vec();
        filled.resize(whole.len(), 0);
        assert_eq!(end(&filled), None);
    }

    #[test]
    fn a_thumbnail_and_what_follows_do_not_count() {
        let (whole, thumbnail) = (jpeg(Size { width: 40, height: 30 }), jpeg(Size { width: 8, height: 8 }));
        let length = (thumbnail.len() as u16 + 2).to_be_bytes();
        let with = [&whole[..2], &[0xFF, 0xE1], &length, &thumbnail, &whole[2..]].concat();
        assert_eq!(end(&with), Some(with.len()));
        assert_eq!(end(&with[..with.len() - 40]), None);
        // A second picture, as phones append, or any data.
        assert_eq!(end(&[&with[..], &thumbnail].concat()), Some(with.len()));
        assert_eq!(end(&[&with[..], &[0; 99]].concat()), Some(with.len()));
    }
}
