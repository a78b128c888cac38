//! The result of a session: a hologram whose planes are read in place and whose memory returns to the session.

use super::computing::{self, Computing};
use super::guarded::lock;
use super::process_id::ProcessId;
use super::threads::Threads;
use num_complex::Complex32;
use phasefront_core::Size;
use phasefront_core::display::levels::{Levels, LevelsMut, upper_bytes};
use phasefront_core::display::target::Target;
use phasefront_core::encode::EncoderOptions;
use phasefront_core::frame::RgbEncoding;
use phasefront_core::output::Layout;
use phasefront_core::pipeline::display_plan::DisplayPlan;
use phasefront_core::pipeline::{FrameTimes, field};
use phasefront_core::runtime::error::{Error, Result};
use phasefront_core::runtime::stage::stage;
use phasefront_core::view::colours::ViewColours;
use phasefront_core::view::preview::{Preview, PreviewScratch};
use phasefront_core::view::refocus::seen_field;
#[cfg(feature = "gpu")]
use phasefront_gpu::{GpuError, GpuLevels, GpuView};
use std::sync::{Arc, Mutex, Weak};

/// The number of buffers that a session keeps for future results. Further buffers are freed.
const KEPT: usize = 4;

/// A pool for the buffers of dropped results.
#[derive(Debug)]
pub(super) struct Pool<T>(Arc<Mutex<Vec<Vec<T>>>>);

impl<T> Default for Pool<T> {
    fn default() -> Self {
        Pool(Arc::default())
    }
}

impl<T: Copy + Default> Pool<T> {
    /// Returns a buffer of `len` values with arbitrary content.
    pub(super) fn take(&self, len: usize) -> Pooled<T> {
        let mut kept = lock(&self.0);
        // Buffers sized for another quality level are no longer needed.
        kept.retain(|buffer| buffer.len() == len);
        let values = kept.pop().unwrap_or_else(|| vec![T::default(); len]);
        Pooled {
            values,
            pool: Arc::downgrade(&self.0),
        }
    }
}

/// A buffer that returns to its pool when it is dropped.
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

/// The state for computing views, shared by all results of a session.
pub(super) struct Viewer {
    process: ProcessId,
    target: Target,
    /// The session's threads, on which views are computed.
    pool: Arc<Threads>,
    plan: Mutex<Option<ViewPlan>>,
    #[cfg(feature = "gpu")]
    gpu_plan: Mutex<Option<GpuView>>,
}

struct ViewPlan {
    size: Size,
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
            #[cfg(feature = "gpu")]
            gpu_plan: Mutex::new(None),
        }
    }
}

/// The hologram of one frame: modulator levels and their metadata. It is cheap to keep and to send to another thread.
/// Its memory returns to the session when it is dropped, even after the session's end.
pub struct Hologram {
    pub(super) timestamp_ns: Option<u64>,
    pub(super) size: Size,
    pub(super) levels: Pooled<u8>,
    /// The levels of a display with more than 8 bits.
    pub(super) words: Option<Pooled<u16>>,
    /// Normalized depth as d·65535. Empty if the hologram was made of a field, whose depth is not known.
    pub(super) depth: Pooled<u16>,
    /// The size of `depth`, which covers the hologram at any resolution.
    pub(super) depth_size: Size,
    pub(super) scale: f32,
    pub(super) times: FrameTimes,
    pub(super) range_m: Option<(f32, f32)>,
    pub(super) valid_depth: Option<f32>,
    pub(super) quality_level: usize,
    /// The encoding of the picture's colours, in which views show them.
    pub(super) encoding: RgbEncoding,
    pub(super) viewer: Arc<Viewer>,
    /// The levels, if they stayed on the GPU. `levels` is then arbitrary.
    #[cfg(feature = "gpu")]
    pub(super) on_gpu: Option<Box<GpuLevels>>,
}

impl std::fmt::Debug for Hologram {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Hologram")
            .field("timestamp_ns", &self.timestamp_ns)
            .field("shape", &self.size)
            .field("scale", &self.scale)
            .field("quality_level", &self.quality_level)
            .finish_non_exhaustive()
    }
}

