//! Depth of any photo from a network that the user supplies. The network is an ONNX file, run by tract, that takes one
//! picture and returns one plane of relative inverse depth on any scale.
//!
//! The file's own input defines its number type, the axis of its three colours (NCHW or NHWC) and its size. If the size
//! is open, the picture nearly keeps its proportions: its shorter side is about [`DEFAULT_SIDE`], and both sides are
//! multiples of [`MULTIPLE`].

mod bounds;

use image::imageops::{self, FilterType};
use image::{Rgb, Rgb32FImage};
use ndarray::{Array2, ArrayView3};
use phasefront_io::input::{self, MOST_DEPTH_NETWORK, quiet};
use phasefront_io::{Error, Result, output};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tract_onnx::pb::ModelProto;
use tract_onnx::prelude::*;
use tract_onnx::tract_hir::infer::Factoid;
use tract_onnx::tract_hir::internal::DimLike;

/// The shorter side of a picture, in pixels, for a network that takes any size.
pub const DEFAULT_SIDE: usize = 448;
/// The number that divides both sides of a picture for a network that takes any size. It is a multiple of 14 and 32,
/// the patches and strides of common networks.
pub const MULTIPLE: usize = 224;
/// The largest number of pixels that a network may take.
const MOST_PIXELS: usize = 1 << 24;

/// The scaling that a network expects for colour values from 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Colours {
    /// Normalized by the mean and the spread of ImageNet, as in the training of MiDaS, DPT and Depth Anything.
    Imagenet,
    /// From 0 to 1.
    Unit,
    /// From −1 to 1.
    Signed,
}

impl Colours {
    fn number(self, colour: usize, value: f32) -> f32 {
        // The values for the ImageNet data set from torchvision.
        const MEAN: [f32; 3] = [0.485, 0.456, 0.406];
        const SPREAD: [f32; 3] = [0.229, 0.224, 0.225];
        match self {
            Colours::Imagenet => (value - MEAN[colour]) / SPREAD[colour],
            Colours::Unit => value,
            Colours::Signed => 2.0 * value - 1.0,
        }
    }
}

/// The input that the file defines.
struct Input {
    /// Whether colours are the last axis.
    interleaved: bool,
    bytes: bool,
    height: usize,
    width: usize,
}

impl Input {
    /// Reads the input of `model` for a picture of (H, W) = `picture`.
    fn read(model: &InferenceModel, picture: (usize, usize)) -> std::result::Result<Self, String> {
        let inputs = model.inputs.len();
        if inputs != 1 {
            return Err(format!("takes {inputs} inputs; a depth network takes one picture"));
        }
        let fact = model.input_fact(0).map_err(|why| one_line(&why))?;
        let sides: Vec<Option<usize>> = (fact.shape.dims())
            .map(|dim| dim.concretize().and_then(|dim| dim.to_usize().ok()))
            .collect();
        let [batch, a, b, c] = sides[..] else {
            return Err(format!(
                "takes {} axes; a depth network takes four: one picture, its colours, rows and columns",
                sides.len()
            ));
        };
        let (interleaved, [colours, rows, columns]) = match (a, c) {
            (Some(3), _) | (None, None) => (false, [a, b, c]),
            (_, Some(3)) => (true, [c, a, b]),
            _ => return Err("takes no three colours; a depth network takes (1, 3, H, W) or (1, H, W, 3)".into()),
        };
        if batch.is_some_and(|n| n != 1) || colours.is_some_and(|n| n != 3) {
            return Err("takes more than one picture at a time".into());
        }
        let [height, width] = open_sides(picture);
        let [height, width] = [rows.unwrap_or(height), columns.unwrap_or(width)];
        if height.saturating_mul(width) > MOST_PIXELS || height * width == 0 {
            return Err(format!(
                "takes pictures of {width}×{height}; {MOST_PIXELS} pixels are the most"
            ));
        }
        let kind = fact.datum_type.concretize();
        if kind.is_some_and(|kind| kind != DatumType::F32 && kind != DatumType::U8) {
            return Err(format!(
                "takes {}; a depth network takes 32-bit floating point or bytes",
                kind.map_or(String::new(), |kind| format!("{kind:?}"))
            ));
        }
        Ok(Input {
            interleaved,
            bytes: kind == Some(DatumType::U8),
            height,
            width,
        })
    }

