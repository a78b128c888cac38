//! Phases that a modulator's panel adds at each pixel (flatness correction, carrier, lens), and phase ranges over 2π,
//! in which neighbouring pixels need no jump.
//!
//! The panel is applied between the encoder and the response, to phases in memory. The encoder's sweep does not depend
//! on it.

use crate::Bounds;
use crate::Size;
use crate::display::{Display, check_colours};
use crate::parallel::prelude::*;
use crate::runtime::error::{Error, Result};
use num_complex::Complex32;
use std::f32::consts::TAU;
use std::sync::Arc;

/// The phases and the phase range of a panel. The default adds nothing.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Panel {
    /// The angles, in radians, by which a blazed grating turns light right and down, the same for each colour. This
    /// separates the image from the light that the panel does not modulate.
    pub carrier_rad: [f64; 2],
    /// The focal length of a lens at the panel, in metres, or `None` for no lens. A positive lens converges light
    /// toward the viewer.
    pub lens_m: Option<f64>,
    /// The phases that make the panel flat.
    pub flatness: Option<Flatness>,
    /// The phase of each level, in turns of 2π, rising from 0. If they exceed one turn, the phases of a row follow
    /// their neighbours instead of jumping at 2π, as far as the range allows. If `None`, the response alone determines
    /// the levels.
    pub levels_turns: Option<Vec<f64>>,
}

/// Phases for each pixel of a modulator, with one map for all colours or one for each.
#[derive(Debug, Clone, PartialEq)]
pub struct Flatness {
    size: Size,
    /// The phases, (1 or 3, H, W), in turns of 2π/65536.
    maps: Arc<[u16]>,
}

impl Flatness {
    /// Creates the phases to add from `maps`, (1 or 3, H, W), planes of `size`, in turns of 2π/65536.
    ///
    /// # Errors
    /// Returns an error if the map is empty or its length does not match `size`.
    pub fn new(size: Size, maps: Vec<u16>) -> Result<Self> {
        let area = size.height * size.width;
        if area == 0 || (maps.len() != area && maps.len() != 3 * area) {
            return Err(Error::Setting(format!(
                "a flatness map of {} values for {}×{} pixels; there must be one for each, or one for each colour",
                maps.len(),
                size.width,
                size.height
            )));
        }
        Ok(Flatness {
            size,
            maps: maps.into(),
        })
    }

    /// Returns the size of the modulator.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Returns the part of the map of `size` in its middle, for a hologram smaller than the modulator.
    ///
    /// # Errors
    /// Returns an error if the map has fewer pixels.
    pub fn centred(&self, size: Size) -> Result<Self> {
        let Size { width, height } = size;
        let Size {
            width: columns,
            height: rows,
        } = self.size;
        if height > rows || width > columns {
            return Err(Error::Setting(format!(
                "the flatness map is for {} pixels, the hologram has {size}; it must not be larger",
                self.size
            )));
        }
        let (top, left) = ((rows - height) / 2, (columns - width) / 2);
        let maps = self.maps.chunks_exact(rows * columns);
        let middle = maps.flat_map(|map| (top..top + height).flat_map(move |y| &map[y * columns + left..][..width]));
        Self::new(Size { width, height }, middle.copied().collect())
    }

    /// Returns the maps, (1 or 3, H, W), in turns of 2π/65536.
    pub(crate) fn maps(&self) -> &[u16] {
        &self.maps
    }
}

impl Panel {
    /// Returns whether the panel adds nothing, so that the response alone converts phases to levels.
    pub fn is_plain(&self) -> bool {
        !self.adds() && !self.goes_on()
    }

    /// Returns whether the panel adds phases.
    pub fn adds(&self) -> bool {
        self.carrier_rad != [0.0; 2] || self.lens_m.is_some() || self.flatness.is_some()
    }

    /// Returns whether the levels exceed one turn.
    fn goes_on(&self) -> bool {
        self.levels_turns
            .as_ref()
            .is_some_and(|turns| turns.last().is_some_and(|most| *most >= 1.0))
    }

