//! The picture in the README, from what `samples/run` left in `out/`: input, hologram, near and far
//! focus; below, the board and the clock in either focus.
//!
//! `cargo run --release --example readme_picture`

use image::imageops::{self, FilterType};
use image::{RgbImage, codecs::jpeg::JpegEncoder};
use phasefront_lab::files::write_atomically;
use std::path::Path;

/// Width and height of one of the eight parts.
const PART: (u32, u32) = (480, 270);

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let open = |path: &str| -> Result<RgbImage, Box<dyn std::error::Error>> {
        let image = image::open(path).map_err(|e| format!("{path}: {e}; run samples/run first"))?;
        Ok(image.into_rgb8())
    };
    let input = open("samples/scene_rgb.jpg")?;
    let hologram = open("out/hologram.png")?;
    let (near, far) = (open("out/near.png")?, open("out/far.png")?);
    let whole = |image: &RgbImage| imageops::resize(image, PART.0, PART.1, FilterType::Triangle);
    let part = |image: &RgbImage, x, y| imageops::crop_imm(image, x, y, PART.0, PART.1).to_image();
    let board = (110, 590);
    let clock = (1370, 160);
    let parts = [
        [
            whole(&input),
            part(&hologram, board.0, board.1),
            whole(&near),
            whole(&far),
        ],
        [
            part(&near, board.0, board.1),
            part(&far, board.0, board.1),
            part(&near, clock.0, clock.1),
            part(&far, clock.0, clock.1),
        ],
    ];
    let mut picture = RgbImage::new(4 * PART.0, 2 * PART.1);
    for (row, parts) in parts.iter().enumerate() {
        for (column, part) in parts.iter().enumerate() {
            let (x, y) = (column as u32 * PART.0, row as u32 * PART.1);
            imageops::replace(&mut picture, part, x.into(), y.into());
        }
    }
    write_atomically(Path::new("docs/images/overview.jpg"), |file| {
        JpegEncoder::new_with_quality(file, 88)
            .encode_image(&picture)
            .map_err(std::io::Error::other)
    })?;
    Ok(())
}
