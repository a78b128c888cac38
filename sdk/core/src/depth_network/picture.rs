//! The picture that a depth network takes. The file's own input defines its number type, the axis of its three colours
//! (NCHW or NHWC) and its size. If the size is open, the picture nearly keeps its proportions: its shorter side is
//! about [`DEFAULT_SIDE`], and both sides are multiples of [`MULTIPLE`].

use super::{ColourScale, one_line};
use crate::Size;
use crate::frame::Axis;
use tract_onnx::prelude::*;
use tract_onnx::tract_hir::infer::Factoid;
use tract_onnx::tract_hir::internal::DimLike;

/// The shorter side of a picture, in pixels, for a network that takes any size.
const DEFAULT_SIDE: usize = 448;
/// The number that divides both sides of a picture for a network that takes any size. It is a multiple of 14 and 32,
/// the patches and strides of common networks.
const MULTIPLE: usize = 224;
/// The largest number of pixels that a network may take.
const MOST_PIXELS: usize = 1 << 24;

impl ColourScale {
    fn number(self, colour: usize, value: f32) -> f32 {
        // The values for the ImageNet data set from torchvision.
        const MEAN: [f32; 3] = [0.485, 0.456, 0.406];
        const SPREAD: [f32; 3] = [0.229, 0.224, 0.225];
        match self {
            ColourScale::Imagenet => (value - MEAN[colour]) / SPREAD[colour],
            ColourScale::Unit => value,
            ColourScale::Signed => 2.0 * value - 1.0,
        }
    }
}

/// The conversion of a picture to what a network takes.
pub(super) struct Picture {
    colours: ColourScale,
    /// The size of the picture.
    from: Size,
    /// The size of the network's input.
    to: Size,
    rows: Axis,
    columns: Axis,
    /// Whether colours are the last axis.
    interleaved: bool,
    bytes: bool,
}

impl Picture {
    /// Reads the input of `model` for a picture of the size `from`.
    pub(super) fn of(model: &InferenceModel, from: Size, colours: ColourScale) -> std::result::Result<Self, String> {
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
        let (interleaved, [channels, rows, columns]) = match (a, c) {
            (Some(3), _) | (None, None) => (false, [a, b, c]),
            (_, Some(3)) => (true, [c, a, b]),
            _ => return Err("takes no three colours; a depth network takes (1, 3, H, W) or (1, H, W, 3)".into()),
        };
        if batch.is_some_and(|n| n != 1) || channels.is_some_and(|n| n != 3) {
            return Err("takes more than one picture at a time".into());
        }
        let open = open_size(from);
        let (height, width) = (rows.unwrap_or(open.height), columns.unwrap_or(open.width));
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
        Ok(Picture {
            colours,
            from,
            to: Size { width, height },
            rows: Axis::new(from.height, 0.0, from.height as f64, height),
            columns: Axis::new(from.width, 0.0, from.width as f64, width),
            interleaved,
            bytes: kind == Some(DatumType::U8),
        })
    }

    /// Returns the size that the network takes.
    pub(super) fn to(&self) -> Size {
        self.to
    }

    fn shape(&self) -> [usize; 4] {
        let Size { width, height } = self.to;
        if self.interleaved {
            [1, height, width, 3]
        } else {
            [1, 3, height, width]
        }
    }

    pub(super) fn fact(&self) -> InferenceFact {
        if self.bytes {
            u8::fact(self.shape()).into()
        } else {
            f32::fact(self.shape()).into()
        }
    }