    /// Checks the panel for `display`.
    ///
    /// # Errors
    /// Returns an error if the flatness map is for another size or number of colours, the focal length is 0 or not
    /// finite, or the carrier and the lens change the phase by more than half a turn between neighbouring pixels.
    pub(crate) fn check(&self, display: &Display) -> Result<()> {
        if let Some(flatness) = &self.flatness
            && flatness.size != display.size()
        {
            return Err(Error::Setting(format!(
                "the flatness map is for {} pixels, the display has {}; both must be of one size",
                flatness.size,
                display.size()
            )));
        }
        if let Some(flatness) = &self.flatness
            && flatness.maps.len() > flatness.size.pixels()
        {
            check_colours("the flatness map", 3, display.colours())?;
        }
        if self.lens_m == Some(0.0) || self.lens_m.is_some_and(|f| !f.is_finite()) {
            return Err(Error::Setting("a lens of no focal length; it must not be 0".into()));
        }
        let Size { width, height } = display.size();
        for (angle, pixels) in self.carrier_rad.into_iter().zip([width, height]) {
            let reach_m = pixels as f64 / 2.0 * display.pitch_m();
            let slope = angle.sin().abs() + self.lens_m.map_or(0.0, |f| reach_m / f.abs());
            let shortest_m = display.wavelengths_m().iter().copied().fold(f64::INFINITY, f64::min);
            let turns = slope * display.pitch_m() / shortest_m;
            if turns.is_nan() || turns > 0.5 {
                return Err(Error::Setting(format!(
                    "carrier and lens turn the phase by {turns:.2} of 2π from pixel to pixel; 0.5 is the most that pixels can show"
                )));
            }
        }
        Ok(())
    }
}

/// A plan for holograms of one shape in the middle of a display. It is immutable and can be shared between threads.
#[derive(Debug, Clone)]
pub struct PanelPlan {
    /// The added phases, (C, H, W), in turns of 2π/65536; empty if the panel adds none.
    added: Arc<[u16]>,
    width: usize,
    nearest: Option<Nearest>,
}

impl PanelPlan {
    /// Plans phases of `size` for `display`, or returns `None` if `panel` adds nothing.
    ///
    /// # Errors
    /// Returns an error if a map is for another modulator, or if the carrier and the lens change the phase by more than
    /// half a turn between neighbouring pixels.
    pub fn new(panel: &Panel, display: &Display, size: Size) -> Result<Option<Self>> {
        panel.check(display)?;
        if panel.is_plain() {
            return Ok(None);
        }
        Ok(Some(PanelPlan {
            added: if panel.adds() {
                added(panel, display, size).into()
            } else {
                Arc::new([])
            },
            width: size.width,
            nearest: panel
                .levels_turns
                .as_deref()
                .filter(|_| panel.goes_on())
                .map(Nearest::new),
        }))
    }

    /// Adds the panel's phases to `phases`, (C, H, W), and wraps them to \[0, 2π). Does not allocate.
    ///
    /// # Panics
    /// Panics if the length of `phases` differs from the plan.
    pub fn add(&self, phases: &mut [f32]) {
        if self.added.is_empty() {
            return;
        }
        assert_eq!(phases.len(), self.added.len());
        let rows = phases.par_chunks_exact_mut(self.width);
        rows.zip(self.added.par_chunks_exact(self.width))
            .for_each(|(phases, added)| {
                for (phase, added) in phases.iter_mut().zip(added) {
                    let sum = *phase + radians(*added);
                    *phase = if sum >= TAU { sum - TAU } else { sum };
                }
            });
    }

    /// Returns the phase added to value `at` of a stack (C, H, W).
    pub fn added(&self, at: usize) -> f32 {
        self.added.get(at).copied().map_or(0.0, radians)
    }

    /// Removes the panel's phases from `field`, (C, H, W), as the inverse of [`Self::add`].
    ///
    /// # Panics
    /// Panics if the length of `field` differs from the plan.
    pub fn remove(&self, field: &mut [Complex32]) {
        if self.added.is_empty() {
            return;
        }
        assert_eq!(field.len(), self.added.len());
        let pairs = field.par_iter_mut().zip(self.added.par_iter());
        pairs.for_each(|(value, added)| *value *= Complex32::from_polar(1.0, -radians(*added)));
    }

