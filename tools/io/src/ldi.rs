//! Layered depth images (LDI): for each pixel, the front-facing surfaces along the line of sight, front first (paper,
//! Fig. 1), stored in a folder as `layer_0.png, depth_0.png, layer_1.png …`.

use crate::output::{self, Pending};
use crate::picture::open_image;
use crate::{Error, Result};
use image::codecs::png::PngEncoder;
use image::{DynamicImage, ExtendedColorType, ImageEncoder};
use ndarray::{Array2, Array3};
use phasefront::Size;
use phasefront::{Display, RgbdFrame};
use phasefront_core::frame::luminance;
use phasefront_core::method::network::Source;
use std::borrow::Cow;
use std::fs;
use std::path::Path;

/// A layered depth image: at least one layer, front first, all with the same shape.
#[derive(Debug, Clone, PartialEq)]
pub struct Ldi {
    /// The layers. Layer 0 is the surface that the viewer sees.
    pub layers: Vec<LdiLayer>,
}

/// One layer of an [`Ldi`]: the colour and depth of at most one hit per pixel.
#[derive(Debug, Clone)]
pub struct LdiLayer {
    /// The amplitudes, (3, H, W) in [0, 1], in R, G, B order. Values without a hit are arbitrary.
    pub rgb: Array3<f32>,
    /// The normalized depth, (H, W): 0 is nearest, 1 is farthest, and NaN means no hit.
    pub depth: Array2<f32>,
}

impl From<&RgbdFrame> for LdiLayer {
    /// Converts a frame to one layer. The single amplitude of one laser is used for all three colours.
    fn from(frame: &RgbdFrame) -> Self {
        let Size { width, height } = frame.size();
        let rgb = frame.rgb();
        let rgb = rgb.broadcast((3, height, width)).expect("three colours or one");
        LdiLayer {
            rgb: rgb.to_owned(),
            depth: frame.depth().to_owned(),
        }
    }
}

impl PartialEq for LdiLayer {
    /// Compares bit by bit, including NaN.
    fn eq(&self, other: &Self) -> bool {
        let same = |a: &f32, b: &f32| a.to_bits() == b.to_bits();
        self.rgb.dim() == other.rgb.dim()
            && self.depth.dim() == other.depth.dim()
            && self.rgb.iter().zip(&other.rgb).all(|(a, b)| same(a, b))
            && self.depth.iter().zip(&other.depth).all(|(a, b)| same(a, b))
    }
}

/// Provides the planes of [`phasefront_core::method::network::InputKind::Ldi`]: red, green, blue and depth of each
/// layer in turn, each minus ½. Pixels without a hit and absent layers are black and farthest.
impl Source for Ldi {
    fn read(&self, plane: usize, row: usize, from: usize, into: &mut [f32]) {
        let Some(layer) = self.layers.get(plane / 4) else {
            return into.fill(if plane % 4 == 3 { 0.5 } else { -0.5 });
        };
        for (x, to) in into.iter_mut().enumerate() {
            let at = (row, from + x);
            let depth = layer.depth[at];
            *to = match (plane % 4, depth.is_nan()) {
                (3, true) => 0.5,
                (3, false) => depth - 0.5,
                (_, true) => -0.5,
                (colour, false) => layer.rgb[(colour, at.0, at.1)] - 0.5,
            };
        }
    }
}

impl Ldi {
    /// Creates an LDI. Checks that there is at least one layer, that all layers have the same shape, that colours and
    /// depths are in [0, 1] (or NaN depth, for no hit), and that no hit lies in front of a hit of an earlier layer.
    pub fn new(layers: Vec<LdiLayer>) -> Result<Self> {
        check_layers(&layers).map_err(|(_, reason)| Error::Input(reason))?;
        Ok(Self { layers })
    }

