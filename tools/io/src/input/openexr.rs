//! Depth maps and colours in OpenEXR files: the choice of the channels, and their place in the picture.

use crate::input::decode::{Numbers, Plane, Said, broken, check};
use exr::block::reader::{ChunksReader, Reader};
use exr::math::Vec2;
use exr::meta::BlockDescription;
use exr::meta::attribute::SampleType;
use exr::meta::header::Header;
use ndarray::Array2;
use phasefront::Size;
use std::io::{Read, Seek};

/// The maximum number of bytes of all channels of a part, and of one of its blocks, which is decoded whole.
const MOST_LAYER: u64 = 1 << 31;
const MOST_BLOCK: u64 = 1 << 28;

/// Decodes the depth channel, or the colour channels if they are equal. The result has the size of the display window.
/// Pixels outside the data window are NaN.
pub(crate) fn depth<R: Read + Seek>(from: R, most_pixels: u64) -> Said<Plane> {
    let reader = exr::block::read(from, false).map_err(|e| broken(&e))?;
    for header in reader.headers() {
        check_part(header, most_pixels)?;
    }
    let wanted = depth_channels(reader.headers())?;
    let (mut planes, header) = planes(reader, &wanted, most_pixels)?;
    let alike = |other: &Array2<f32>| other.iter().zip(&planes[0]).all(|(a, b)| a.to_bits() == b.to_bits());
    if !planes[1..].iter().all(alike) {
        return Err(
            "is OpenEXR of colours without a channel of depth (Z or depth), and is read as colour alone".into(),
        );
    }
    let numbers = match header.channels.list[wanted[0].index].sample_type {
        SampleType::F16 => Numbers::Halves,
        SampleType::F32 | SampleType::U32 => Numbers::Floats,
    };
    Ok(Plane {
        values: planes.swap_remove(0),
        numbers,
    })
}

/// Linear light, with the x and y of red, green, blue and white if the file has them.
pub(crate) struct Light {
    /// Red, green and blue in the display window, NaN outside the data window, (H, W) each.
    pub(crate) planes: Vec<Array2<f32>>,
    pub(crate) primaries: Option<[[f32; 2]; 4]>,
}

/// Decodes the red, green and blue of the only layer that has them, or of the one without a name or called Combined.
pub(crate) fn colour<R: Read + Seek>(from: R, most_pixels: u64) -> Said<Light> {
    let reader = exr::block::read(from, false).map_err(|e| broken(&e))?;
    for header in reader.headers() {
        check_part(header, most_pixels)?;
    }
    let wanted = colour_channels(&flat_channels(reader.headers()))?;
    let (planes, header) = planes(reader, &wanted, most_pixels)?;
    let primaries = header.shared_attributes.chromaticities;
    Ok(Light {
        planes,
        primaries: primaries.map(|p| [p.red, p.green, p.blue, p.white].map(|Vec2(x, y)| [x, y])),
    })
}

/// Returns the red, green and blue of one layer.
fn colour_channels(all: &[Channel]) -> Said<Vec<Channel>> {
    let beside = |red: &Channel, name: &str| {
        let found = all.iter().find(|other| other.is_beside(red) && other.words().1 == name);
        found.cloned()
    };
    let reds = all.iter().filter(|channel| channel.words().1 == "r");
    let mut layers: Vec<Vec<Channel>> = reds
        .filter_map(|red| Some(vec![red.clone(), beside(red, "g")?, beside(red, "b")?]))
        .collect();
    let whole = |layer: &Vec<Channel>| ["", "combined", "rgb", "rgba"].contains(&layer[0].words().0.as_str());
    if layers.len() > 1 {
        layers.retain(whole);
    }
    match layers.len() {
        1 => Ok(layers.remove(0)),
        0 => Err("is OpenEXR without R, G and B of one picture; save its colours as such channels".into()),
        _ => Err("is OpenEXR with several pictures; save one of them alone".into()),
    }
}

