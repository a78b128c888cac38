//! The levels of a video's latest frame, which stay where its wave stays.

use crate::encode::brightness::{self, Brightness, Percentile};
use crate::frame::Past;
use crate::method::standing::Changed;
use crate::method::wave::Wave;
use num_complex::Complex32;

/// The levels of the latest wave that keeps what stands still.
#[derive(Default)]
pub(super) struct Shown {
    /// The levels, (C, H, W).
    pub(super) levels: Vec<u8>,
    /// What they were made with, if they are whole.
    made: Option<Made>,
}

#[derive(Clone, Copy)]
struct Made {
    /// The number of the wave.
    number: u64,
    turns: [Complex32; 3],
    scale: f32,
    /// The scale of the wave alone, without a past.
    own_scale: f32,
}

impl Shown {
    /// Creates memory for `len` levels.
    pub(super) fn new(len: usize) -> Self {
        Shown {
            levels: vec![0; len],
            made: None,
        }
    }

    /// Prepares for the levels of `wave`, whose largest amplitude is `most`. Returns the scale and, if only some pixels
    /// differ from [`Self::levels`], these pixels.
    pub(super) fn begin<'a>(
        &mut self,
        past: Option<Past>,
        wave: &Wave<'a>,
        brightness: Brightness,
        percentile: &mut Percentile,
        most: impl FnOnce() -> f32,
    ) -> (f32, Option<Changed<'a>>) {
        let before = (self.made.take().zip(wave.changed))
            .filter(|(made, changed)| past.is_some() && made.number + 1 == changed.number && made.turns == wave.turns);
        let same = before.filter(|(_, changed)| !changed.any());
        let own_scale = match (same, brightness) {
            (Some((made, _)), _) => made.own_scale,
            (None, Brightness::Smoothed) => {
                let differs = |values| before.is_none() || wave.differs(values);
                percentile.of(wave.len(), |at| wave.value(at), differs)
            }
            (None, Brightness::Fixed(scale)) => scale,
            (None, Brightness::FrameMax) => most(),
        };
        let scale = match (brightness, past) {
            (Brightness::Smoothed, Some(past)) if wave.changed.is_some() => brightness::held(past, own_scale),
            (Brightness::Smoothed, Some(past)) => brightness::smoothed(past, own_scale),
            _ => own_scale,
        };
        self.made = wave.changed.map(|changed| Made {
            number: changed.number,
            turns: wave.turns,
            scale,
            own_scale,
        });
        let stays = before.filter(|(made, _)| made.scale == scale);
        (scale, stays.map(|(_, changed)| changed))
    }

    /// Forgets the levels, which are not whole.
    pub(super) fn give_up(&mut self) {
        self.made = None;
    }
}