impl Hologram {
    /// Makes the hologram of a complex field that comes from elsewhere: `field`, (C, H, W), of `size` at
    /// `z_m`, where z = 0 is the middle of the volume. C is the number of the target's lasers. The field propagates to
    /// the modulator, and is corrected and encoded for it. A smoothed brightness is that of the field alone.
    ///
    /// ```
    /// use phasefront::num_complex::Complex32;
    /// use phasefront::{Display, EncoderOptions, Hologram, Size, Target};
    ///
    /// let size = Size { width: 64, height: 48 };
    /// let target = Target::from(Display::from_toml("width = 64\nheight = 48\nwavelengths_nm = [532]")?);
    /// let field: Vec<_> = (0..48 * 64).map(|i| Complex32::from_polar(0.5, 0.01 * i as f32)).collect();
    /// let hologram = Hologram::of_field(&field, size, 0.0, &target, &EncoderOptions::default())?;
    /// assert_eq!(hologram.levels().len(), 48 * 64);
    /// # Ok::<(), phasefront::Error>(())
    /// ```
    ///
    /// # Errors
    /// Returns an error if the field has another number of values, is larger than the modulator, is dark, or has values
    /// that are NaN or infinite; and if z is too far away or an option is out of its range.
    pub fn of_field(
        field: &[Complex32],
        size: Size,
        z_m: f64,
        target: &Target,
        options: &EncoderOptions,
    ) -> Result<Self> {
        computing::check()?;
        let pool = Threads::shared()?;
        let _computing = Computing::begin();
        pool.install(|| {
            field::check(field, size, target)?;
            let plan = DisplayPlan::from_z(size, z_m, target, options)?;
            let (mut scratch, mut field) = (plan.scratch(), field.to_vec());
            let mut levels = Pool::default().take(field.len());
            let stage = stage!("propagate");
            plan.propagate(&mut field, &mut scratch);
            let propagate = stage.end();
            let mut words = (target.display.bits() > 8).then(|| Pool::default().take(field.len()));
            let modulation = match &mut words {
                None => plan.modulate(None, &mut field, LevelsMut::Bytes(&mut levels.values), &mut scratch),
                Some(words) => plan.modulate(None, &mut field, LevelsMut::Words(&mut words.values), &mut scratch),
            };
            if let Some(words) = &words {
                upper_bytes(&words.values, target.display.bits(), &mut levels.values);
            }
            Ok(Hologram {
                timestamp_ns: None,
                size,
                levels,
                words,
                depth: Pool::default().take(0),
                depth_size: Size { width: 0, height: 0 },
                scale: modulation.scale,
                times: FrameTimes {
                    propagate,
                    encode: modulation.encode,
                    ..FrameTimes::default()
                },
                range_m: None,
                valid_depth: None,
                quality_level: 0,
                encoding: RgbEncoding::default(),
                viewer: Arc::new(Viewer::new(target.clone(), pool.clone())),
                #[cfg(feature = "gpu")]
                on_gpu: None,
            })
        })
    }

    /// Returns the hologram whose levels, (C, H, W) for the height H and the width W of `size`, are
    /// known, for example from a file. `scale`
    /// is the amplitude that full light represents. C is the number of the target's lasers. Its depth is not known.
    ///
    /// # Errors
    /// Returns an error if the target is invalid or has more than 8 bits, if there is another number of levels or the
    /// size is larger than the modulator, or if the scale is not positive and finite.
    pub fn from_levels(levels: &[u8], size: Size, scale: f32, target: &Target) -> Result<Self> {
        target.check()?;
        let most = target.modulator();
        let (bits, colours) = (target.display.bits(), target.display.colours());
        if bits > 8 {
            return Err(Error::Setting(format!(
                "levels of a byte each; the display has {bits} bits, at most 8 are right"
            )));
        }
        let fits = size.width <= most.width && size.height <= most.height;
        if !fits || levels.len() != colours * size.pixels() || levels.is_empty() {
            return Err(Error::Setting(format!(
                "{} levels of {size} pixels and {colours} colours; the modulator has {most} pixels at most",
                levels.len()
            )));
        }
        if !(scale.is_finite() && scale > 0.0) {
            return Err(Error::Setting(format!(
                "a scale of {scale} is no hologram's; it must be positive and finite"
            )));
        }
        let mut own = Pool::default().take(levels.len());
        own.values.copy_from_slice(levels);
        Ok(Hologram {
            timestamp_ns: None,
            size,
            levels: own,
            words: None,
            depth: Pool::default().take(0),
            depth_size: Size { width: 0, height: 0 },
            scale,
            times: FrameTimes::default(),
            range_m: None,
            valid_depth: None,
            quality_level: 0,
            encoding: RgbEncoding::default(),
            viewer: Arc::new(Viewer::new(target.clone(), Threads::shared()?)),
            #[cfg(feature = "gpu")]
            on_gpu: None,
        })
    }

    /// Returns the timestamp of the frame; `None` for a hologram that no session made.
    pub fn timestamp_ns(&self) -> Option<u64> {
        self.timestamp_ns
    }