    fn shape(&self) -> [usize; 4] {
        if self.interleaved {
            [1, self.height, self.width, 3]
        } else {
            [1, 3, self.height, self.width]
        }
    }

    fn tensor(&self, rgb: ArrayView3<'_, f32>, colours: Colours) -> TractResult<Tensor> {
        let (_, height, width) = rgb.dim();
        let picture = Rgb32FImage::from_fn(width as u32, height as u32, |x, y| {
            Rgb([0, 1, 2].map(|c| rgb[(c, y as usize, x as usize)]))
        });
        let sized = imageops::resize(&picture, self.width as u32, self.height as u32, FilterType::Triangle);
        let at = |[_, a, b, c]: [usize; 4]| {
            let (colour, y, x) = if self.interleaved { (c, a, b) } else { (a, b, c) };
            (colour, sized.get_pixel(x as u32, y as u32).0[colour])
        };
        let indices = |i: usize| {
            let [_, a, b, c] = self.shape();
            [0, i / (b * c) % a, i / c % b, i % c]
        };
        let count = self.shape().iter().product();
        if self.bytes {
            let byte = |i| (at(indices(i)).1 * 255.0).round() as u8;
            Tensor::from_shape(&self.shape(), &(0..count).map(byte).collect::<Vec<_>>())
        } else {
            let number = |i| {
                let (colour, value) = at(indices(i));
                colours.number(colour, value)
            };
            Tensor::from_shape(&self.shape(), &(0..count).map(number).collect::<Vec<_>>())
        }
    }

    fn fact(&self) -> InferenceFact {
        if self.bytes {
            u8::fact(self.shape()).into()
        } else {
            f32::fact(self.shape()).into()
        }
    }
}

/// Returns (H, W) for a network that takes any size.
fn open_sides((height, width): (usize, usize)) -> [usize; 2] {
    let scale = DEFAULT_SIDE as f64 / height.min(width) as f64;
    [height, width].map(|side| {
        let steps = (side as f64 * scale / MULTIPLE as f64).round() as usize;
        steps.clamp(1, 16) * MULTIPLE
    })
}

/// A network that estimates depth, ready for pictures of one shape.
pub struct DepthNetwork {
    path: PathBuf,
    input: Input,
    plan: Arc<TypedRunnableModel>,
}

impl DepthNetwork {
    /// Reads the ONNX file at `path` for pictures of (H, W) = `picture`.
    ///
    /// # Errors
    /// Returns an error if the file is not a depth network, or if it would take too much memory or time.
    pub fn open(path: &Path, picture: (usize, usize)) -> Result<Self> {
        output::reading(path)?;
        let refuse = |why: String| Error::file(path, why);
        if !path.exists() {
            return Err(refuse(
                "there is no such file; --depth-network takes an ONNX file".into(),
            ));
        }
        let file = input::bytes(path, MOST_DEPTH_NETWORK)?;
        // tract panics on files that it does not expect.
        let planned = quiet::caught(|| {
            let proto = bounds::messages(&file, path)?;
            plan(&proto, path, picture)
        });
        let (input, plan) = planned.map_err(panicked).and_then(|planned| planned).map_err(refuse)?;
        Ok(DepthNetwork {
            path: path.into(),
            input,
            plan,
        })
    }