    /// Converts the colours for the lasers of `display`: for one laser, all three colours become the luminance
    /// ([`RgbdFrame::for_display`]).
    pub fn for_display(&self, display: &Display) -> Cow<'_, Self> {
        if display.colours() == 3 {
            return Cow::Borrowed(self);
        }
        let grey = |layer: &LdiLayer| {
            let (_, height, width) = layer.rgb.dim();
            let rgb = layer.rgb.as_standard_layout();
            let mut amplitude = Array2::zeros((height, width));
            let values = rgb.as_slice().zip(amplitude.as_slice_mut());
            let (rgb, values) = values.expect("both are in standard layout");
            luminance(rgb, values);
            LdiLayer {
                rgb: amplitude.broadcast((3, height, width)).expect("one plane").to_owned(),
                depth: layer.depth.clone(),
            }
        };
        Cow::Owned(Ldi {
            layers: self.layers.iter().map(grey).collect(),
        })
    }

    /// Returns the size.
    pub fn size(&self) -> Size {
        Size::from_shape(self.layers[0].depth.dim())
    }

    /// Rounds every value to the precision of the PNGs of [`write`](Self::write): colours to 8 bits, depths to 16,
    /// black without a hit. The result and the written folder give the same hologram.
    pub fn quantized(&self) -> Self {
        let layers = self.layers.iter().map(|layer| {
            let (rgba, depth) = to_codes(layer);
            let depths: Vec<f32> = depth.iter().map(|&code| depth_of_code(code)).collect();
            from_codes(Size::from_shape(layer.depth.dim()), &rgba, &depths)
        });
        Self {
            layers: layers.collect(),
        }
    }

    /// Reads the folder `dir`. Colour PNGs are read as RGBA of 8 bits. Without an alpha channel, every pixel is a hit.
    /// Depth PNGs are grey of 16 or 8 bits, with d = value / 65535 or value / 255.
    pub fn read(dir: &Path) -> Result<Self> {
        output::reading(dir)?;
        let count = count_layers(dir)?;
        let mut layers = Vec::with_capacity(count);
        for index in 0..count {
            layers.push(read_layer(dir, index)?);
        }
        check_layers(&layers).map_err(|(index, reason)| Error::file(dir.join(depth_name(index)), reason))?;
        Ok(Self { layers })
    }

    /// Writes the folder `dir`, which is created if it is absent. Its parent must exist. All files are complete before
    /// the first takes its place. In an existing folder, layers of an earlier LDI are replaced or removed and other
    /// files stay.
    pub fn write(&self, dir: &Path) -> Result<()> {
        let is_new = !dir.is_dir();
        if is_new {
            fs::create_dir(dir).map_err(|e| Error::file(dir, format!("cannot be made: {e}")))?;
        }
        let written = self.write_into(dir);
        if is_new && written.is_err() {
            // This removes the folder only if it is empty.
            let _ = fs::remove_dir(dir);
        }
        written
    }

    fn write_into(&self, dir: &Path) -> Result<()> {
        let mut files = Vec::with_capacity(self.layers.len());
        for (index, layer) in self.layers.iter().enumerate() {
            files.push(write_layer(dir, index, layer)?);
        }
        // A folder without its first layer is not a valid LDI, so readers reject the remains of an interrupted run.
        remove_layer(dir, 0)?;
        for index in stored_layers(dir)? {
            if index >= self.layers.len() {
                remove_layer(dir, index)?;
            }
        }
        for (colour, depth) in files.into_iter().rev() {
            depth.place()?;
            colour.place()?;
        }
        Ok(())
    }
}

fn remove_layer(dir: &Path, index: usize) -> Result<()> {
    for place in [dir.join(layer_name(index)), dir.join(depth_name(index))] {
        match fs::remove_file(&place) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(Error::file(place, e)),
            _ => {}
        }
    }
    Ok(())
}

fn layer_name(index: usize) -> String {
    format!("layer_{index}.png")
}

fn depth_name(index: usize) -> String {
    format!("depth_{index}.png")
}

/// Checks the layers. The error holds the index of the invalid layer and the reason.
fn check_layers(layers: &[LdiLayer]) -> std::result::Result<(), (usize, String)> {
    let Some(first) = layers.first() else {
        return Err((0, "a layered depth image needs at least one layer".into()));
    };
    let (height, width) = first.depth.dim();
    if height == 0 || width == 0 {
        return Err((0, format!("an image of {width}x{height} pixels is empty")));
    }
    let mut deepest = Array2::from_elem((height, width), f32::NEG_INFINITY);
    for (index, layer) in layers.iter().enumerate() {
        let bad = |reason: String| Err((index, format!("layer {index}: {reason}")));
        if layer.depth.dim() != (height, width) || layer.rgb.dim() != (3, height, width) {
            let (_, h, w) = layer.rgb.dim();
            let (dh, dw) = layer.depth.dim();
            return bad(format!(
                "colour is {w}x{h} and depth {dw}x{dh}, expected {width}x{height} as in layer 0"
            ));
        }
        if let Some(value) = layer.rgb.iter().find(|value| !(0.0..=1.0).contains(*value)) {
            return bad(format!("colour {value} is outside [0, 1]"));
        }
        if let Some(value) = layer.depth.iter().find(|d| !d.is_nan() && !(0.0..=1.0).contains(*d)) {
            return bad(format!("depth {value} is outside [0, 1]"));
        }
        for (deepest, &d) in deepest.iter_mut().zip(&layer.depth) {
            if d < *deepest {
                return bad(format!(
                    "a depth of {d} lies in front of {deepest} of an earlier layer; 0 is nearest, 1 farthest, front layers first"
                ));
            }
            *deepest = deepest.max(d);
        }
    }
    Ok(())
}