    /// Converts `phases`, (C, H, W) in \[0, 2π), to levels that exceed one turn.
    ///
    /// Of the levels with the same phase modulo 2π, it chooses the one nearest to the left neighbour, or to the middle
    /// of the range for the first pixel of a row. If the levels do not exceed one turn, it writes nothing and returns
    /// false. Does not allocate.
    ///
    /// # Panics
    /// Panics if the length of `phases` or `levels` differs from the plan.
    pub fn levels(&self, phases: &[f32], levels: &mut [u8]) -> bool {
        let Some(nearest) = &self.nearest else {
            return false;
        };
        assert_eq!(phases.len(), levels.len());
        let rows = phases.par_chunks_exact(self.width);
        rows.zip(levels.par_chunks_exact_mut(self.width))
            .for_each(|(phases, levels)| nearest.row(phases, levels));
        true
    }
}

fn radians(turns: u16) -> f32 {
    f32::from(turns) * (TAU / 65536.0)
}

/// Computes the phases that `panel` adds, (C, H, W), in turns of 2π/65536.
///
/// Light is exp(+i2πz/λ), so a wave that travels right at the angle θ is exp(i2πx·sin θ/λ), and a wave that converges
/// at the distance f from the panel is exp(−iπ(x² + y²)/(λf)).
fn added(panel: &Panel, display: &Display, Size { width, height }: Size) -> Vec<u16> {
    let modulator = display.size();
    let corner = (
        (modulator.height - height.min(modulator.height)) / 2,
        (modulator.width - width.min(modulator.width)) / 2,
    );
    let pitch_m = display.pitch_m();
    let place = |at: usize, pixels: usize| (at as f64 - (pixels as f64 - 1.0) / 2.0) * pitch_m;
    let sines = panel.carrier_rad.map(f64::sin);
    let mut all = Vec::with_capacity(display.colours() * height * width);
    for (colour, wavelength_m) in display.wavelengths_m().iter().enumerate() {
        for y in 0..height {
            let y_m = place(y, height);
            for x in 0..width {
                let x_m = place(x, width);
                let tilt = (x_m * sines[0] + y_m * sines[1]) / wavelength_m;
                let lens = panel
                    .lens_m
                    .map_or(0.0, |f| (x_m * x_m + y_m * y_m) / (2.0 * wavelength_m * f));
                let flat = panel.flatness.as_ref().map_or(0, |flatness| {
                    let area = modulator.height * modulator.width;
                    let of_colour = if flatness.maps.len() == area { 0 } else { colour * area };
                    flatness.maps[of_colour + (y + corner.0) * modulator.width + x + corner.1]
                });
                let turns = ((tilt - lens).rem_euclid(1.0) * 65536.0).round() as u32;
                all.push((turns as u16).wrapping_add(flat));
            }
        }
    }
    all
}

/// The levels of a panel whose range exceeds one turn.
#[derive(Debug, Clone)]
struct Nearest {
    /// The nearest level for each step of 1/STEPS of a turn.
    level: Vec<u8>,
    /// The phase of the last level, in turns.
    most: f32,
}

/// The number of steps in a turn.
const STEPS: f32 = 4096.0;

impl Nearest {
    fn new(turns: &[f64]) -> Self {
        let most = turns.last().copied().unwrap_or_default();
        let steps = (most * f64::from(STEPS)) as usize;
        let nearest = |step: usize| {
            let at = step as f64 / f64::from(STEPS);
            let after = turns.partition_point(|turn| *turn < at).min(turns.len() - 1);
            let before = after.saturating_sub(1);
            if turns[after] - at <= at - turns[before] {
                after
            } else {
                before
            }
        };
        Nearest {
            level: (0..=steps).map(|step| nearest(step) as u8).collect(),
            most: most as f32,
        }
    }