/// Decodes channels of one part, in the display window; NaN outside the data window. Also returns the part's header.
fn planes<R: Read + Seek>(reader: Reader<R>, wanted: &[Channel], most_pixels: u64) -> Said<(Vec<Array2<f32>>, Header)> {
    let part = wanted[0].part;
    let header = reader.headers()[part].clone();
    let window = Window::of(&header, most_pixels)?;
    let indices: Vec<usize> = wanted.iter().map(|channel| channel.index).collect();
    let described = |index: &usize| &header.channels.list[*index];
    if indices.iter().any(|index| described(index).sampling != Vec2(1, 1)) {
        return Err(
            "is OpenEXR with a channel of fewer pixels than its picture; save it with a value for each pixel".into(),
        );
    }
    let mut planes = vec![Array2::from_elem(window.size.shape(), f32::NAN); indices.len()];
    let chunks = reader.filter_chunks(false, |_, tile, block| {
        block.layer == part && tile.level_index == Vec2(0, 0)
    });
    let mut blocks = chunks.map_err(|e| broken(&e))?.sequential_decompressor(false);
    while let Some(block) = blocks.decompress_next_block() {
        let block = block.map_err(|e| broken(&e))?;
        for line in block.lines(&header.channels) {
            let Some(plane) = indices.iter().position(|index| *index == line.location.channel) else {
                continue;
            };
            let samples: exr::error::Result<Vec<f32>> = match described(&indices[plane]).sample_type {
                SampleType::F16 => line.read_samples::<half::f16>().map(|v| v.map(f32::from)).collect(),
                SampleType::F32 => line.read_samples().collect(),
                SampleType::U32 => line.read_samples::<u32>().map(|v| v.map(|v| v as f32)).collect(),
            };
            window.put(
                &mut planes[plane],
                line.location.position,
                &samples.map_err(|e| broken(&e))?,
            );
        }
    }
    Ok((planes, header))
}

/// Checks the number of pixels of an part and the bytes of all its channels, which are decoded together.
fn check_part(header: &Header, most_pixels: u64) -> Said<()> {
    let Vec2(width, height) = header.layer_size;
    check(Size { width, height }, most_pixels)?;
    let bytes = |width: usize, height: usize| {
        (width as u64 * height as u64).saturating_mul(header.channels.bytes_per_pixel as u64)
    };
    let block = match header.blocks {
        BlockDescription::ScanLines => bytes(width, header.compression.scan_lines_per_block().min(height)),
        BlockDescription::Tiles(tiles) => bytes(tiles.tile_size.0.min(width), tiles.tile_size.1.min(height)),
    };
    if bytes(width, height) > MOST_LAYER || block > MOST_BLOCK {
        return Err(format!(
            "is OpenEXR with {} channels of {width}×{height} pixels, {} bytes in blocks of {block}; {MOST_LAYER} in blocks of {MOST_BLOCK} are the most: save depth alone",
            header.channels.list.len(),
            bytes(width, height),
        ));
    }
    Ok(())
}

/// The data window of a part within the display window.
struct Window {
    /// The size of the display window.
    size: Size,
    /// The first pixel of the data window in the display window, (x, y).
    at: (i64, i64),
}

impl Window {
    fn of(header: &Header, most_pixels: u64) -> Said<Self> {
        let display = header.shared_attributes.display_window;
        let size = Size {
            width: display.size.width(),
            height: display.size.height(),
        };
        check(size, most_pixels)?;
        let data = header.own_attributes.layer_position;
        let apart = |data: i32, display: i32| i64::from(data) - i64::from(display);
        Ok(Window {
            size,
            at: (
                apart(data.x(), display.position.x()),
                apart(data.y(), display.position.y()),
            ),
        })
    }

    /// Puts the part of `samples`, a row that begins at `start` of the data window, that lies in the display window
    /// into `plane`.
    fn put(&self, plane: &mut Array2<f32>, start: Vec2<usize>, samples: &[f32]) {
        let row = start.y() as i64 + self.at.1;
        for (x, sample) in samples.iter().enumerate() {
            let column = (start.x() + x) as i64 + self.at.0;
            if let (Ok(row), Ok(column)) = (usize::try_from(row), usize::try_from(column))
                && let Some(pixel) = plane.get_mut((row, column))
            {
                *pixel = *sample;
            }
        }
    }
}

/// A channel of a part without deep data.
#[derive(Debug, Clone, PartialEq)]
struct Channel {
    part: usize,
    /// The index in the part.
    index: usize,
    /// The name, after those of its part and layers, as in `ViewLayer.Depth.Z`.
    name: String,
}

impl Channel {
    /// Returns the name of the layer and of the channel in it, in lower case: `depth` and `z` of `ViewLayer.Depth.Z`.
    fn words(&self) -> (String, String) {
        let name = self.name.to_lowercase();
        let (layers, channel) = name.rsplit_once('.').unwrap_or(("", &name));
        let layer = layers.rsplit('.').next().unwrap_or_default();
        (layer.to_owned(), channel.to_owned())
    }

