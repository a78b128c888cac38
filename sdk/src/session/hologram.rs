//! A session's result: a handle whose planes are read in place and whose memory goes back to the session.

use super::computing::{self, Computing};
use super::live::lock;
use super::process_id::ProcessId;
use super::threads::Threads;
use num_complex::Complex32;
use phasefront_core::display::target::Target;
use phasefront_core::output::Levels;
use phasefront_core::pipeline::FrameTimes;
use phasefront_core::runtime::error::{Error, Result};
use phasefront_core::runtime::stage::stage;
use phasefront_core::view::preview::{Preview, PreviewScratch, check_screen};
use phasefront_core::view::refocus::seen_field;
use std::sync::{Arc, Mutex, Weak};

/// Buffers that a session keeps for the results to come; what is over goes back to the system.
const KEPT: usize = 4;

/// Memory that results give back.
#[derive(Debug)]
pub(super) struct Pool<T>(Arc<Mutex<Vec<Vec<T>>>>);

impl<T> Default for Pool<T> {
    fn default() -> Self {
        Pool(Arc::default())
    }
}

impl<T: Copy + Default> Pool<T> {
    /// A buffer of `len` values of any content.
    pub(super) fn take(&self, len: usize) -> Pooled<T> {
        let mut kept = lock(&self.0);
        // Buffers of another quality level's size are of no use any more.
        kept.retain(|buffer| buffer.len() == len);
        let values = kept.pop().unwrap_or_else(|| vec![T::default(); len]);
        Pooled {
            values,
            pool: Arc::downgrade(&self.0),
        }
    }
}

/// A buffer that goes back to its pool.
#[derive(Debug)]
pub(super) struct Pooled<T> {
    pub(super) values: Vec<T>,
    pool: Weak<Mutex<Vec<Vec<T>>>>,
}

impl<T> Drop for Pooled<T> {
    fn drop(&mut self) {
        if let Some(pool) = self.pool.upgrade() {
            let mut kept = lock(&pool);
            if kept.len() < KEPT {
                kept.push(std::mem::take(&mut self.values));
            }
        }
    }
}

/// What looking at results needs; shared by all of a session's.
pub(super) struct Viewer {
    process: ProcessId,
    target: Target,
    /// The session's threads, so that views are computed on no others.
    pool: Arc<Threads>,
    plan: Mutex<Option<ViewPlan>>,
}

struct ViewPlan {
    shape: (usize, usize),
    z_m: f64,
    preview: Preview,
    scratch: PreviewScratch,
}

impl Viewer {
    pub(super) fn new(target: Target, pool: Arc<Threads>) -> Self {
        Viewer {
            process: ProcessId::current(),
            target,
            pool,
            plan: Mutex::new(None),
        }
    }
}

/// The hologram of one frame: modulator levels and what is known of them. Cheap to keep and to send to another thread;
/// its memory goes back to the session when it is dropped, also after the session's end.
pub struct Hologram {
    pub(super) timestamp_ns: u64,
    pub(super) shape: (usize, usize),
    pub(super) levels: Pooled<u8>,
    /// Where the display has over 8 bits.
    pub(super) words: Option<Pooled<u16>>,
    /// d·65535.
    pub(super) depth: Pooled<u16>,
    pub(super) scale: f32,
    pub(super) times: FrameTimes,
    pub(super) range_m: Option<(f32, f32)>,
    pub(super) valid_depth: f32,
    pub(super) quality_level: usize,
    pub(super) viewer: Arc<Viewer>,
}

impl std::fmt::Debug for Hologram {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Hologram")
            .field("timestamp_ns", &self.timestamp_ns)
            .field("shape", &self.shape)
            .field("scale", &self.scale)
            .field("quality_level", &self.quality_level)
            .finish_non_exhaustive()
    }
}

impl Hologram {
    /// The frame's timestamp.
    pub fn timestamp_ns(&self) -> u64 {
        self.timestamp_ns
    }

    /// (H, W).
    pub fn shape(&self) -> (usize, usize) {
        self.shape
    }

    /// How many colours its levels have, C.
    pub fn colours(&self) -> usize {
        self.viewer.target.display.colours()
    }

    /// The modulator levels, (C, H, W): red, green, blue, or those of the one laser; of a display of over 8 bits the
    /// upper 8.
    pub fn levels(&self) -> &[u8] {
        &self.levels.values
    }

    /// The levels of a display of over 8 bits, (C, H, W), whose upper 8 bits [`Self::levels`] has; None for others.
    pub fn words(&self) -> Option<&[u16]> {
        self.words.as_ref().map(|words| &words.values[..])
    }

