//! One HTML file that shows holograms: a stack of views, the wanted field beside the displayed image, phases and
//! figures. It needs no server, no network and no other file.
//!
//! A page holds its [`Scene`]s as JSON with WebP pictures, so that pages can be read again and joined into one.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use image::{RgbImage, imageops};
use ndarray::{Array2, ArrayView3};
use phasefront_core::view::colours::ViewColours;
use phasefront_io::input::{self, MOST_ARRAY};
use phasefront_io::picture::{self, export};
use phasefront_io::{Error, Result, output};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::path::Path;

const PAGE: &str = include_str!("viewer/page.html");
const SCENES_FROM: &str = r#"<script type="application/json" id="scenes">"#;
const SCENES_TO: &str = "</script>";
const PLACE: &str = "__SCENES__";
/// The prefix of each picture in a page.
const PICTURE: &str = "data:image/webp;base64,";

/// The largest width of a view in a page.
const WIDEST: u32 = 1280;
/// The widths and WebP qualities to try, best first.
const SIZES: [(u32, f32); 9] = [
    (WIDEST, 85.0),
    (WIDEST, 75.0),
    (960, 80.0),
    (960, 65.0),
    (800, 60.0),
    (640, 60.0),
    (480, 55.0),
    (320, 50.0),
    (240, 40.0),
];
/// The bytes of base64 for 3 bytes.
const BASE64: usize = 4;
/// The width of the depth map for clicks, in pixels.
const DEPTH_WIDTH: usize = 240;
/// The width and height of the part of a modulator, in its middle, that a page shows pixel for pixel.
const WINDOW: (u32, u32) = (240, 160);
/// The width of the picture of all phases.
const PHASE_WIDTH: u32 = 720;

/// A hologram, or a video of holograms, on a page.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Scene {
    /// The scene's title.
    pub title: String,
    /// The modulator's width in pixels.
    pub width: usize,
    /// The modulator's height in pixels.
    pub height: usize,
    /// The distances at which the views of a frame are focused, nearest first.
    pub z_mm: Vec<f64>,
    /// The number of frames of a video; 1 for a still.
    pub frames: usize,
    /// All displayed views of each frame, as data URLs.
    pub shown: Vec<String>,
    /// The views of the wanted field in the same order, or none.
    pub field: Vec<String>,
    /// The modulator's phases in the first frame.
    pub phase: Option<Phase>,
    /// The map that tells where a click focuses.
    pub depth: Depth,
    /// The names and values of the scene's figures.
    pub figures: Vec<(String, String)>,
}

/// A modulator's phases as pictures.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Phase {
    /// All phases at a reduced size, as a data URL.
    pub all: String,
    /// The phases in `window` at full size, as a data URL.
    pub pixels: String,
    /// The left, top, width and height of the window in the modulator's pixels.
    pub window: [u32; 4],
}

/// A map from each place in an image to the view that is focused there.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Depth {
    /// The number of places in a row.
    pub width: usize,
    /// The number of rows per frame.
    pub height: usize,
    /// The index of the view at each place, row by row and frame by frame, as bytes in base64.
    pub slices: String,
    /// Whether the map comes from the image's depth and not from the sharpness of the views.
    pub known: bool,
}

impl Depth {
    /// Makes the map from normalized depth, (H, W). `slice_of` returns the index of the view that is focused at a
    /// depth.
    pub fn known(depth: &Array2<f32>, slice_of: impl Fn(f32) -> u8) -> Self {
        let (rows, columns) = depth.dim();
        let width = columns.min(DEPTH_WIDTH);
        let height = (rows * width).div_ceil(columns);
        let at = |i: usize, of: usize, most: usize| ((2 * i + 1) * most / (2 * of)).min(most - 1);
        let slices =
            (0..height * width).map(|i| slice_of(depth[(at(i / width, height, rows), at(i % width, width, columns))]));
        Depth {
            width,
            height,
            slices: STANDARD.encode(slices.collect::<Vec<u8>>()),
            known: true,
        }
    }