    /// Returns the size of the hologram.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Returns C, the number of colours of the levels.
    pub fn colours(&self) -> usize {
        self.viewer.target.display.colours()
    }

    /// Returns the modulator levels, (C, H, W): red, green and blue, or those of the only laser. For a display with
    /// more than 8 bits, these are the upper 8 bits.
    pub fn levels(&self) -> &[u8] {
        &self.levels.values
    }

    /// Returns the levels of a display with more than 8 bits, (C, H, W), or `None` for other displays. [`Self::levels`]
    /// has their upper 8 bits.
    pub fn words(&self) -> Option<&[u16]> {
        self.words.as_ref().map(|words| &words.values[..])
    }

    /// Returns the levels in the form that [`phasefront_core::output::Output`] takes.
    pub fn output_levels(&self) -> Levels<'_> {
        match self.words() {
            Some(words) => Levels::Words(words),
            None => Levels::Bytes(self.levels()),
        }
    }

    /// Returns the levels of one colour, (H, W): 0 is red, 1 green, 2 blue; with one laser, 0 is its plane.
    ///
    /// # Errors
    /// Returns an error for any other colour.
    pub fn plane(&self, colour: usize) -> Result<&[u8]> {
        let size = self.size.height * self.size.width;
        self.levels()
            .chunks_exact(size)
            .nth(colour)
            .ok_or_else(|| match self.colours() {
                1 => Error::Setting(format!("there is no plane {colour}; one laser has plane 0 alone")),
                _ => Error::Setting(format!("there is no plane {colour}; 0 is red, 1 green, 2 blue")),
            })
    }

    /// Returns the amplitude that full light represents.
    pub fn scale(&self) -> f32 {
        self.scale
    }

    /// Returns the time that each stage took.
    pub fn times(&self) -> FrameTimes {
        self.times
    }

    /// Returns the distances of the near and the far end of the volume in metres; `None` for normalized depth.
    pub fn range_m(&self) -> Option<(f32, f32)> {
        self.range_m
    }

    /// Returns the share of the depth sensor's pixels that had a usable reading; `None` for a hologram that no session
    /// made.
    pub fn valid_depth(&self) -> Option<f32> {
        self.valid_depth
    }

    /// Returns the quality level of the hologram; 0 is the best.
    pub fn quality_level(&self) -> usize {
        self.quality_level
    }

    /// Returns the encoding of the colours of the frame.
    pub fn encoding(&self) -> RgbEncoding {
        self.encoding
    }

    /// Returns this hologram as that of a frame of another encoding, in which views show it.
    pub fn with_encoding(self, encoding: RgbEncoding) -> Self {
        Hologram { encoding, ..self }
    }

    /// Returns how views become pictures: in sRGB, or as the amplitudes that the frame's values were.
    #[doc(hidden)]
    pub fn view_colours(&self) -> ViewColours {
        ViewColours::new(self.encoding, &self.viewer.target.display)
    }

    /// Returns the target of the hologram.
    pub fn target(&self) -> &Target {
        &self.viewer.target
    }

    /// Returns the z in metres of the scene point at (`x`, `y`) of the picture, for example to focus where the user
    /// taps. Coordinates run from 0 to 1 from the upper left corner; values outside are clamped to the edge. A GPU's
    /// session knows it at the depth sensor's resolution. Returns 0 for a hologram of a field, whose depth is not
    /// known.
    pub fn z_at(&self, x: f64, y: f64) -> f64 {
        if self.depth.values.is_empty() {
            return 0.0;
        }
        let Size { width, height } = self.depth_size;
        let at = |share: f64, n: usize| ((share.clamp(0.0, 1.0) * n as f64) as usize).min(n - 1);
        let d = self.depth.values[at(y, height) * width + at(x, width)];
        self.viewer.target.display.z_of_depth(f64::from(d) / 65535.0)
    }

    /// Runs `call` on the session's threads.
    ///
    /// # Errors
    /// Returns an error in a process that was forked from the session's, or if a log handler makes the call while a
    /// session computes.
    #[doc(hidden)]
    pub fn on_threads<R: Send>(&self, call: impl FnOnce() -> Result<R> + Send) -> Result<R> {
        self.viewer.process.check()?;
        computing::check()?;
        let _computing = Computing::begin();
        self.viewer.pool.install(call)
    }

    /// Writes the view of an eye focused at `z_m` into `bytes`, an image of the size `screen` in `layout`, Rgb,
    /// Rgba or Bgra, whose rows begin `row_stride` bytes apart. The pixels are sRGB; for a frame of
    /// [`RgbEncoding::Amplitude`] they are amplitudes, where 255 is 1. The plan is kept for the next call with the same
    /// z and size, on this or another result of the session.
    ///
    /// # Errors
    /// Returns an error if the image is empty, has over 2²⁶ pixels or a side over 2¹⁴, has another layout or does not
    /// fit `bytes`, if z is too far away, in a process that was forked from the session's, or if a log handler makes
    /// the call while a session computes.
    pub fn write_preview(
        &self,
        z_m: f64,
        screen: Size,
        layout: Layout,
        bytes: &mut [u8],
        row_stride: usize,
    ) -> Result<()> {
        self.viewer.process.check()?;
        computing::check()?;
        let _computing = Computing::begin();
        // Lock the plan before entering the pool, whose threads could otherwise start another view while this one
        // waits.
        let mut plan = lock(&self.viewer.plan);
        let colours = self.view_colours();
        let fits = |plan: &&mut ViewPlan| {
            plan.size == self.size
                && plan.z_m == z_m
                && plan.preview.screen() == screen
                && *plan.preview.view_colours() == colours
        };
        if plan.as_mut().filter(fits).is_none() {
            let target = &self.viewer.target;
            *plan = Some(self.viewer.pool.install(|| -> Result<_> {
                let preview = Preview::new(self.size, target, z_m, screen)?.with_view_colours(colours);
                Ok(ViewPlan {
                    size: self.size,
                    z_m,
                    scratch: preview.scratch(),
                    preview,
                })
            })?);
        }
        let Some(ViewPlan { preview, scratch, .. }) = &mut *plan else {
            return Ok(());
        };
        self.viewer.pool.install(|| {
            let _stage = stage!("preview");
            preview.look(self.levels(), self.scale, (layout, bytes, row_stride), scratch)
        })
    }

    /// Returns the levels on the GPU if they stayed there, which only a browser's session lets them. The functions that
    /// read levels then return arbitrary values.
    #[cfg(feature = "gpu")]
    #[doc(hidden)]
    pub fn on_gpu(&self) -> Option<&GpuLevels> {
        self.on_gpu.as_deref()
    }

    /// Renders what [`Self::write_preview`] writes on the GPU that has `levels`, those of [`Self::on_gpu`], and passes
    /// the view to `take`. The plan is kept for other z of the same size.
    ///
    /// # Errors
    /// Returns an error in the cases of [`Self::write_preview`], and if the GPU cannot have the view or was lost.
    #[cfg(feature = "gpu")]
    #[doc(hidden)]
    pub async fn view_on_gpu(
        &self,
        levels: &GpuLevels,
        z_m: f64,
        screen: Size,
        take: impl AsyncFnOnce(&GpuView) -> std::result::Result<(), GpuError>,
    ) -> std::result::Result<(), GpuError> {
        let preview = Preview::new(self.size, &self.viewer.target, z_m, screen)?;
        let preview = preview.with_view_colours(self.view_colours());
        // No lock is held while the GPU is awaited.
        let kept = lock(&self.viewer.gpu_plan).take();
        let mut view = match kept.filter(|view| view.fits(levels, &preview)) {
            Some(view) => view,
            None => GpuView::new(levels, &preview).await?,
        };
        view.draw(levels, &preview, self.scale).await?;
        take(&view).await?;
        *lock(&self.viewer.gpu_plan) = Some(view);
        Ok(())
    }

    /// Returns the field that the levels produce behind the aperture, through the optics, at `z_m`, (C, H, W); z = 0 is
    /// the midpoint. The carrier exp(i2πz/λ) is left out. This takes six transforms of padded planes; use it for study,
    /// not for every frame.
    ///
    /// # Errors
    /// Returns an error if z is so far away that the padded plane would have over 2²⁷ values, or in a process that was
    /// forked from the session's.
    pub fn field(&self, z_m: f64) -> Result<Vec<Complex32>> {
        self.viewer.process.check()?;
        let seen = || seen_field(self.output_levels(), self.scale, self.target(), self.size, z_m);
        self.viewer.pool.install(seen)
    }

    /// Returns the view of an eye focused at `z_m` at full resolution, as amplitudes (C, H, W) where 1 is white: the
    /// absolute values of [`Self::field`].
    ///
    /// # Errors
    /// Returns an error in the same cases as [`Self::field`].
    pub fn refocus(&self, z_m: f64) -> Result<Vec<f32>> {
        let amplitudes = |field: Vec<Complex32>| field.iter().map(|value| value.norm()).collect();
        self.field(z_m).map(amplitudes)
    }
}