    /// Converts `rgb`, (3, H, W) in 0..=1, to the network's size, numbers and order.
    pub(super) fn tensor(&self, rgb: &[f32]) -> TractResult<Tensor> {
        let Size { width, height } = self.to;
        assert_eq!(rgb.len(), 3 * self.from.pixels());
        let mut values = vec![0.0; 3 * height * width];
        let (step, apart) = if self.interleaved { (3, 1) } else { (1, height * width) };
        let (mut sum, mut row) = (vec![0.0; self.from.width], vec![0.0; width]);
        let needed = self.columns.needed();
        for (colour, plane) in rgb.chunks_exact(self.from.pixels()).enumerate() {
            for y in 0..height {
                sum.fill(0.0);
                for (source, weight) in self.rows.taps(y) {
                    let source = &plane[source * self.from.width..][..self.from.width];
                    sum.iter_mut().zip(source).for_each(|(sum, v)| *sum += weight * v);
                }
                self.columns.apply(&sum[needed.clone()], needed.start, &mut row);
                let to = values[colour * apart + y * width * step..].iter_mut().step_by(step);
                to.zip(&row).for_each(|(to, v)| *to = self.number(colour, *v));
            }
        }
        if self.bytes {
            let bytes: Vec<u8> = values.iter().map(|v| *v as u8).collect();
            Tensor::from_shape(&self.shape(), &bytes)
        } else {
            Tensor::from_shape(&self.shape(), &values)
        }
    }

    fn number(&self, colour: usize, value: f32) -> f32 {
        if self.bytes {
            (value * 255.0).round()
        } else {
            self.colours.number(colour, value)
        }
    }
}

impl std::fmt::Debug for Picture {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:?} for {}, {:?}", self.shape(), self.from, self.colours)
    }
}

/// Returns the size for a network that takes any size.
fn open_size(Size { width, height }: Size) -> Size {
    let scale = DEFAULT_SIDE as f64 / height.min(width) as f64;
    let side = |side: usize| {
        let steps = (side as f64 * scale / MULTIPLE as f64).round() as usize;
        steps.clamp(1, 16) * MULTIPLE
    };
    Size {
        width: side(width),
        height: side(height),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn open_sizes_keep_the_proportion_in_multiples() {
        assert_eq!(
            open_size(Size {
                width: 640,
                height: 480
            }),
            Size {
                width: 672,
                height: 448
            }
        );
        assert_eq!(
            open_size(Size {
                width: 1920,
                height: 1080
            }),
            Size {
                width: 896,
                height: 448
            }
        );
        assert_eq!(
            open_size(Size {
                width: 4000,
                height: 10
            }),
            Size {
                width: 3584,
                height: 448
            }
        );
    }

    #[test]
    fn colours_are_what_networks_were_trained_on() {
        assert_eq!(ColourScale::Signed.number(0, 0.0), -1.0);
        assert_eq!(ColourScale::Unit.number(1, 0.25), 0.25);
        assert!((ColourScale::Imagenet.number(2, 0.406)).abs() < 1e-6);
        assert!((ColourScale::Imagenet.number(0, 1.0) - 2.248_9).abs() < 1e-3);
    }

    /// The order and the numbers of a picture that is not resized, pixel by pixel.
    #[test]
    fn a_picture_of_the_networks_size_is_only_reordered() {
        let (height, width) = (3, 5);
        let rgb: Vec<f32> = (0..3 * height * width).map(|i| i as f32 / 64.0).collect();
        for (interleaved, bytes) in [(false, false), (true, false), (false, true), (true, true)] {
            let picture = Picture {
                colours: ColourScale::Signed,
                from: Size { width, height },
                to: Size { width, height },
                rows: Axis::new(height, 0.0, height as f64, height),
                columns: Axis::new(width, 0.0, width as f64, width),
                interleaved,
                bytes,
            };
            let tensor = picture
                .tensor(&rgb)
                .expect("a tensor")
                .cast_to::<f32>()
                .expect("numbers")
                .into_owned();
            let values = tensor.to_plain_array_view::<f32>().expect("an array");
            for (i, value) in rgb.iter().enumerate() {
                let (colour, y, x) = (i / (height * width), i / width % height, i % width);
                let index = if interleaved {
                    [0, y, x, colour]
                } else {
                    [0, colour, y, x]
                };
                let expected = if bytes {
                    (value * 255.0).round()
                } else {
                    2.0 * value - 1.0
                };
                assert_eq!(values[index], expected);
            }
        }
    }
}