    /// Makes the map from the views in `frames`. At each place, it takes the sharpest view, in which colours differ
    /// most from their neighbours'.
    pub fn from_focus(frames: &[Vec<RgbImage>]) -> Self {
        let mut shape = (0, 0);
        let mut slices = Vec::new();
        for views in frames {
            let sharp: Vec<Array2<f32>> = views.par_iter().map(sharpness).collect();
            let Some(first) = sharp.first() else { continue };
            shape = first.dim();
            for place in ndarray::indices(shape) {
                let best = (0..sharp.len()).max_by(|a, b| sharp[*a][place].total_cmp(&sharp[*b][place]));
                slices.push(best.unwrap_or(0) as u8);
            }
        }
        Depth {
            width: shape.1,
            height: shape.0,
            slices: STANDARD.encode(slices),
            known: false,
        }
    }
}

/// Measures how much each place of a view differs from its neighbours, averaged over an area to suppress noise.
fn sharpness(view: &RgbImage) -> Array2<f32> {
    let small = export::at_width(view.clone(), DEPTH_WIDTH as u32);
    let (width, height) = (small.width() as usize, small.height() as usize);
    let value = |y: usize, x: usize, c: usize| f32::from(small.get_pixel(x as u32, y as u32).0[c]);
    let edges = image::ImageBuffer::<image::Luma<f32>, Vec<f32>>::from_fn(width as u32, height as u32, |x, y| {
        let (x, y) = (x as usize, y as usize);
        let (right, down) = ((x + 1).min(width - 1), (y + 1).min(height - 1));
        let square = |c| (value(y, right, c) - value(y, x, c)).powi(2) + (value(down, x, c) - value(y, x, c)).powi(2);
        image::Luma([(0..3).map(square).sum()])
    });
    let wide = imageops::blur(&edges, 3.0);
    Array2::from_shape_fn((height, width), |(y, x)| wide.get_pixel(x as u32, y as u32).0[0])
}

impl Phase {
    /// Makes the pictures of levels, (C, H, W).
    ///
    /// # Errors
    /// Returns an error if the modulator is too large for a picture.
    pub fn new(levels: ArrayView3<'_, u8>) -> Result<Self> {
        let (_, height, width) = levels.dim();
        let levels = picture::as_rgb(&levels);
        let all = RgbImage::from_fn(width as u32, height as u32, |x, y| {
            image::Rgb([0, 1, 2].map(|c| levels[(c, y as usize, x as usize)]))
        });
        let (w, h) = (WINDOW.0.min(width as u32), WINDOW.1.min(height as u32));
        let (left, top) = ((width as u32 - w) / 2, (height as u32 - h) / 2);
        let pixels = imageops::crop_imm(&all, left, top, w, h).to_image();
        Ok(Phase {
            all: url(&export::webp(&export::at_width(all, PHASE_WIDTH), 60.0)?),
            pixels: url(&export::webp_lossless(&pixels)),
            window: [left, top, w, h],
        })
    }
}

fn url(webp: &[u8]) -> String {
    format!("{PICTURE}{}", STANDARD.encode(webp))
}

/// Makes a picture of a view's amplitudes, (C, H, W), no wider than pages show it.
pub fn picture(view: ArrayView3<'_, f32>, colours: &ViewColours) -> RgbImage {
    export::at_width(export::of_view(view, colours), WIDEST)
}

