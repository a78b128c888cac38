//! Time multiplexing: several phase maps of one wave, shown so fast that the eye sees their mean intensity.
//!
//! Maps differ in the free choices of an encoder: which pixels of the checkerboard get φ + acos A (the parity), and a
//! constant phase, which changes how levels round. With feedback, each map compensates for the error in the mean of the
//! maps before it: after k maps of intensities I₁ … I_k, the next map aims at (k + 1)·I − ΣI_j at the midpoint, where I
//! is the wave's intensity, with the wave's phase.
//!
//! For natural focus, each map is of the scene lit from its own direction, so that an eye's pupil adds sharp views from
//! several places, as it does in the world. Joint steps then bring the mean intensity to the focal stack of incoherent
//! light ([`phasefront_core::encode::natural`]).

use ndarray::Array3;
use num_complex::Complex32;
use phasefront::RgbdFrame;
use phasefront::Size;
use phasefront::{EncoderOptions, Target};
use phasefront_core::encode::Encoder;
use phasefront_core::encode::natural::NaturalSteps;
use phasefront_core::focus::disc;
use phasefront_core::optics::aperture::Opening;
use phasefront_core::optics::asm::{Padding, Propagator};
use phasefront_core::pipeline::display_plan::DisplayPlan;
use phasefront_core::view::refocus::{Refocus, phase_only_field};
use phasefront_exact::incoherent::{self, Natural, Pupil};
use phasefront_exact::sm_lbm;
use phasefront_exact::truth::{self, Figures};
use phasefront_io::Result;
use std::f32::consts::TAU;

/// The differences between maps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Differ {
    /// Whether maps differ in parity and constant phase.
    pub start: bool,
    /// Whether each map compensates for the error in the mean of the maps before it.
    pub feedback: bool,
}

/// Makes several maps of one wave.
pub struct Multiplex<'a> {
    size: Size,
    target: &'a Target,
    encoder: Encoder,
    /// The propagation from the modulator to the midpoint through the aperture, and back.
    ways: [Vec<Propagator>; 2],
}

/// A phase map.
#[derive(Debug, Clone)]
pub struct Map {
    /// The levels, (C, H, W).
    pub levels: Array3<u8>,
    /// The amplitude that full light stands for.
    pub scale: f32,
}

/// The largest tilt, as a share of the aperture's radius. With larger ones, the noise of double phase enters the
/// aperture.
const LARGEST_TILT: f64 = 0.4;
/// The number of planes of a tilted wave.
const TILTED_PLANES: usize = 96;

/// The limit of feedback: the largest intensity that a map aims at, relative to the wave's.
const MOST: f32 = 4.0;

impl<'a> Multiplex<'a> {
    /// Plans maps of waves of `size` for `target`.
    ///
    /// # Errors
    /// Returns an error if the encoder refuses its options or the offset is too large.
    pub fn new(size: Size, target: &'a Target, options: &EncoderOptions) -> Result<Self> {
        let display = &target.display;
        let way = |distance_m: f64| {
            let (pitch_m, wavelengths_m) = (display.pitch_m(), display.wavelengths_m());
            Propagator::for_colours(size, pitch_m, wavelengths_m, distance_m, Padding::Reach)
        };
        Ok(Multiplex {
            size,
            target,
            encoder: Encoder::new(size, target, options)?,
            ways: [way(-display.offset_m())?, way(display.offset_m())?],
        })
    }

    /// Makes `count` maps of `wave`, (C, H, W), at the modulator.
    pub fn maps(&self, wave: &Array3<Complex32>, count: usize, differ: Differ) -> Vec<Map> {
        let wave = wave.as_slice().expect("standard layout");
        let [there, back] = &self.ways;
        let mut middle = wave.to_vec();
        self.pass(there, &mut middle);
        let mut scratch = self.encoder.scratch();
        let mut phases = vec![0.0; wave.len()];
        let (mut sum, mut scale) = (vec![0.0f32; wave.len()], None);
        let mut maps = Vec::with_capacity(count);
        for n in 0..count {
            let mut field = match n {
                _ if n == 0 || !differ.feedback => wave.to_vec(),
                _ => {
                    let mut field: Vec<Complex32> = (middle.iter().zip(&sum))
                        .map(|(value, sum)| {
                            let wanted = value.norm_sqr();
                            let lacking = (wanted * (n + 1) as f32 - sum).clamp(0.0, MOST * wanted);
                            value * (lacking / wanted.max(1e-12)).sqrt()
                        })
                        .collect();
                    self.pass(back, &mut field);
                    field
                }
            };
            let (odd, turn) = if differ.start {
                (n % 2 == 1, (n as f32 * GOLDEN).fract() * TAU)
            } else {
                (false, 0.0)
            };
            // Double phase of the conjugate, conjugated back, is double phase with the other parity.
            if odd {
                field.iter_mut().for_each(|value| *value = value.conj());
            }
            // Use the scale of the first map, so that all maps have the same brightness.
            let used = self.encoder.encode(&mut field, scale, &mut phases, &mut scratch);
            scale = Some(used);
            let response = &self.target.response;
            let mut levels = Array3::zeros((there.len(), self.size.height, self.size.width));
            for (at, (level, phase)) in levels.iter_mut().zip(&phases).enumerate() {
                let phase = if odd { -phase } else { *phase };
                *level = response.level((phase + turn).rem_euclid(TAU).min(TAU.next_down()), at);
            }
            let map = Map { levels, scale: used };
            if differ.feedback && n + 1 < count {
                let mut shown = self.shown(&map);
                self.pass(there, &mut shown);
                sum.iter_mut()
                    .zip(&shown)
                    .for_each(|(sum, value)| *sum += value.norm_sqr());
            }
            maps.push(map);
        }
        maps
    }