    /// Estimates the relative inverse depth of `rgb`, (3, H, W) in 0..=1. The result is (h, w) in the network's own
    /// size and on its own scale, larger where the picture is nearer.
    ///
    /// # Errors
    /// Returns an error if the network does not run on these colours, or if its output is not one plane.
    pub fn see(&self, rgb: ArrayView3<'_, f32>, colours: Colours) -> Result<Array2<f32>> {
        let refuse = |why: String| Error::file(&self.path, why);
        let run = || -> TractResult<Tensor> {
            let results = self.plan.run(tvec!(self.input.tensor(rgb, colours)?.into()))?;
            Ok(results[0].clone().into_tensor())
        };
        let output = quiet::caught(run).map_err(|why| refuse(panicked(why)))?;
        plane(&output.map_err(|why| refuse(not_run(&why)))?).map_err(refuse)
    }
}

fn plan(
    proto: &ModelProto,
    path: &Path,
    picture: (usize, usize),
) -> std::result::Result<(Input, Arc<TypedRunnableModel>), String> {
    let folder = path.parent().and_then(Path::to_str).unwrap_or_default();
    let parsed = (tract_onnx::onnx().parse(proto, Some(folder)))
        .map_err(|why| format!("is no ONNX file that tract reads: {}", one_line(&why)))?;
    if let Some(name) = parsed.unresolved_inputs.first() {
        return Err(format!("reads {name}, which no node gives"));
    }
    let model = parsed.model;
    let input = Input::read(&model, picture)?;
    let plan = || -> TractResult<_> {
        let outlets = model.output_outlets()?;
        let outputs = outlets
            .get(..1)
            .ok_or_else(|| TractError::msg("it has no output"))?
            .to_vec();
        let mut model = (model.with_input_fact(0, input.fact())?).with_output_outlets(&outputs)?;
        bounds::analyse(&mut model)?;
        let model = model.into_typed()?;
        bounds::check_sizes(&model)?;
        let model = model.into_optimized()?;
        bounds::check_sizes(&model)?;
        model.into_runnable()
    };
    let plan = plan().map_err(|why| not_run(&why))?;
    Ok((input, plan))
}

fn not_run(why: &TractError) -> String {
    format!("tract does not run it: {}", one_line(why))
}

fn panicked(why: String) -> String {
    format!("tract does not run it: it fails with: {why}")
}

/// Returns the single plane of `output`, whose other axes must have length 1.
fn plane(output: &Tensor) -> std::result::Result<Array2<f32>, String> {
    let shape = output.shape();
    let sides: Vec<usize> = shape.iter().copied().filter(|n| *n != 1).collect();
    let [height, width] = sides[..] else {
        return Err(format!(
            "gives {shape:?}; a depth network gives one plane, (1, 1, H, W), (1, H, W) or (H, W)"
        ));
    };
    let values = output.cast_to::<f32>().map_err(|why| one_line(&why))?;
    let values = values.to_plain_array_view::<f32>().map_err(|why| one_line(&why))?;
    if values.iter().any(|v| !v.is_finite()) {
        return Err(
            "gives numbers that are not finite; does it take other colours? See --depth-network-colours".into(),
        );
    }
    Array2::from_shape_vec((height, width), values.iter().copied().collect()).map_err(|why| why.to_string())
}

fn one_line(why: &TractError) -> String {
    format!("{why:#}").split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn open_sides_keep_the_proportion_in_multiples() {
        assert_eq!(open_sides((480, 640)), [448, 672]);
        assert_eq!(open_sides((1080, 1920)), [448, 896]);
        assert_eq!(open_sides((10, 4000)), [448, 3584]);
    }

    #[test]
    fn colours_are_what_networks_were_trained_on() {
        assert_eq!(Colours::Signed.number(0, 0.0), -1.0);
        assert_eq!(Colours::Unit.number(1, 0.25), 0.25);
        assert!((Colours::Imagenet.number(2, 0.406)).abs() < 1e-6);
        assert!((Colours::Imagenet.number(0, 1.0) - 2.248_9).abs() < 1e-3);
    }
}