    fn is_beside(&self, other: &Channel) -> bool {
        let layer = |channel: &Channel| channel.name.rfind('.').map(|end| channel.name[..end].to_owned());
        self.part == other.part && layer(self) == layer(other)
    }

    /// Checks whether the channel is a component of a vector, such as a normal, or of colours by luminance.
    fn is_component(&self, all: &[Channel]) -> bool {
        const VECTORS: [&str; 8] = ["n", "nn", "p", "pos", "point", "uv", "st", "world"];
        const PARTS: [&str; 6] = ["normal", "position", "vector", "velocity", "motion", "tangent"];
        let (layer, channel) = self.words();
        if !["x", "y", "z", "w"].contains(&channel.as_str()) {
            return false;
        }
        let has = |name: &str| all.iter().any(|other| other.is_beside(self) && other.words().1 == name);
        let is_vector = has("x") && (has("y") || has("z"));
        let is_named = VECTORS.contains(&layer.as_str()) || PARTS.iter().any(|part| layer.contains(part));
        let is_luminance = channel == "y" && (has("ry") || has("by"));
        is_vector || is_named || is_luminance
    }

    /// Returns how surely the channel is depth, or `None` if it is not.
    fn likeness(&self) -> Option<Likeness> {
        let (layer, channel) = self.words();
        let is_depth = |word: &str| ["z", "depth", "zdepth"].contains(&word);
        match channel.as_str() {
            _ if is_depth(&layer) => Some(Likeness::Named),
            channel if is_depth(channel) && layer.is_empty() => Some(Likeness::Named),
            _ if layer.contains("depth") => Some(Likeness::OfDepth),
            channel if is_depth(channel) => Some(Likeness::Z),
            "y" | "d" => Some(Likeness::Scalar),
            _ => None,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Likeness {
    /// `dd.y` and `Y`: a value without a vector.
    Scalar,
    /// `Mist.Z` and `left.depth`.
    Z,
    /// `Denoising Depth.Z` and `FinalImageWorldDepth.R`.
    OfDepth,
    /// `Z`, `depth`, `ViewLayer.Depth.Z` and `Depth.V`.
    Named,
}

/// Returns the depth channel, or the three colour channels of one layer.
fn depth_channels(headers: &[Header]) -> Said<Vec<Channel>> {
    chosen(&flat_channels(headers))
}

fn flat_channels(headers: &[Header]) -> Vec<Channel> {
    let flat = headers.iter().enumerate().filter(|(_, header)| !header.deep);
    flat.flat_map(|(part, header)| {
        let of = header.own_attributes.layer_name.as_ref().filter(|_| headers.len() > 1);
        let of = of.map_or(String::new(), |name| format!("{name}."));
        let channels = header.channels.list.iter().enumerate();
        channels.map(move |(index, channel)| Channel {
            part,
            index,
            name: format!("{of}{}", channel.name),
        })
    })
    .collect()
}

fn chosen(all: &[Channel]) -> Said<Vec<Channel>> {
    let listed = |channels: &[Channel]| {
        let names: Vec<_> = channels.iter().map(|channel| channel.name.as_str()).collect();
        names.join(", ")
    };
    let scalars = all.iter().filter(|channel| !channel.is_component(all));
    let likely: Vec<(Likeness, Channel)> = scalars
        .filter_map(|channel| Some((channel.likeness()?, channel.clone())))
        .collect();
    if let Some(most) = likely.iter().map(|(likeness, _)| *likeness).max() {
        let best = likely.into_iter().filter(|(likeness, _)| *likeness == most);
        let best: Vec<Channel> = best.map(|(_, channel)| channel).collect();
        return match best.as_slice() {
            [_] => Ok(best),
            best if is_grey(best) => Ok(best.to_vec()),
            best => Err(format!(
                "is OpenEXR with several channels of depth: {}; save a file of one of them",
                listed(best)
            )),
        };
    }
    let colours: Vec<Channel> = (all.iter())
        .filter(|channel| ["R", "G", "B"].contains(&channel.name.as_str()))
        .cloned()
        .collect();
    match all {
        _ if is_grey(&colours) => Ok(colours),
        [] => Err("is OpenEXR of deep data; save it flat".into()),
        [_] => Ok(all.to_vec()),
        all => Err(format!(
            "is OpenEXR without a channel of depth: it has {}; depth is called Z or depth, or is the only channel, and is no component of a vector",
            listed(all)
        )),
    }
}

/// Checks whether `channels` are the red, green and blue of one layer.
fn is_grey(channels: &[Channel]) -> bool {
    let mut names: Vec<String> = channels.iter().map(|channel| channel.words().1).collect();
    names.sort();
    names == ["b", "g", "r"] && channels.iter().all(|channel| channel.is_beside(&channels[0]))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Chooses among the channels with these names. A `:` ends the name of a part.
    fn choice(names: &[&str]) -> Said<Vec<String>> {
        let mut parts: Vec<&str> = Vec::new();
        let all: Vec<Channel> = (names.iter().enumerate())
            .map(|(index, name)| {
                let part = name.split_once(':').map_or("", |(part, _)| part);
                if !parts.contains(&part) {
                    parts.push(part);
                }
                Channel {
                    part: parts.iter().position(|other| *other == part).unwrap(),
                    index,
                    name: name.replace(':', "."),
                }
            })
            .collect();
        let chosen = chosen(&all)?;
        Ok(chosen.into_iter().map(|channel| channel.name).collect())
    }

    #[test]
    fn the_depth_channel_is_found_among_those_that_renderers_write() {
        for (names, want) in [
            // Blender, single and multilayer.
            (&["R", "G", "B", "A", "Z"][..], "Z"),
            (
                &[
                    "ViewLayer.Combined.R",
                    "ViewLayer.Depth.Z",
                    "ViewLayer.Mist.Z",
                    "ViewLayer.Denoising Depth.Z",
                ],
                "ViewLayer.Depth.Z",
            ),
            (
                &[
                    "ViewLayer.Depth.V",
                    "ViewLayer.Normal.X",
                    "ViewLayer.Normal.Y",
                    "ViewLayer.Normal.Z",
                ],
                "ViewLayer.Depth.V",
            ),
            // Mitsuba's `aov` integrator: "dd:depth, nn:sh_normal, pp:position".
            (&["dd.y", "nn.X", "nn.Y", "nn.Z", "pp.X", "pp.Y", "pp.Z"], "dd.y"),
            (&["dd.T", "dd.Y", "nn.X", "nn.Y", "nn.Z"], "dd.Y"),
            // V-Ray, Arnold, Unreal.
            (&["normals.X", "normals.Y", "normals.Z", "zDepth.Z"], "zDepth.Z"),
            (&["N.X", "N.Y", "N.Z", "P.X", "P.Y", "P.Z", "Z"], "Z"),
            (&["A", "N.Z", "depth"], "depth"),
            (&["R", "G", "B", "FinalImageWorldDepth.R"], "FinalImageWorldDepth.R"),
            // Parts.
            (&["normal:X", "normal:Y", "normal:Z", "depth:Z"], "depth.Z"),
            (&["colour:R", "colour:G", "colour:B", "colour:Z"], "colour.Z"),
            (&["whatever"], "whatever"),
            (&["Y"], "Y"),
        ] {
            assert_eq!(choice(names).unwrap(), [want], "{names:?}");
        }
        assert_eq!(choice(&["B", "G", "R"]).unwrap(), ["B", "G", "R"]);
        assert_eq!(
            choice(&["N.X", "N.Y", "N.Z", "depth.B", "depth.G", "depth.R"]).unwrap(),
            ["depth.B", "depth.G", "depth.R"]
        );
    }

    #[test]
    fn vectors_and_several_depths_are_refused_by_name() {
        for (names, words) in [
            (&["nn.X", "nn.Y", "nn.Z"][..], &["nn.Z", "vector"][..]),
            (&["X", "Y", "Z"], &["X, Y, Z", "vector"]),
            (&["N.Z", "A"], &["N.Z", "vector"]),
            (&["Y", "RY", "BY"], &["RY"]),
            (&["speed.X", "speed.Y"], &["speed.Y"]),
            (
                &["Back.Depth.Z", "Front.Depth.Z"],
                &["Back.Depth.Z, Front.Depth.Z", "several"],
            ),
            (&["left.Z", "right.Z"], &["left.Z, right.Z", "several"]),
            (&["left:Z", "right:Z"], &["left.Z, right.Z", "several"]),
            (&["Z", "depth"], &["Z, depth", "several"]),
            (&["U", "V"], &["U, V"]),
            (&[], &["deep"]),
        ] {
            let why = choice(names).unwrap_err();
            assert!(words.iter().all(|word| why.contains(word)), "{names:?}: {why}");
        }
    }
}