/// Returns the layer's RGBA, (H, W, 4), in 8 bits and its depth, (H, W), in 16 bits. Without a hit, colours and alpha
/// are zero and the depth is farthest.
fn to_codes(layer: &LdiLayer) -> (Vec<u8>, Vec<u16>) {
    let (height, width) = layer.depth.dim();
    let mut rgba = Vec::with_capacity(height * width * 4);
    let mut depth = Vec::with_capacity(height * width);
    for ((y, x), &d) in layer.depth.indexed_iter() {
        if d.is_nan() {
            rgba.extend_from_slice(&[0; 4]);
            depth.push(u16::MAX);
        } else {
            rgba.extend((0..3).map(|c| (layer.rgb[[c, y, x]] * 255.0).round() as u8));
            rgba.push(255);
            depth.push((d * 65535.0).round() as u16);
        }
    }
    (rgba, depth)
}

/// Converts a 16-bit depth code of a file to normalized depth.
pub fn depth_of_code(code: u16) -> f32 {
    f32::from(code) / 65535.0
}

/// Inverts [`to_codes`], with the depths already decoded.
fn from_codes(Size { width, height }: Size, rgba: &[u8], depths: &[f32]) -> LdiLayer {
    let hit = |pixel: usize| rgba[4 * pixel + 3] > 0;
    LdiLayer {
        rgb: Array3::from_shape_fn((3, height, width), |(c, y, x)| {
            let pixel = y * width + x;
            if hit(pixel) {
                f32::from(rgba[4 * pixel + c]) / 255.0
            } else {
                0.0
            }
        }),
        depth: Array2::from_shape_fn((height, width), |(y, x)| {
            let pixel = y * width + x;
            if hit(pixel) { depths[pixel] } else { f32::NAN }
        }),
    }
}

/// Returns the layer indices in the folder, ascending.
fn stored_layers(dir: &Path) -> Result<Vec<usize>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(dir).map_err(|e| Error::file(dir, e))? {
        let name = entry.map_err(|e| Error::file(dir, e))?.file_name();
        let Some(index) = name
            .to_str()
            .and_then(|n| n.strip_prefix("layer_")?.strip_suffix(".png"))
        else {
            continue;
        };
        if let Ok(index) = index.parse::<usize>()
            && layer_name(index).as_str() == name
        {
            found.push(index);
        }
    }
    found.sort_unstable();
    Ok(found)
}

/// Returns the number of layers in the folder. Their numbers must have no gap.
fn count_layers(dir: &Path) -> Result<usize> {
    let found = stored_layers(dir)?;
    if found.is_empty() {
        return Err(Error::file(
            dir,
            "no layer_0.png here; an LDI folder holds layer_0.png, depth_0.png, layer_1.png …",
        ));
    }
    match found.iter().enumerate().find(|&(expected, &index)| expected != index) {
        Some((missing, next)) => Err(Error::file(
            dir.join(layer_name(missing)),
            format!(
                "missing, though {} is there; layers are numbered from 0 without a gap",
                layer_name(*next)
            ),
        )),
        None => Ok(found.len()),
    }
}

fn read_layer(dir: &Path, index: usize) -> Result<LdiLayer> {
    let colour = open_image(&dir.join(layer_name(index)))?.to_rgba8();
    let depth_path = dir.join(depth_name(index));
    let (depth_size, depths): (_, Vec<f32>) = match open_image(&depth_path)? {
        DynamicImage::ImageLuma16(image) => (image.dimensions(), image.iter().map(|&v| depth_of_code(v)).collect()),
        DynamicImage::ImageLuma8(image) => (
            image.dimensions(),
            image.iter().map(|&v| f32::from(v) / 255.0).collect(),
        ),
        other => {
            return Err(Error::file(
                depth_path,
                format!("{:?} pixels; a depth map is grey of 16 or 8 bits", other.color()),
            ));
        }
    };
    let (width, height) = colour.dimensions();
    if depth_size != (width, height) {
        let (w, h) = depth_size;
        return Err(Error::file(
            depth_path,
            format!("{w}x{h} pixels, but its layer has {width}x{height}"),
        ));
    }
    let size = Size {
        width: width as usize,
        height: height as usize,
    };
    Ok(from_codes(size, colour.as_raw(), &depths))
}