    /// Makes `count` maps of `frame` for natural focus: tilted waves, then `steps` joint steps. `progress` receives the
    /// number of finished waves.
    ///
    /// # Errors
    /// Returns an error if the steps cannot be planned for the target.
    pub fn natural(
        &self,
        frame: &RgbdFrame,
        count: usize,
        steps: usize,
        progress: &(dyn Fn(usize) + Sync),
    ) -> Result<Vec<Map>> {
        let display = &self.target.display;
        let scene = truth::filled(frame, display)?;
        let way = DisplayPlan::new(self.size, self.target, &EncoderOptions::default())?;
        let (mut on_way, mut scratch) = (way.scratch(), self.encoder.scratch());
        let (mut all, mut scale) = (Vec::with_capacity(count), None);
        for (n, (y, x)) in tilts(count).into_iter().enumerate() {
            let tilt = [y, x].map(|share| share * display.aperture_radius());
            let mut field = sm_lbm::tilted(&scene, display, TILTED_PLANES, tilt, &|_, _| {})?;
            let field = field.as_slice_mut().expect("standard layout");
            way.propagate(field, &mut on_way);
            let mut phases = vec![0.0; field.len()];
            // Use the scale of the first map, so that all maps have the same brightness.
            scale = Some(self.encoder.encode(field, scale, &mut phases, &mut scratch));
            all.push(phases);
            progress(n + 1);
        }
        let scale = scale.unwrap_or_default();
        let plan = NaturalSteps::new(self.size, self.target, steps)?;
        let mut scratch = plan.scratch(count);
        plan.aim(frame, &mut scratch);
        let mut maps: Vec<_> = all.iter_mut().map(Vec::as_mut_slice).collect();
        plan.correct_maps(scale, &mut maps, &mut scratch);
        let shape = (display.colours(), self.size.height, self.size.width);
        let map = |phases: Vec<f32>| {
            let level = |(at, phase)| self.target.response.level(phase, at);
            let levels = phases.into_iter().enumerate().map(level).collect();
            Map {
                levels: Array3::from_shape_vec(shape, levels).expect("as many levels as phases"),
                scale,
            }
        };
        Ok(all.into_iter().map(map).collect())
    }

    /// Computes the light behind the modulator.
    fn shown(&self, map: &Map) -> Vec<Complex32> {
        let mut field = vec![Complex32::ZERO; map.levels.len()];
        let levels = map.levels.as_slice().expect("standard layout");
        phase_only_field(levels, &self.target.response, map.scale, &mut field);
        field
    }

    fn pass(&self, way: &[Propagator], field: &mut [Complex32]) {
        let (mut scratch, radius) = (way[0].scratch(), self.target.display.aperture_radius());
        for (way, plane) in way
            .iter()
            .zip(field.chunks_exact_mut(self.size.height * self.size.width))
        {
            way.propagate_through(plane, radius, &mut scratch);
        }
    }

    /// Compares the mean of the first n of `maps` with `wave`, for each n in `counts`: at the midpoint, and over a
    /// stack of four depths.
    ///
    /// # Errors
    /// Returns an error if a depth is too far away.
    pub fn judge(&self, wave: &Array3<Complex32>, maps: &[Map], counts: &[usize]) -> Result<Vec<Figures>> {
        let display = &self.target.display;
        let z_m = truth::judged_z_m(display);
        let free = Refocus::new(self.size, display, &z_m, None)?;
        let truth = self.views(&free, wave.as_slice().expect("standard layout"), &z_m)?;
        let seen = self.seen(maps, counts, &z_m)?;
        seen.iter().map(|seen| truth::judge(seen, &truth, 0)).collect()
    }

