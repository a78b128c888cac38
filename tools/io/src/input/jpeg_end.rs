//! A check that a JPEG is whole. Its decoder fills what is missing with grey, without an error.

const END_OF_IMAGE: u8 = 0xD9;
const START_OF_SCAN: u8 = 0xDA;

/// Checks whether the first picture of `file` has its end: the mark EOI after its last scan. Pictures inside segments,
/// such as thumbnails, and pictures behind the first one do not count.
pub(crate) fn is_whole(file: &[u8]) -> bool {
    let mut rest = file.get(2..).unwrap_or_default();
    while let Some((marker, after)) = next_marker(rest) {
        rest = match marker {
            END_OF_IMAGE => return true,
            // Marks without a segment.
            0x01 | 0xD0..=0xD8 => after,
            _ => {
                let Some((length, _)) = after.split_first_chunk() else {
                    return false;
                };
                let Some(behind) = after.get(usize::from(u16::from_be_bytes(*length))..) else {
                    return false;
                };
                if marker == START_OF_SCAN {
                    behind_scan(behind)
                } else {
                    behind
                }
            }
        };
    }
    false
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
        assert!(is_whole(&whole));
        for end in 0..whole.len() {
            assert!(!is_whole(&whole[..end]), "{end}");
        }
        // Some programs fill up the missing part with zeros.
        let mut filled = whole[..whole.len() / 2].to_vec();
        filled.resize(whole.len(), 0);
        assert!(!is_whole(&filled));
    }

    #[test]
    fn a_thumbnail_and_what_follows_do_not_count() {
        let (whole, thumbnail) = (jpeg(Size { width: 40, height: 30 }), jpeg(Size { width: 8, height: 8 }));
        let length = (thumbnail.len() as u16 + 2).to_be_bytes();
        let with = [&whole[..2], &[0xFF, 0xE1], &length, &thumbnail, &whole[2..]].concat();
        assert!(is_whole(&with));
        assert!(!is_whole(&with[..with.len() - 40]));
        // A second picture, as phones append, or any data.
        assert!(is_whole(&[&with[..], &thumbnail].concat()));
        assert!(is_whole(&[&with[..], &[0; 99]].concat()));
    }
}