/// Writes the layer's two files, without putting them in place yet.
fn write_layer(dir: &Path, index: usize, layer: &LdiLayer) -> Result<(Pending, Pending)> {
    let (height, width) = layer.depth.dim();
    let (rgba, depth) = to_codes(layer);
    let encode = |name: String, bytes: &[u8], kind| {
        let path = dir.join(name);
        let (Ok(width), Ok(height)) = (u32::try_from(width), u32::try_from(height)) else {
            return Err(Error::file(
                path,
                format!("{width}x{height} pixels are too many for a PNG"),
            ));
        };
        Pending::write(&path, |file| {
            let encoder = PngEncoder::new(file);
            encoder
                .write_image(bytes, width, height, kind)
                .map_err(std::io::Error::other)
        })
    };
    let depth_bytes: Vec<u8> = depth.iter().flat_map(|code| code.to_ne_bytes()).collect();
    Ok((
        encode(layer_name(index), &rgba, ExtendedColorType::Rgba8)?,
        encode(depth_name(index), &depth_bytes, ExtendedColorType::L16)?,
    ))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    /// Creates two layers of 7×5 pixels with holes and with values that lie between codes.
    fn sample() -> Ldi {
        let layer = |base: f32, hole: usize| LdiLayer {
            rgb: Array3::from_shape_fn((3, 5, 7), |(c, y, x)| ((c * 35 + y * 7 + x) as f32 * 0.618) % 1.0),
            depth: Array2::from_shape_fn((5, 7), |(y, x)| {
                if (y + x) % hole == 0 {
                    f32::NAN
                } else {
                    base + 0.3 * (y * 7 + x) as f32 / 35.0
                }
            }),
        };
        Ldi::new(vec![layer(0.1, 4), layer(0.6, 2)]).unwrap()
    }

    fn names(dir: &Path) -> Vec<String> {
        let mut names: Vec<_> = fs::read_dir(dir)
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn networks_read_layers_in_turn_and_black_at_the_back_where_there_is_none() {
        let ldi = sample();
        let read = |plane: usize, row: usize| {
            let mut values = [f32::NAN; 4];
            ldi.read(plane, row, 2, &mut values);
            values
        };
        for row in 0..5 {
            for (index, layer) in ldi.layers.iter().enumerate() {
                for channel in 0..4 {
                    for (value, x) in read(4 * index + channel, row).into_iter().zip(2..) {
                        let depth = layer.depth[(row, x)];
                        let there = match (channel, depth.is_nan()) {
                            (3, _) => {
                                if depth.is_nan() {
                                    1.0
                                } else {
                                    depth
                                }
                            }
                            (_, true) => 0.0,
                            (c, false) => layer.rgb[(c, row, x)],
                        };
                        assert_eq!(value, there - 0.5, "{index} {channel} {row} {x}");
                    }
                }
            }
            assert_eq!(read(8, row), [-0.5; 4]);
            assert_eq!(read(11, row), [0.5; 4]);
        }
    }

    #[test]
    fn what_is_written_is_read_as_quantized() {
        let root = tempfile::tempdir().unwrap();
        let dir = root.path().join("scene");
        let ldi = sample();
        ldi.write(&dir).unwrap();
        let read = Ldi::read(&dir).unwrap();
        assert_eq!(read, ldi.quantized());
        assert_eq!(read.quantized(), read, "rounding twice is rounding once");
        assert_ne!(read, ldi);
        for (read, made) in read.layers.iter().zip(&ldi.layers) {
            for ((y, x), &d) in made.depth.indexed_iter() {
                assert_eq!(read.depth[[y, x]].is_nan(), d.is_nan());
                if !d.is_nan() {
                    assert!((read.depth[[y, x]] - d).abs() <= 0.5 / 65535.0 + 1e-7);
                    assert!((0..3).all(|c| (read.rgb[[c, y, x]] - made.rgb[[c, y, x]]).abs() <= 0.5 / 255.0 + 1e-6));
                }
            }
        }
        assert_eq!(names(root.path()), ["scene"], "no temporary folder stays");
    }

    #[test]
    fn writing_again_replaces_layers_and_leaves_other_files() {
        let root = tempfile::tempdir().unwrap();
        sample().write(root.path()).unwrap();
        fs::write(root.path().join("notes.txt"), "mine").unwrap();
        let one = Ldi::new(sample().layers[..1].to_vec()).unwrap();
        one.write(root.path()).unwrap();
        assert_eq!(names(root.path()), ["depth_0.png", "layer_0.png", "notes.txt"]);
        assert_eq!(Ldi::read(root.path()).unwrap(), one.quantized());
    }

    #[test]
    fn eight_bit_depth_and_colour_without_alpha_are_read() {
        let root = tempfile::tempdir().unwrap();
        image::RgbImage::from_pixel(2, 1, image::Rgb([51, 0, 255]))
            .save(root.path().join("layer_0.png"))
            .unwrap();
        image::GrayImage::from_raw(2, 1, vec![0, 51])
            .unwrap()
            .save(root.path().join("depth_0.png"))
            .unwrap();
        let ldi = Ldi::read(root.path()).unwrap();
        assert_eq!(ldi.layers[0].depth.as_slice().unwrap(), [0.0, 0.2]);
        assert_eq!(
            ldi.layers[0].rgb.iter().copied().collect::<Vec<_>>(),
            [0.2, 0.2, 0.0, 0.0, 1.0, 1.0]
        );
    }

    /// Asserts that reading fails with an error that names the file `name` and contains `reason`.
    fn assert_refused(dir: &Path, name: &str, reason: &str) {
        let message = Ldi::read(dir).unwrap_err().to_string();
        assert!(message.contains(name) && message.contains(reason), "{message}");
        assert!(!message.contains('\n'), "{message}");
    }

    #[test]
    fn broken_folders_are_refused_by_name() {
        let root = tempfile::tempdir().unwrap();
        assert_refused(&root.path().join("absent"), "absent", "No such file");
        assert_refused(root.path(), "", "no layer_0.png");

        let dir = root.path().join("scene");
        let restore = || sample().write(&dir).unwrap();
        restore();
        fs::rename(dir.join("layer_0.png"), dir.join("layer_2.png")).unwrap();
        assert_refused(&dir, "layer_0.png", "missing, though layer_1.png");
        restore();
        fs::remove_file(dir.join("depth_1.png")).unwrap();
        assert_refused(&dir, "depth_1.png", "No such file");
        restore();
        let bytes = fs::read(dir.join("layer_1.png")).unwrap();
        fs::write(dir.join("layer_1.png"), &bytes[..bytes.len() / 2]).unwrap();
        assert_refused(&dir, "layer_1.png", "not a whole picture");
        restore();
        image::GrayImage::new(3, 3).save(dir.join("depth_0.png")).unwrap();
        assert_refused(&dir, "depth_0.png", "3x3 pixels, but its layer has 7x5");
        image::RgbImage::new(7, 5).save(dir.join("depth_0.png")).unwrap();
        assert_refused(&dir, "depth_0.png", "grey of 16 or 8 bits");
        restore();
        fs::rename(dir.join("depth_0.png"), dir.join("swap")).unwrap();
        fs::rename(dir.join("depth_1.png"), dir.join("depth_0.png")).unwrap();
        fs::rename(dir.join("swap"), dir.join("depth_1.png")).unwrap();
        assert_refused(&dir, "depth_1.png", "in front of");
    }

    #[test]
    fn the_constructor_refuses_what_is_no_ldi() {
        let refused = |layers: Vec<LdiLayer>, reason: &str| {
            let message = Ldi::new(layers).unwrap_err().to_string();
            assert!(message.contains(reason), "{message}");
        };
        let good = sample().layers;
        refused(Vec::new(), "at least one layer");
        refused(
            vec![LdiLayer {
                rgb: Array3::zeros((3, 0, 4)),
                depth: Array2::zeros((0, 4)),
            }],
            "empty",
        );
        let mut layers = good.clone();
        layers[1].rgb = Array3::zeros((3, 5, 6));
        refused(layers, "layer 1: colour is 6x5");
        for bad in [f32::NAN, f32::INFINITY, -0.1, 1.1] {
            let mut layers = good.clone();
            layers[0].rgb[[1, 2, 3]] = bad;
            refused(layers, "outside [0, 1]");
        }
        for bad in [f32::INFINITY, -0.1, 1.1] {
            let mut layers = good.clone();
            layers[1].depth[[2, 3]] = bad;
            refused(layers, "outside [0, 1]");
        }
        refused(good.into_iter().rev().collect(), "in front of");
    }

    #[test]
    fn an_unwritable_place_leaves_nothing() {
        let root = tempfile::tempdir().unwrap();
        let message = sample()
            .write(&root.path().join("no/such/place"))
            .unwrap_err()
            .to_string();
        assert!(message.contains("no/such/place"), "{message}");
        fs::write(root.path().join("file"), "").unwrap();
        assert!(sample().write(&root.path().join("file")).is_err());
        assert_eq!(names(root.path()), ["file"]);
    }
}