    /// The levels as [`phasefront_core::output::Output`] takes them.
    pub fn output_levels(&self) -> Levels<'_> {
        match self.words() {
            Some(words) => Levels::Words(words),
            None => Levels::Bytes(self.levels()),
        }
    }

    /// The levels of one colour, (H, W): 0 red, 1 green, 2 blue, or 0 of one laser.
    ///
    /// # Errors
    /// Another colour.
    pub fn plane(&self, colour: usize) -> Result<&[u8]> {
        let size = self.shape.0 * self.shape.1;
        self.levels()
            .chunks_exact(size)
            .nth(colour)
            .ok_or_else(|| match self.colours() {
                1 => Error::Setting(format!("there is no plane {colour}; one laser has plane 0 alone")),
                _ => Error::Setting(format!("there is no plane {colour}; 0 is red, 1 green, 2 blue")),
            })
    }

    /// The amplitude that full light stands for.
    pub fn scale(&self) -> f32 {
        self.scale
    }

    /// How long each stage took.
    pub fn times(&self) -> FrameTimes {
        self.times
    }

    /// Metres at the near and the far end of the volume; None for normalized depth.
    pub fn range_m(&self) -> Option<(f32, f32)> {
        self.range_m
    }

    /// The share of the depth sensor's pixels that had a usable reading.
    pub fn valid_depth(&self) -> f32 {
        self.valid_depth
    }

    /// The quality level that it was made at, 0 the best.
    pub fn quality_level(&self) -> usize {
        self.quality_level
    }

    /// What it is for.
    pub fn target(&self) -> &Target {
        &self.viewer.target
    }

    /// z of what is seen at (`x`, `y`) of the picture, each 0 to 1 from its upper left corner, metres: where to focus
    /// when it is tapped on. What lies beyond an edge is the edge.
    pub fn z_at(&self, x: f64, y: f64) -> f64 {
        let (height, width) = self.shape;
        let at = |share: f64, n: usize| ((share.clamp(0.0, 1.0) * n as f64) as usize).min(n - 1);
        let d = self.depth.values[at(y, height) * width + at(x, width)];
        self.viewer.target.display.z_of_depth(f64::from(d) / 65535.0)
    }

    /// Bytes of the image that [`Self::preview`] fills.
    ///
    /// # Errors
    /// A preview over 2²⁶ pixels, or over 2¹⁴ a side.
    pub fn preview_bytes(height: usize, width: usize) -> Result<usize> {
        check_screen((height, width))?;
        Ok(4 * height * width)
    }

    /// What an eye focused at `z_m` sees, as (`height`, `width`) rows of red, green, blue, alpha 255 into `rgba`. The
    /// plan is kept for the next call, of this or another result of the session, with the same z and size.
    ///
    /// # Errors
    /// An empty image or one over 2²⁶ pixels or 2¹⁴ a side, a length of `rgba` other than 4·height·width, a z too far
    /// away, a process that was forked from the session's, or a call by a handler of logs while a session computes.
    pub fn preview(&self, z_m: f64, height: usize, width: usize, rgba: &mut [u8]) -> Result<()> {
        if rgba.len() != Self::preview_bytes(height, width)? {
            return Err(Error::Setting(format!(
                "a preview of {width}×{height} needs 4 bytes a pixel; the image has {}",
                rgba.len()
            )));
        }
        self.viewer.process.check()?;
        computing::check()?;
        let _computing = Computing::begin();
        // Locked before the pool is entered, whose threads may else take up another view while this one waits.
        let mut plan = lock(&self.viewer.plan);
        let fits = |plan: &&mut ViewPlan| {
            plan.shape == self.shape && plan.z_m == z_m && plan.preview.screen() == (height, width)
        };
        if plan.as_mut().filter(fits).is_none() {
            let target = &self.viewer.target;
            *plan = Some(self.viewer.pool.install(|| -> Result<_> {
                let preview = Preview::new(self.shape, target, z_m, (height, width))?;
                Ok(ViewPlan {
                    shape: self.shape,
                    z_m,
                    scratch: preview.scratch(),
                    preview,
                })
            })?);
        }
        if let Some(ViewPlan { preview, scratch, .. }) = &mut *plan {
            let look = || {
                let _stage = stage!("preview");
                preview.look(self.levels(), self.scale, rgba, scratch);
            };
            self.viewer.pool.install(look);
        }
        Ok(())
    }

    /// The field that the levels make behind the aperture, through the optics, at `z_m`, (C, H, W): 0 is the midpoint.
    /// Without the carrier exp(i2πz/λ). Six transforms of padded planes: a view for study, not for every frame.
    ///
    /// # Errors
    /// A z too far away, whose padded plane would have over 2²⁷ values, or a process that was forked from the
    /// session's.
    pub fn field(&self, z_m: f64) -> Result<Vec<Complex32>> {
        self.viewer.process.check()?;
        let seen = || seen_field(self.output_levels(), self.scale, self.target(), self.shape, z_m);
        self.viewer.pool.install(seen)
    }

    /// What an eye focused at `z_m` sees, at full resolution, as amplitudes (C, H, W) of which 1 is white:
    /// [`Self::field`] without its phases.
    ///
    /// # Errors
    /// As [`Self::field`].
    pub fn refocus(&self, z_m: f64) -> Result<Vec<f32>> {
        let amplitudes = |field: Vec<Complex32>| field.iter().map(|value| value.norm()).collect();
        self.field(z_m).map(amplitudes)
    }
}
