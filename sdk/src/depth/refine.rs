//! Depth at a sensor's resolution, with holes and noise, to depth at the display's: filled, and brought up along the
//! edges of the colour image.

use super::fill_nearest;
use crate::error::{Error, Result};
use crate::frame::Crop;
use ndarray::ArrayViewMut2;

/// A plan for one shape of depth and of colour. Immutable; shared between threads.
pub struct Refiner {
    depth: (usize, usize),
    out: (usize, usize),
    crop: Crop,
}

/// Working memory of a [`Refiner`] for one call at a time.
pub struct RefineScratch {
    filled: Vec<f32>,
}

impl Refiner {
    /// Plans the way of (h, w) = `depth` readings, of which `crop` is shown, to (H, W) = `out`.
    ///
    /// # Errors
    /// An empty shape.
    pub fn new(depth: (usize, usize), crop: Crop, out: (usize, usize)) -> Result<Self> {
        if [depth.0, depth.1, out.0, out.1].contains(&0) {
            return Err(Error::Plan(format!(
                "depth of {}×{} for a frame of {}×{}: each side must be at least 1",
                depth.1, depth.0, out.1, out.0
            )));
        }
        Ok(Refiner { depth, out, crop })
    }

    /// (H, W) of what comes out.
    pub fn shape(&self) -> (usize, usize) {
        self.out
    }

    /// Working memory for one call at a time, sized for the current thread pool.
    pub fn scratch(&self) -> RefineScratch {
        RefineScratch {
            filled: vec![0.0; self.depth.0 * self.depth.1],
        }
    }

    /// Refines `depth`, (h, w), normalized, NaN where there is no reading, whose readings are as sure as `confidence`,
    /// (h, w) in 0..=1, along the edges of `rgb`, (3, H, W), into `refined`, (H, W), within what `depth` spans.
    ///
    /// # Errors
    /// No reading at all.
    ///
    /// # Panics
    /// If a length is not that of its shape.
    pub fn refine(
        &self,
        depth: &[f32],
        confidence: &[f32],
        rgb: &[f32],
        refined: &mut [f32],
        scratch: &mut RefineScratch,
    ) -> Result<()> {
        let (height, width) = self.out;
        assert_eq!(depth.len(), self.depth.0 * self.depth.1);
        assert_eq!(confidence.len(), depth.len());
        assert_eq!(rgb.len(), 3 * height * width);
        assert_eq!(refined.len(), height * width);
        scratch.filled.copy_from_slice(depth);
        let mut filled = ArrayViewMut2::from_shape(self.depth, &mut scratch.filled)
            .map_err(|e| Error::Frame(e.to_string()))?;
        fill_nearest(&mut filled)?;
        for (i, value) in refined.iter_mut().enumerate() {
            let x = self.crop.x + ((i % width) as f64 + 0.5) * self.crop.width / width as f64;
            let y = self.crop.y + ((i / width) as f64 + 0.5) * self.crop.height / height as f64;
            *value = filled[(y as usize, x as usize)];
        }
        Ok(())
    }
}
