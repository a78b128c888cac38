//! Phases whose picture lies in the focal plane of a lens ([`crate::display::lens`]), by alternating projections
//! (Gerchberg and Saxton, 1972).
//!
//! Let T_z be the way of the light to the picture at z, A the amplitudes of the frame over the scale, and M_z the
//! pixels whose surface lies at z. A step takes one plane after another:
//!
//!   U = T_z·u,  u ← u + γ·T_zᴴ·M_z·(A − |U|)·U/|U|,  u ← u/|u|.
//!
//! Only the picture is wanted. The light beside it is free, and takes what the picture does not need, half of the light
//! by default: this is what makes phases alone show a picture.
//!
//! The steps begin with the picture under the phase c·π·a·(x² + y²), a the spacing of the transform, which spreads the
//! picture over the part c of the modulator. A constant phase would gather nearly all light in the middle of the
//! modulator. A random phase spreads it evenly, but has points of no light between the pixels, which stay as speckle.

use crate::Bounds;
use crate::Size;
use crate::display::Display;
use crate::display::lens::{Lens, LensPlan};
use crate::display::response::wrap;
use crate::frame::RgbdFrame;
use crate::parallel::prelude::*;
use crate::runtime::error::{Error, Result};
use num_complex::Complex32;
use std::f32::consts::PI;

/// The share of the light of the brightest colour that goes to the picture.
const SHARE: f64 = 0.5;
/// c, the part of the modulator's width that the picture is spread over.
const SPREAD: f32 = 0.9;
/// γ. The steps are stable below 3.
const STEP: f32 = 2.0;
/// The number of steps if the picture has one plane, and if it has several.
const STEPS: [usize; 2] = [25, 12];
/// The largest number of planes.
const MOST_PLANES: f64 = 16.0;

/// Phases, and the amplitude that they show.
#[derive(Debug, Clone, PartialEq)]
pub struct FocalPhases {
    /// The phases, (C, H, W), in \[0, 2π).
    pub phases: Vec<f32>,
    /// The amplitude of a picture over which all light is spread evenly.
    pub scale: f32,
}

/// Returns the number of planes into which the volume of `display` is cut: as many as keep the phase at the corners of
/// the modulator within π/2 of the right one, up to 16.
pub fn planes(lens: &Lens, display: &Display) -> usize {
    let shortest_m = display.wavelengths_m().iter().copied().fold(f64::INFINITY, f64::min);
    let Size { width, height } = display.size();
    let corner_m = 0.5 * (width as f64).hypot(height as f64) * display.pitch_m();
    let turns = display.volume_depth_m() * (corner_m / lens.focal_m()).powi(2) / shortest_m;
    turns.ceil().clamp(1.0, MOST_PLANES) as usize
}

/// Returns the phases that show `frame`, of the size of the modulator, through `lens`. `scale` is the amplitude of a
/// picture over which all light is spread evenly; by default the picture takes half of the light in its brightest
/// colour.
///
/// # Errors
/// Returns an error if the frame has another size or other colours, if it is dark, or if the scale is not positive.
pub fn phases(frame: &RgbdFrame, display: &Display, lens: &Lens, scale: Option<f32>) -> Result<FocalPhases> {
    frame.check(display.size(), display.colours())?;
    let (amplitudes, depth) = frame.values();
    let pixels = depth.len();
    let light = |plane: &[f32]| plane.iter().map(|a| f64::from(*a).powi(2)).sum::<f64>();
    let most = amplitudes.chunks_exact(pixels).map(light).fold(0.0, f64::max);
    if most == 0.0 {
        return Err(Error::Frame("the picture is dark: all of its values are 0".into()));
    }
    let scale = scale.unwrap_or((most / (SHARE * pixels as f64)).sqrt() as f32);
    if !(scale.is_finite() && scale > 0.0) {
        return Err(Error::Setting(format!("the scale is {scale}; it must be above 0")));
    }
    let planes = cut(depth, planes(lens, display), display);
    let mut phases = vec![0.0; amplitudes.len()];
    let all = amplitudes.chunks_exact(pixels).zip(phases.chunks_exact_mut(pixels));
    for (colour, (amplitudes, phases)) in all.enumerate() {
        let wanted: Vec<f32> = amplitudes.iter().map(|a| a / scale).collect();
        let search = Search {
            plan: LensPlan::new(lens, display, colour),
            spacing: lens.spacing(display.wavelengths_m()[colour], display) as f32,
            width: display.size().width,
            wanted,
            of_pixel: &planes.of_pixel,
        };
        search.run(&planes.z_m, phases);
    }
    Ok(FocalPhases { phases, scale })
}