/// Encodes `views` as data URLs that together have at most `most` bytes, at the best size and quality that fit.
///
/// # Errors
/// Returns an error if not even the smallest pictures fit.
pub fn pack(views: &[RgbImage], most: usize) -> Result<Vec<String>> {
    let Some(middle) = views.get(views.len() / 2) else {
        return Ok(Vec::new());
    };
    let bytes = |n: usize| n.div_ceil(3) * BASE64 + 32;
    for (width, quality) in SIZES {
        let one = |view: &RgbImage| export::webp(&export::at_width(view.clone(), width), quality);
        if bytes(one(middle)?.len()) * views.len() > most + most / 10 {
            continue;
        }
        let packed = views.par_iter().map(one).collect::<Result<Vec<_>>>()?;
        if packed.iter().map(|view| bytes(view.len())).sum::<usize>() <= most {
            return Ok(packed.iter().map(|view| url(view)).collect());
        }
    }
    Err(Error::Input(format!(
        "{} views do not fit into {:.1} MB; give fewer --views, fewer frames, or more --max-mb",
        views.len(),
        most as f64 / 1e6
    )))
}

/// Makes the page of `scenes`.
///
/// # Errors
/// Returns an error if there is no scene.
pub fn page(scenes: &[Scene]) -> Result<String> {
    if scenes.is_empty() {
        return Err(Error::Input("a page needs a hologram to show; there is none".into()));
    }
    // A title that contains `</script>` would end the data.
    let json = serde_json::to_string(scenes)
        .map_err(|e| Error::Input(format!("the page's data: {e}")))?
        .replace('<', "\\u003c");
    Ok(PAGE.replace(PLACE, &json))
}

/// Writes the [`page`] of `scenes` and returns its size in bytes.
///
/// # Errors
/// Returns the errors of [`page`], or an error if the file cannot be written.
pub fn write(path: &Path, scenes: &[Scene]) -> Result<usize> {
    let page = page(scenes)?;
    output::write_atomically(path, |file| file.write_all(page.as_bytes()))?;
    Ok(page.len())
}

/// Reads the scenes of a page that [`write()`] made. The page may have been changed since, so only its data is read,
/// and the data is checked.
///
/// # Errors
/// Returns an error if the file is missing, is another page or has no scenes, or if its scenes differ from what
/// [`write()`] makes, for example because pictures are elsewhere.
pub fn read(path: &Path) -> Result<Vec<Scene>> {
    let page = String::from_utf8(input::bytes(path, MOST_ARRAY)?)
        .map_err(|_| Error::file(path, "is no page that `phasefront view` made"))?;
    let json = page
        .split_once(SCENES_FROM)
        .and_then(|(_, rest)| Some(rest.split_once(SCENES_TO)?.0));
    let json = json.ok_or_else(|| Error::file(path, "is no page that `phasefront view` made"))?;
    let scenes: Vec<Scene> =
        serde_json::from_str(json).map_err(|e| Error::file(path, format!("its scenes are broken: {e}")))?;
    if scenes.is_empty() {
        return Err(Error::file(path, "holds no hologram"));
    }
    for scene in &scenes {
        scene
            .check()
            .map_err(|why| Error::file(path, format!("its scenes are broken: {why}")))?;
    }
    Ok(scenes)
}

/// Checks that `url` is a picture inside the page, as [`write()`] makes it, which no browser fetches from elsewhere.
fn check_picture(url: &str) -> std::result::Result<(), String> {
    let data = url.strip_prefix(PICTURE);
    if data.is_some_and(|data| STANDARD.decode(data).is_ok()) {
        Ok(())
    } else {
        let begin: String = url.chars().take(60).collect();
        Err(format!("{begin:?} is no picture in the page itself ({PICTURE}…)"))
    }
}

