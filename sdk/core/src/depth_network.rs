//! Depth from colour alone, by a network that the user supplies: an ONNX file, run by tract, that takes one picture and
//! returns one plane of relative inverse depth on any scale.

mod picture;

use crate::Size;
use crate::method::network::graph::{self, flat, not_run, one_line};
use crate::runtime::caught::caught;
use crate::runtime::error::{Error, Result};
use crate::runtime::file::{self, MOST_DEPTH_NETWORK};
use ndarray::Array2;
use picture::Picture;
use std::fmt::{Debug, Formatter};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use tract_onnx::prelude::*;

/// The scaling that a network expects for colour values from 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ColourScale {
    /// Normalized by the mean and the spread of ImageNet, as in the training of MiDaS, DPT and Depth Anything.
    #[default]
    Imagenet,
    /// From 0 to 1.
    Unit,
    /// From −1 to 1.
    Signed,
}

/// A network that estimates depth from a picture.
#[derive(Clone)]
pub struct DepthNetwork {
    /// The scaling of the colours that the network takes.
    pub colours: ColourScale,
    /// Whether the network gives distance rather than inverse depth.
    pub gives_distance: bool,
    model: Arc<InferenceModel>,
    /// The latest plan. A session that changes its quality level needs it again.
    planned: Arc<Mutex<Option<Planned>>>,
}

/// A network planned for pictures of the size `to`.
struct Planned {
    to: Size,
    plan: Arc<TypedRunnableModel>,
}

impl DepthNetwork {
    /// Reads the bytes of an ONNX file that holds its own weights. The network takes colours by
    /// [`ColourScale::Imagenet`] and gives inverse depth, unless the fields are set otherwise.
    ///
    /// # Errors
    /// Returns [`Error::Network`] if tract does not read the file, or if it has too many parts.
    pub fn from_onnx(file: &[u8]) -> Result<Self> {
        Ok(Self::of_model(graph::read(file, None)?))
    }

    /// Reads the ONNX file at `path`, whose weights may lie in other files of the same folder. See [`Self::from_onnx`].
    ///
    /// # Errors
    /// Returns [`Error::Network`] in the cases of [`Self::from_onnx`], and if a file cannot be read.
    pub fn open(path: &Path) -> Result<Self> {
        let bytes =
            file::read(path, MOST_DEPTH_NETWORK).map_err(|why| Error::Network(format!("cannot be read: {why}")))?;
        Ok(Self::of_model(graph::read(bytes, Some(path))?))
    }

    fn of_model(model: InferenceModel) -> Self {
        DepthNetwork {
            colours: ColourScale::default(),
            gives_distance: false,
            model: Arc::new(model),
            planned: Arc::default(),
        }
    }

    /// Plans the network for pictures of `size`, which are brought to the size that the network takes.
    ///
    /// # Errors
    /// Returns [`Error::Network`] if it is not a network for depth, or if it would take too much memory or time.
    #[doc(hidden)]
    pub fn estimator(&self, size: Size) -> Result<DepthEstimator> {
        let picture = flat(caught(|| Picture::of(&self.model, size, self.colours)))?;
        let mut planned = self.planned.lock().unwrap_or_else(PoisonError::into_inner);
        let plan = match &*planned {
            Some(Planned { to, plan }) if *to == picture.to() => plan.clone(),
            _ => {
                let model = (*self.model).clone();
                let plan = graph::plan(model, vec![picture.fact()], 1)?;
                *planned = Some(Planned {
                    to: picture.to(),
                    plan: plan.clone(),
                });
                plan
            }
        };
        Ok(DepthEstimator {
            picture,
            plan,
            sign: if self.gives_distance { -1.0 } else { 1.0 },
        })
    }
}

impl Debug for DepthNetwork {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("DepthNetwork")
            .field("colours", &self.colours)
            .field("gives_distance", &self.gives_distance)
            .finish_non_exhaustive()
    }
}

/// A [`DepthNetwork`] planned for pictures of one shape.
pub struct DepthEstimator {
    picture: Picture,
    plan: Arc<TypedRunnableModel>,
    /// −1 if the network gives distance.
    sign: f32,
}

impl DepthEstimator {
    /// Returns the relative inverse depth of `rgb`, (3, H, W) in 0..=1, as (h, w) in the network's own size and on its
    /// own scale, larger where the picture is nearer. Runs on one thread.
    ///
    /// # Errors
    /// Returns [`Error::Network`] if the network does not run on these colours, or if its output is not one plane.
    ///
    /// # Panics
    /// Panics if `rgb` does not have 3·H·W values.
    pub fn estimate(&self, rgb: &[f32]) -> Result<Array2<f32>> {
        let run = || -> TractResult<Tensor> {
            let results = self.plan.run(tvec!(self.picture.tensor(rgb)?.into()))?;
            Ok(results[0].clone().into_tensor())
        };
        let output = caught(|| run().map_err(|why| not_run(&why)).and_then(|output| plane(&output)));
        Ok(flat(output)? * self.sign)
    }
}

impl Debug for DepthEstimator {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("DepthEstimator")
            .field("picture", &self.picture)
            .finish_non_exhaustive()
    }
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
        return Err("gives numbers that are not finite; does it take colours of another scale?".into());
    }
    Array2::from_shape_vec((height, width), values.iter().copied().collect()).map_err(|why| why.to_string())
}