/// The planes of a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Planes {
    /// The plane of each pixel, (H, W).
    pub of_pixel: Vec<u8>,
    /// The planes that have pixels, the nearest first, each with its z in metres.
    pub z_m: Vec<(u8, f64)>,
}

/// Cuts the volume of `display` into `count` planes, and a frame of `depth`, (H, W), along them. A plane lies in the
/// middle of its part of the volume, or, if its pixels have one depth, where they are.
///
/// # Panics
/// Panics if `count` is not in 1..=256.
pub fn cut(depth: &[f32], count: usize, display: &Display) -> Planes {
    assert!((1..=256).contains(&count));
    let plane = |d: &f32| ((d * count as f32) as usize).min(count - 1);
    let mut reach = vec![(1.0f32, 0.0f32); count];
    for d in depth {
        let (nearest, farthest) = &mut reach[plane(d)];
        (*nearest, *farthest) = (d.at_most(*nearest), d.at_least(*farthest));
    }
    let with_pixels = reach.iter().enumerate().filter(|(_, reach)| reach.0 <= reach.1);
    let z_m = with_pixels.map(|(plane, (nearest, farthest))| {
        let middle = match nearest == farthest {
            true => f64::from(*nearest),
            false => (plane as f64 + 0.5) / count as f64,
        };
        (plane as u8, display.z_of_depth(middle))
    });
    Planes {
        z_m: z_m.collect(),
        of_pixel: depth.iter().map(|d| plane(d) as u8).collect(),
    }
}

/// The search for the phases of one colour.
struct Search<'a> {
    plan: LensPlan,
    /// a, the turns of the transform for neighbouring pixels of modulator and picture.
    spacing: f32,
    width: usize,
    /// A, (H, W).
    wanted: Vec<f32>,
    /// The plane of each pixel, (H, W).
    of_pixel: &'a [u8],
}

impl Search<'_> {
    /// Writes the phases for `planes`, each with its z in metres, into `phases`, (H, W).
    fn run(&self, planes: &[(u8, f64)], phases: &mut [f32]) {
        let mut light = self.start(planes);
        let mut seen = vec![Complex32::ZERO; light.len()];
        let steps = STEPS[usize::from(planes.len() > 1)];
        for &(plane, z_m) in std::iter::repeat_n(planes, steps).flatten() {
            seen.copy_from_slice(&light);
            self.plan.to_picture(&mut seen, z_m);
            let pixels = seen.par_iter_mut().zip(&self.wanted).zip(self.of_pixel);
            pixels.for_each(|((value, wanted), of)| {
                *value = match *of == plane {
                    true => unit(*value) * (STEP * (wanted - value.norm())),
                    false => Complex32::ZERO,
                };
            });
            self.plan.to_modulator(&mut seen, z_m);
            let pixels = light.par_iter_mut().zip(&seen);
            pixels.for_each(|(light, change)| *light = unit(*light + change));
        }
        for (phase, light) in phases.iter_mut().zip(&light) {
            *phase = wrap(light.arg());
        }
    }

    /// Returns the light at the modulator, of the amplitude 1, with which the steps begin.
    fn start(&self, planes: &[(u8, f64)]) -> Vec<Complex32> {
        let height = self.wanted.len() / self.width;
        let place = |at: usize, pixels: usize| at as f32 - (pixels as f32 - 1.0) / 2.0;
        let mut sum = vec![Complex32::ZERO; self.wanted.len()];
        for &(plane, z_m) in planes {
            let mut light: Vec<Complex32> = (0..sum.len())
                .into_par_iter()
                .map(|at| {
                    if self.of_pixel[at] != plane {
                        return Complex32::ZERO;
                    }
                    let (y, x) = (place(at / self.width, height), place(at % self.width, self.width));
                    Complex32::from_polar(self.wanted[at], SPREAD * PI * self.spacing * (x * x + y * y))
                })
                .collect();
            self.plan.to_modulator(&mut light, z_m);
            sum.par_iter_mut().zip(&light).for_each(|(sum, value)| *sum += value);
        }
        sum.par_iter_mut().for_each(|value| *value = unit(*value));
        sum
    }
}

/// Returns `value` with the amplitude 1; 1 for 0.
fn unit(value: Complex32) -> Complex32 {
    match value.norm() {
        0.0 => Complex32::ONE,
        norm => value / norm,
    }
}