impl Scene {
    /// Checks the properties that a page's script relies on.
    fn check(&self) -> std::result::Result<(), String> {
        let views = self.z_mm.len().checked_mul(self.frames).filter(|views| *views > 0);
        if views != Some(self.shown.len()) || !(self.field.is_empty() || self.field.len() == self.shown.len()) {
            return Err(format!(
                "{} views and {} of the field for {} frames at {} depths",
                self.shown.len(),
                self.field.len(),
                self.frames,
                self.z_mm.len()
            ));
        }
        let phase = self.phase.iter().flat_map(|phase| [&phase.all, &phase.pixels]);
        self.shown
            .iter()
            .chain(&self.field)
            .chain(phase)
            .try_for_each(|url| check_picture(url))?;
        let Depth {
            width, height, slices, ..
        } = &self.depth;
        let slices = STANDARD.decode(slices).map_err(|e| format!("its depth: {e}"))?;
        let places = width
            .checked_mul(*height)
            .and_then(|area| area.checked_mul(self.frames));
        let inside = slices.iter().all(|slice| usize::from(*slice) < self.z_mm.len());
        if places == Some(slices.len()) && inside {
            Ok(())
        } else {
            Err(format!("its depth has {} places of {width}×{height}", slices.len()))
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use phasefront::Size;

    fn noise(size: Size) -> RgbImage {
        RgbImage::from_fn(size.width as u32, size.height as u32, |x, y| {
            let n = (x * 7919 + y * 104_729) ^ (x * y * 31);
            image::Rgb([n as u8, (n >> 3) as u8, (n >> 7) as u8])
        })
    }

    fn scene(title: &str) -> Scene {
        Scene {
            title: title.into(),
            width: 4,
            height: 3,
            z_mm: vec![1.0, -1.0],
            frames: 1,
            shown: pack(
                &[noise(Size { width: 4, height: 3 }), noise(Size { width: 4, height: 3 })],
                10_000,
            )
            .unwrap(),
            field: Vec::new(),
            phase: None,
            depth: Depth::known(&Array2::zeros((3, 4)), |_| 1),
            figures: vec![("a".into(), "b".into())],
        }
    }

    #[test]
    fn a_page_is_read_again_and_keeps_any_title() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("v.html");
        let bytes = write(&path, &[scene("one</script><b>"), scene("two")]).unwrap();
        assert_eq!(bytes, std::fs::read(&path).unwrap().len());
        let titles: Vec<_> = read(&path).unwrap().into_iter().map(|scene| scene.title).collect();
        assert_eq!(titles, ["one</script><b>", "two"]);
        std::fs::write(&path, "<html>").unwrap();
        assert!(read(&path).unwrap_err().to_string().contains("no page"));
    }

    #[test]
    fn pictures_keep_their_budget() {
        let views = [
            noise(Size {
                width: 600,
                height: 400,
            }),
            noise(Size {
                width: 600,
                height: 400,
            }),
        ];
        let large = pack(&views, 3_000_000).unwrap();
        let small = pack(&views, 60_000).unwrap();
        let size = |urls: &[String]| urls.iter().map(String::len).sum::<usize>();
        assert!(size(&small) <= 60_000 && size(&small) < size(&large));
        assert!(pack(&views, 1000).unwrap_err().to_string().contains("--max-mb"));
    }

    #[test]
    fn a_place_is_focused_where_its_depth_is_or_where_it_is_sharpest() {
        let depth = Array2::from_shape_fn((20, 480), |(_, x)| if x < 240 { 0.0 } else { 1.0 });
        let known = Depth::known(&depth, |d| (d * 9.0) as u8);
        let slices = STANDARD.decode(&known.slices).unwrap();
        assert_eq!((known.width, known.height), (240, 10));
        assert_eq!((slices[0], slices[239]), (0, 9));
        // One view is sharp on the left, the other on the right.
        let grey = |sharp: std::ops::Range<u32>| {
            RgbImage::from_fn(80, 40, |x, y| {
                if sharp.contains(&x) && (x + y) % 2 == 0 {
                    image::Rgb([255; 3])
                } else {
                    image::Rgb([100; 3])
                }
            })
        };
        let found = Depth::from_focus(&[vec![grey(0..40), grey(40..80)]]);
        let slices = STANDARD.decode(&found.slices).unwrap();
        assert_eq!((found.width, found.height, found.known), (80, 40, false));
        assert_eq!((slices[20 * 80 + 10], slices[20 * 80 + 70]), (0, 1));
    }
}
