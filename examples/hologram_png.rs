//! Writes a hologram as a file that `phasefront refocus` and `phasefront view` read.

use phasefront::Hologram;
use phasefront::Size;
use std::error::Error;
use std::fs::File;
use std::path::Path;

/// Writes the levels of `hologram` as a PNG. Its text chunk `phasefront` describes the levels: the display, the
/// encoding (`anti-alias` is a session's default) and the amplitude that full light represents.
pub(crate) fn save(hologram: &Hologram, path: &Path) -> Result<(), Box<dyn Error>> {
    let Size { width, height } = hologram.size();
    // The levels are planar, (C, H, W); the pixels of a PNG interleave the colours.
    let planes = hologram.levels().chunks_exact(height * width).collect::<Vec<_>>();
    let pixels = (0..height * width).flat_map(|i| planes.iter().map(move |plane| plane[i]));
    let about = serde_json::json!({
        "display": hologram.target().display, "encoder": "anti-alias", "scale": hologram.scale(),
    });
    let mut png = png::Encoder::new(File::create(path)?, width as u32, height as u32);
    png.set_color(png::ColorType::Rgb);
    png.add_text_chunk("phasefront".into(), about.to_string())?;
    png.write_header()?.write_image_data(&pixels.collect::<Vec<u8>>())?;
    Ok(())
}