    /// Converts a row of phases to levels.
    fn row(&self, phases: &[f32], levels: &mut [u8]) {
        let mut before = self.most / 2.0;
        for (phase, level) in phases.iter().zip(levels) {
            let turn = phase / TAU;
            // The copy of the phase, in whole turns, that lies in the range and nearest to the previous pixel.
            let whole = (before - turn)
                .round()
                .at_least(0.0)
                .at_most((self.most - turn).at_least(0.0).floor());
            before = (turn + whole).at_most(self.most);
            let step = (before * STEPS + 0.5) as usize;
            *level = self.level[step.min(self.level.len() - 1)];
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use std::f64::consts::PI;

    fn display() -> Display {
        Display::from_toml("width = 40\nheight = 24").unwrap()
    }

    #[test]
    fn added_phases_are_those_of_the_equations_and_are_taken_away_again() {
        let display = display();
        let maps: Vec<u16> = (0..40 * 24).map(|i| (i * 97) as u16).collect();
        let panel = Panel {
            carrier_rad: [0.01, -0.004],
            lens_m: Some(0.2),
            flatness: Some(Flatness::new(Size { width: 40, height: 24 }, maps.clone()).unwrap()),
            levels_turns: None,
        };
        // A smaller hologram lies in the middle.
        let (height, width) = (10, 16);
        let plan = PanelPlan::new(&panel, &display, Size { width, height })
            .unwrap()
            .unwrap();
        let phases: Vec<f32> = (0..3 * 160).map(|i| (i % 63) as f32 * 0.1).collect();
        let mut shown = phases.clone();
        plan.add(&mut shown);
        for (colour, wavelength_m) in display.wavelengths_m().iter().enumerate() {
            for (y, x) in [(0, 0), (3, 15), (9, 7)] {
                let (y_m, x_m) = ((y as f64 - 4.5) * 8e-6, (x as f64 - 7.5) * 8e-6);
                let wave = 2.0 * PI * (x_m * 0.01f64.sin() + y_m * (-0.004f64).sin()) / wavelength_m;
                let lens = -PI * (x_m * x_m + y_m * y_m) / (wavelength_m * 0.2);
                let flat = f64::from(maps[(y + 7) * 40 + x + 12]) / 65536.0 * 2.0 * PI;
                let at = (colour * height + y) * width + x;
                let want = f64::from(phases[at]) + wave + lens + flat;
                let apart = (f64::from(shown[at]) - want).rem_euclid(2.0 * PI);
                assert!(apart.min(2.0 * PI - apart) < 3e-4, "{colour} {y} {x}: {apart}");
                assert!((0.0..TAU).contains(&shown[at]));
            }
        }
        let mut middle = panel.clone();
        middle.flatness = Some(
            panel
                .flatness
                .as_ref()
                .unwrap()
                .centred(Size { width, height })
                .unwrap(),
        );
        let small = display.clone().with_size(Size { width, height }).unwrap();
        let of_middle = PanelPlan::new(&middle, &small, Size { width, height })
            .unwrap()
            .unwrap();
        assert_eq!(of_middle.added, plan.added);
        assert!(panel.flatness.unwrap().centred(Size { width: 40, height: 25 }).is_err());
        let mut field: Vec<Complex32> = shown.iter().map(|p| Complex32::from_polar(1.0, *p)).collect();
        plan.remove(&mut field);
        for (value, phase) in field.iter().zip(&phases) {
            assert!((value - Complex32::from_polar(1.0, *phase)).norm() < 1e-5);
        }
    }

    #[test]
    fn a_carrier_turns_light_by_its_angle_in_every_colour() {
        use crate::optics::asm::{Padding, Propagator};
        let display = Display::from_toml("width = 128\nheight = 64").unwrap();
        let panel = Panel {
            carrier_rad: [0.008, 0.0],
            ..Panel::default()
        };
        let plan = PanelPlan::new(&panel, &display, Size { width: 128, height: 64 })
            .unwrap()
            .unwrap();
        let distance_m = 20e-3;
        for (colour, wavelength_m) in display.wavelengths_m().iter().copied().enumerate() {
            // A beam 20 pixels wide that travels straight without the carrier.
            let beam = |y: usize, x: usize| {
                let (y, x) = (y as f32 - 31.5, x as f32 - 63.5);
                (-(y * y + x * x) / 200.0).exp()
            };
            let mut plane: Vec<Complex32> = (0..64 * 128)
                .map(|at| Complex32::from_polar(beam(at / 128, at % 128), plan.added(colour * 64 * 128 + at)))
                .collect();
            let way = Propagator::new(
                Size { width: 128, height: 64 },
                8e-6,
                wavelength_m,
                distance_m,
                Padding::Double,
            )
            .unwrap();
            way.propagate(&mut plane, &mut way.scratch());
            let (mut sum, mut moved) = (0.0, 0.0);
            for (at, value) in plane.iter().enumerate() {
                sum += value.norm_sqr();
                moved += value.norm_sqr() * ((at % 128) as f32 - 63.5);
            }
            let pixels = 0.008f32.tan() * distance_m as f32 / 8e-6;
            assert!((moved / sum - pixels).abs() < 0.3, "{colour}: {} {pixels}", moved / sum);
        }
    }

    #[test]
    fn over_a_turn_phases_do_not_jump() {
        let turns: Vec<f64> = (0..256).map(|l| 2.0 * f64::from(l) / 256.0).collect();
        let panel = Panel {
            levels_turns: Some(turns.clone()),
            ..Panel::default()
        };
        let plan = PanelPlan::new(&panel, &display(), Size { width: 300, height: 1 })
            .unwrap()
            .unwrap();
        // A ramp that rises and falls by three quarters of a turn across 2π.
        let ramp: Vec<f32> = (0..900)
            .map(|i| {
                let t = (i % 100) as f32 / 100.0;
                ((0.6 + 0.75 * (1.0 - (2.0 * t - 1.0).abs())) % 1.0) * TAU
            })
            .collect();
        let mut levels = vec![0; 900];
        assert!(plan.levels(&ramp, &mut levels));
        for (row, phases) in levels.chunks(300).zip(ramp.chunks(300)) {
            for (pair, phase) in row.windows(2).zip(phases) {
                assert!(pair[0].abs_diff(pair[1]) < 4, "{pair:?}");
                let apart = (turns[pair[0] as usize] - f64::from(phase / TAU)).rem_euclid(1.0);
                assert!(apart.min(1.0 - apart) < 1.05 / 256.0, "{} {phase}", pair[0]);
            }
        }
        // At the ends of the range, each phase still gets a level with that phase.
        let wild: Vec<f32> = (0..900).map(|i| (i * 7919 % 1000) as f32 / 1000.0 * TAU).collect();
        assert!(plan.levels(&wild, &mut levels));
        for (level, phase) in levels.iter().zip(&wild) {
            let apart = (turns[*level as usize] - f64::from(phase / TAU)).rem_euclid(1.0);
            assert!(apart.min(1.0 - apart) < 1.05 / 256.0, "{level} {phase}");
        }
    }

    #[test]
    fn what_pixels_cannot_show_is_refused() {
        // Half a turn between neighbouring pixels in blue.
        let most = (450e-9_f64 / (2.0 * display().pitch_m())).asin();
        let with = |carrier_rad, lens_m, flatness| Panel {
            carrier_rad,
            lens_m,
            flatness,
            levels_turns: None,
        };
        for (panel, word) in [
            (with([1.01 * most, 0.0], None, None), "0.5"),
            (with([0.0, -1.01 * most], None, None), "0.5"),
            (with([f64::NAN, 0.0], None, None), "turn"),
            (with([0.0; 2], Some(1e-3), None), "lens"),
            (with([0.0; 2], Some(0.0), None), "focal"),
            (
                with(
                    [0.0; 2],
                    None,
                    Some(Flatness::new(Size { width: 5, height: 4 }, vec![0; 20]).unwrap()),
                ),
                "5×4",
            ),
        ] {
            let error = PanelPlan::new(&panel, &display(), Size { width: 40, height: 24 })
                .unwrap_err()
                .to_string();
            assert!(error.contains(word), "{panel:?}: {error}");
        }
        assert!(
            PanelPlan::new(
                &with([0.99 * most, 0.0], None, None),
                &display(),
                Size { width: 40, height: 24 }
            )
            .is_ok()
        );
        assert!(Flatness::new(Size { width: 5, height: 4 }, vec![0; 19]).is_err());
    }
}