    /// Compares the mean of the first n of `maps` with what incoherent light shows of `frame`, for each n in `counts`.
    ///
    /// # Errors
    /// Returns an error if a depth is too far away.
    pub fn judge_natural(&self, frame: &RgbdFrame, maps: &[Map], counts: &[usize]) -> Result<Vec<Natural>> {
        let display = &self.target.display;
        let truth = incoherent::Judge::of(&truth::filled(frame, display)?, display, Pupil::of_aperture(display))?;
        let seen = self.seen(maps, counts, &incoherent::Judge::z_m(display))?;
        seen.iter().map(|seen| truth.judge(seen, 0)).collect()
    }

    /// Returns the amplitudes of `field` at each of `z_m`, (C, H, W).
    fn views(&self, plan: &Refocus, field: &[Complex32], z_m: &[f64]) -> Result<Vec<Array3<f32>>> {
        let shape = (self.target.display.colours(), self.size.height, self.size.width);
        let views = plan.focal_stack(field, z_m)?.into_iter();
        Ok(views
            .map(|view| Array3::from_shape_vec(shape, view).expect("a view of the wave's shape"))
            .collect())
    }

    /// Returns the amplitudes that the first n of `maps` show at each of `z_m`, for each n in `counts`.
    fn seen(&self, maps: &[Map], counts: &[usize], z_m: &[f64]) -> Result<Vec<Vec<Array3<f32>>>> {
        let display = &self.target.display;
        let opening = Opening::centred(display.aperture_radius());
        let plan = Refocus::new(self.size, display, z_m, Some(opening))?;
        let mut sums = vec![Array3::<f32>::zeros(maps[0].levels.dim()); z_m.len()];
        let mut seen = Vec::new();
        for (n, map) in maps.iter().enumerate() {
            let views = self.views(&plan, &self.shown(map), z_m)?;
            for (sum, view) in sums.iter_mut().zip(views) {
                *sum += &(&view * &view);
            }
            if counts.contains(&(n + 1)) {
                let mean = |sum: &Array3<f32>| sum.mapv(|sum| (sum / (n + 1) as f32).sqrt());
                seen.push(sums.iter().map(mean).collect());
            }
        }
        Ok(seen)
    }
}

/// Returns the tilts (y, x) of `count` maps, as shares of the aperture's radius.
fn tilts(count: usize) -> Vec<(f64, f64)> {
    match count {
        1 => vec![(0.0, 0.0)],
        _ => disc(count).map(|(y, x)| (LARGEST_TILT * y, LARGEST_TILT * x)).collect(),
    }
}

/// The golden ratio minus 1. Its multiples spread evenly over a turn, for any number of maps.
const GOLDEN: f32 = 0.618_034;

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use phasefront::{Display, Encoding};

    /// Makes a wave of smooth light with edges.
    fn wave(Size { width, height }: Size) -> Array3<Complex32> {
        Array3::from_shape_fn((3, height, width), |(c, y, x)| {
            let edge = if (x / 16 + y / 12 + c) % 2 == 0 { 0.8 } else { 0.25 };
            let ripple = 0.1 * (x as f32 * 0.21 + c as f32).sin();
            Complex32::from_polar(edge + ripple, 0.3 * (y as f32 * 0.1).sin())
        })
    }

    #[test]
    fn the_mean_of_maps_is_nearer_to_the_wave_than_one_map() {
        let (height, width) = (48, 64);
        let display = Display::from_toml("width = 64\nheight = 48\nbits = 4").unwrap();
        let target = Target::from(display);
        let options = EncoderOptions::from(Encoding::ANTI_ALIAS);
        let plan = Multiplex::new(Size { width, height }, &target, &options).unwrap();
        let wave = wave(Size { width, height });
        let alone = Differ {
            start: false,
            feedback: false,
        };
        let repeated = plan.maps(&wave, 2, alone);
        assert_eq!(repeated[0].levels, repeated[1].levels);
        for differ in [
            Differ {
                start: true,
                feedback: false,
            },
            Differ {
                start: true,
                feedback: true,
            },
        ] {
            let maps = plan.maps(&wave, 8, differ);
            assert_eq!(maps[0].levels, repeated[0].levels);
            assert!(maps[1..].iter().all(|map| map.levels != maps[0].levels));
            let figures = plan.judge(&wave, &maps, &[1, 8]).unwrap();
            assert_eq!(figures.len(), 2);
            assert!(
                figures[1].amplitude_psnr > figures[0].amplitude_psnr + 1.0,
                "{differ:?}: {} {}",
                figures[0].amplitude_psnr,
                figures[1].amplitude_psnr
            );
        }
    }
}
