//! The conversion of a camera's colours to the amplitudes of a display's lasers.

use phasefront_core::Size;
use phasefront_core::depth::camera::CameraFrame;
use phasefront_core::display::Display;
use phasefront_core::frame::{ColourPlan, ColourScratch, LightPlan, RgbEncoding, luminance};
use phasefront_core::runtime::error::Result;

/// The plans and memory for one display and hologram size.
pub(super) struct ColourStage {
    display: Display,
    size: Size,
    /// The encoded picture, (3, H, W), where its amplitudes do not serve: depth networks take pictures, and the edges
    /// of depth are those of three colours even if the display has one laser.
    picture: Vec<f32>,
    plans: Option<Plans>,
}

/// The plans for one kind of image.
struct Plans {
    encoding: RgbEncoding,
    colour: ColourPlan,
    scratch: ColourScratch,
    /// Converts the encoded picture, if it is kept.
    light: Option<LightPlan>,
}

impl ColourStage {
    /// Prepares the stage. The encoded picture is kept if `keeps_picture` says so or the display has one laser.
    pub(super) fn new(display: &Display, size: Size, keeps_picture: bool) -> Self {
        let keeps_picture = keeps_picture || display.colours() == 1;
        ColourStage {
            display: display.clone(),
            size,
            picture: vec![0.0; if keeps_picture { 3 * size.pixels() } else { 0 }],
            plans: None,
        }
    }

    /// Converts the colours of `frame` to `amplitude`, (C, H, W).
    pub(super) fn read(&mut self, frame: &CameraFrame<'_>, amplitude: &mut [f32]) -> Result<()> {
        let mut plans = match self.plans.take().filter(|plans| plans.fit(frame)) {
            Some(plans) => plans,
            None => self.plan(frame)?,
        };
        if self.picture.is_empty() {
            plans.colour.convert(&frame.colour, amplitude, &mut plans.scratch)?;
        } else {
            plans
                .colour
                .convert(&frame.colour, &mut self.picture, &mut plans.scratch)?;
            match &plans.light {
                Some(light) => light.convert(&self.picture, amplitude),
                None if self.display.colours() == 1 => luminance(&self.picture, amplitude),
                None => amplitude.copy_from_slice(&self.picture),
            }
        }
        self.plans = Some(plans);
        Ok(())
    }

    /// Returns the encoded picture that was read, if it is kept, or its `amplitude`.
    pub(super) fn picture<'a>(&'a self, amplitude: &'a [f32]) -> &'a [f32] {
        if self.picture.is_empty() {
            amplitude
        } else {
            &self.picture
        }
    }

    /// Returns the colours along whose edges depth is conditioned: the `amplitude` of three lasers, which a GPU reads
    /// too, or the picture of one.
    pub(super) fn edges<'a>(&'a self, amplitude: &'a [f32]) -> &'a [f32] {
        match self.display.colours() {
            1 => &self.picture,
            _ => amplitude,
        }
    }

    fn plan(&self, frame: &CameraFrame<'_>) -> Result<Plans> {
        let encoding = frame.colour.encoding();
        let mut light = LightPlan::new(encoding, &self.display);
        let mut colour = ColourPlan::new(&frame.colour, frame.orientation, self.size)?;
        if self.picture.is_empty() {
            colour = colour.with_light(light.take());
        }
        Ok(Plans {
            encoding,
            scratch: colour.scratch(),
            colour,
            light,
        })
    }
}

impl Plans {
    fn fit(&self, frame: &CameraFrame<'_>) -> bool {
        self.encoding == frame.colour.encoding() && self.colour.fits(&frame.colour, frame.orientation)
    }
}
