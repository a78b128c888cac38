//! Causes planted on simulated displays, and the photographs of them.
#![allow(dead_code)] // Tests and the example `planted` take different parts.

use ndarray::{Array2, Array3, Axis};
use num_complex::{Complex32, Complex64};
use phasefront::Size;
use phasefront::target::Aberration;
use phasefront::{Brightness, Display, EncoderOptions, Encoding, Target};
use phasefront_calibration::camera::photograph::Photograph;
use phasefront_calibration::diagnosis::{Diagnosis, Shown, diagnose};
use phasefront_calibration::simulated_display::{Camera, Curves, SimulatedDisplay, Strays};
use phasefront_core::display::levels::Levels;
use phasefront_core::optics::asm::{Padding, Propagator};
use phasefront_core::pipeline::display_plan::DisplayPlan;
use phasefront_io::dice::Dice;
use std::f64::consts::{PI, TAU};

/// A picture in layers: the amplitude of each colour, (3, H, W), and the place in the volume, 0 far to 1 near, (H, W).
pub(crate) struct Picture {
    pub amplitude: Array3<f32>,
    pub near: Array2<f32>,
}

/// A display, its picture and its camera.
pub(crate) struct Bench {
    pub name: &'static str,
    pub display: Display,
    pub z_m: f64,
    pub picture: fn(Size) -> Picture,
    pub zoom: f64,
    /// How far the camera is turned, in degrees, and the largest error of a corner as a share of the width.
    pub turn_deg: f64,
    pub askew: f64,
    pub bits: u32,
    pub full_well: f64,
    pub read_noise: f64,
    /// The share of the sensor's range that the brightest light fills.
    pub exposure: f64,
    pub seed: u64,
}

/// A cause of wrong pictures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Plant {
    /// The share of the panel's light that is not modulated.
    ZeroOrder(f64),
    Conjugate(f64),
    Ghost {
        share: f64,
        shift_px: [f64; 2],
        path_m: f64,
    },
    MirrorX,
    MirrorY,
    Rotated180,
    Rotated90,
    /// How far the camera's focus is off, in depths of focus.
    Distance(f64),
    Range(f64),
    Inverted,
    Order([usize; 3]),
    /// The outer weights of a filter of three levels along x and y.
    LinkBlur([f64; 2]),
    LinkScaled(f64),
    Chroma {
        wide: usize,
        high: usize,
    },
    Tone(f64),
    /// How many times the sensor's range the brightest light would fill.
    Saturated(f64),
}

impl Plant {
    /// Returns the name that a diagnosis has for it.
    pub(crate) fn name(&self) -> &'static str {
        match self {
            Plant::ZeroOrder(_) => "zero order",
            Plant::Conjugate(_) => "conjugate image",
            Plant::Ghost { .. } => "ghost image",
            Plant::MirrorX => "mirrored left to right",
            Plant::MirrorY => "mirrored top to bottom",
            Plant::Rotated180 => "rotated by 180°",
            Plant::Rotated90 => "rotated by 90°",
            Plant::Distance(_) => "wrong distance",
            Plant::Range(_) => "wrong phase range",
            Plant::Inverted => "inverted curve",
            Plant::Order(_) => "colour order",
            Plant::LinkBlur(_) => "link filters pixels",
            Plant::LinkScaled(_) => "link scales pixels",
            Plant::Chroma { .. } => "link mixes colours",
            Plant::Tone(_) => "bent curve",
            Plant::Saturated(_) => "saturated photograph",
        }
    }

    /// Returns a random amount of each cause that shows on a display of `lasers`.
    pub(crate) fn each(lasers: usize, dice: &mut Dice) -> Vec<Plant> {
        let sign = |dice: &mut Dice| if dice.chance(0.5) { 1.0 } else { -1.0 };
        let angle = dice.range(0.0, TAU);
        let far = dice.range(7.0, 22.0);
        let tap = dice.range(0.08, 0.25);
        let mut all = vec![
            Plant::ZeroOrder(dice.range(0.04, 0.2)),
            Plant::Conjugate(dice.range(0.04, 0.2)),
            Plant::Ghost {
                share: dice.range(0.03, 0.15),
                shift_px: [far * angle.cos(), far * angle.sin()],
                path_m: dice.range(0.0, 1.5e-3),
            },
            Plant::MirrorX,
            Plant::MirrorY,
            Plant::Rotated180,
            Plant::Rotated90,
            Plant::Distance(sign(dice) * dice.range(1.5, 8.0)),
            Plant::Range(if dice.chance(0.5) {
                dice.range(0.6, 0.85)
            } else {
                dice.range(1.18, 1.5)
            }),
            Plant::Inverted,
            Plant::LinkBlur(dice.pick(&[[tap, 0.0], [0.0, tap], [tap, tap]])),
            Plant::LinkScaled(1.0 + sign(dice) * dice.range(0.005, 0.04)),
            Plant::Tone(if dice.chance(0.5) {
                dice.range(0.6, 0.8)
            } else {
                dice.range(1.3, 1.8)
            }),
            Plant::Saturated(dice.range(1.5, 3.0)),
        ];
        if lasers == 3 {
            all.push(Plant::Order(dice.pick(&[
                [2, 1, 0],
                [1, 0, 2],
                [0, 2, 1],
                [1, 2, 0],
                [2, 0, 1],
            ])));
            all.push(Plant::Chroma {
                wide: 2,
                high: dice.integer(1, 2),
            });
        }
        all
    }

    /// Returns whether both causes show beside each other: two changes of the same thing are one.
    pub(crate) fn goes_with(&self, other: &Plant) -> bool {
        let family = |plant: &Plant| match plant {
            Plant::MirrorX | Plant::MirrorY | Plant::Rotated180 | Plant::Rotated90 => 1,
            Plant::Range(_) | Plant::Tone(_) => 2,
            Plant::LinkBlur(_) | Plant::LinkScaled(_) | Plant::Chroma { .. } => 3,
            // A conjugate picture's conjugate is the picture.
            Plant::Inverted | Plant::Conjugate(_) => 4,
            Plant::ZeroOrder(_) => 5,
            Plant::Ghost { .. } => 6,
            Plant::Distance(_) => 7,
            Plant::Order(_) => 8,
            Plant::Saturated(_) => 9,
        };
        family(self) != family(other)
    }
}

/// The hologram of a bench and photographs of it.
pub(crate) struct Taken {
    /// The levels of the hologram, (C, H, W).
    pub levels: Array3<u8>,
    pub target: Target,
    /// A photograph for each laser.
    pub photographs: Vec<Photograph>,
}

/// Returns levels, (C, H, W), of the bench's picture.
pub(crate) fn hologram(bench: &Bench, target: &Target) -> Array3<u8> {
    let display = &target.display;
    let size @ Size { width, height } = display.size();
    let picture = (bench.picture)(size);
    let colours = display.colours();
    const LAYERS: usize = 5;
    let mut field = Array3::<Complex32>::zeros((colours, height, width));
    for layer in 0..LAYERS {
        let z_m = display.volume_depth_m() * ((layer as f64 + 0.5) / LAYERS as f64 - 0.5);
        for colour in 0..colours {
            let wavelength_m = display.wavelengths_m()[colour];
            let plan = Propagator::new(size, display.pitch_m(), wavelength_m, -z_m, Padding::Reach).unwrap();
            let from = if colours == 1 { 1 } else { colour };
            let mut plane: Vec<_> = (0..width * height)
                .map(|at| {
                    let at = (at / width, at % width);
                    let there = ((picture.near[at] * LAYERS as f32) as usize).min(LAYERS - 1) == layer;
                    Complex32::from(if there {
                        picture.amplitude[(from, at.0, at.1)]
                    } else {
                        0.0
                    })
                })
                .collect();
            plan.propagate(&mut plane, &mut plan.scratch());
            let mut to = field.index_axis_mut(Axis(0), colour);
            to.iter_mut().zip(plane).for_each(|(to, from)| *to += from);
        }
    }
    let options = EncoderOptions {
        brightness: Brightness::Fixed(1.0),
        ..Encoding::ANTI_ALIAS.into()
    };
    let plan = DisplayPlan::from_z(size, 0.0, target, &options).unwrap();
    let mut scratch = plan.scratch();
    let mut phases = vec![0.0; field.len()];
    let values = field.as_slice_mut().unwrap();
    plan.propagate(values, &mut scratch);
    plan.phases(None, values, &mut phases, &mut scratch);
    let levels = phases
        .iter()
        .enumerate()
        .map(|(at, phase)| target.response.level(*phase, at));
    Array3::from_shape_vec((colours, height, width), levels.collect()).unwrap()
}

/// Returns what a link makes of `levels`.
fn sent(levels: &Array3<u8>, plants: &[Plant]) -> Array3<u8> {
    let mut levels = levels.mapv(f64::from);
    let (colours, height, width) = levels.dim();
    for plant in plants {
        let old = levels.clone();
        let at = |c: usize, y: isize, x: isize| {
            old[(
                c,
                y.clamp(0, height as isize - 1) as usize,
                x.clamp(0, width as isize - 1) as usize,
            )]
        };
        let mut change = |value: &dyn Fn(usize, usize, usize) -> f64| {
            levels = Array3::from_shape_fn((colours, height, width), |(c, y, x)| {
                value(c, y, x).round().clamp(0.0, 255.0)
            });
        };
        match *plant {
            Plant::MirrorX => change(&|c, y, x| old[(c, y, width - 1 - x)]),
            Plant::MirrorY => change(&|c, y, x| old[(c, height - 1 - y, x)]),
            Plant::Rotated180 => change(&|c, y, x| old[(c, height - 1 - y, width - 1 - x)]),
            Plant::Order(order) => change(&|c, y, x| old[(order[c], y, x)]),
            Plant::LinkBlur([h, v]) => change(&|c, y, x| {
                let (y, x) = (y as isize, x as isize);
                let row = |y: isize| at(c, y, x) * (1.0 - 2.0 * h) + h * (at(c, y, x - 1) + at(c, y, x + 1));
                row(y) * (1.0 - 2.0 * v) + v * (row(y - 1) + row(y + 1))
            }),
            Plant::LinkScaled(zoom) => change(&|c, y, x| {
                let place = |at: usize, n: usize| (at as f64 + 0.5 - n as f64 / 2.0) / zoom + n as f64 / 2.0 - 0.5;
                let (v, u) = (place(y, height), place(x, width));
                if v < -0.5 || u < -0.5 || v > height as f64 - 0.5 || u > width as f64 - 0.5 {
                    return 0.0;
                }
                let (y0, x0) = (v.floor(), u.floor());
                let row = |y: f64| {
                    at(c, y as isize, x0 as isize) * (1.0 - u + x0) + at(c, y as isize, x0 as isize + 1) * (u - x0)
                };
                row(y0) * (1.0 - v + y0) + row(y0 + 1.0) * (v - y0)
            }),
            Plant::Tone(gamma) => change(&|c, y, x| 255.0 * (old[(c, y, x)] / 255.0).powf(gamma)),
            Plant::Chroma { wide, high } => {
                let luma = |y: usize, x: usize| {
                    (0.2126 * old[(0, y, x)] + 0.7152 * old[(1, y, x)] + 0.0722 * old[(2, y, x)]).round()
                };
                let shared = |of: usize, over: f64, y: usize, x: usize| {
                    let mut sum = 0.0;
                    for v in 0..high {
                        for u in 0..wide {
                            let v = (y / high * high + v).min(height - 1);
                            let u = (x / wide * wide + u).min(width - 1);
                            sum += (old[(of, v, u)] - luma(v, u)) / over;
                        }
                    }
                    (sum / (wide * high) as f64).round()
                };
                change(&|c, y, x| {
                    let (cb, cr) = (shared(2, 1.8556, y, x), shared(0, 1.5748, y, x));
                    luma(y, x) + [1.5748 * cr, -0.1873 * cb - 0.4681 * cr, 1.8556 * cb][c]
                });
            }
            _ => (),
        }
    }
    levels.mapv(|level| level as u8)
}

fn turned_by_90(photograph: &Photograph) -> Photograph {
    let (height, width) = (photograph.width, photograph.height);
    let value = |at: usize| photograph.values[(at % width) * photograph.width + (height - 1 - at / width)];
    Photograph {
        height,
        width,
        values: (0..height * width).map(value).collect(),
        full: photograph.full,
    }
}

/// Returns the camera of a bench. It is turned and sees the panel in perspective.
fn camera(bench: &Bench, dice: &mut Dice) -> Camera {
    let Size { width, height } = bench.display.size();
    let (w, h) = (width as f64 * bench.zoom, height as f64 * bench.zoom);
    let border = 0.16 * w;
    let centre = [
        w / 2.0 + border + dice.range(-0.05, 0.05) * w,
        h / 2.0 + border + dice.range(-0.05, 0.05) * w,
    ];
    let (sin, cos) = bench.turn_deg.to_radians().sin_cos();
    let corners = [[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5]].map(|[x, y]| {
        let (x, y) = (x * w, y * h);
        let error = bench.askew * w;
        [
            centre[0] + x * cos - y * sin + dice.range(-error, error),
            centre[1] + x * sin + y * cos + dice.range(-error, error),
        ]
    });
    Camera {
        size: Size {
            width: (w + 2.0 * border) as usize,
            height: (h + 2.0 * border) as usize,
        },
        corners,
        exposure: 1.0,
        full_well: bench.full_well,
        read_noise: bench.read_noise,
        stray: dice.range(1e-4, 2e-3),
        bits: bench.bits,
    }
}

/// Photographs the bench's hologram with `plants`, on a display that is good but for them. `shot` seeds what is random.
pub(crate) fn taken(bench: &Bench, plants: &[Plant], shot: u64) -> Taken {
    let target = Target::from(&bench.display);
    let levels = hologram(bench, &target);
    let mut dice = Dice::new(bench.seed ^ shot.wrapping_mul(0x5851_f42d_4c95_7f2d));
    let colours = bench.display.colours();
    let mut range = 255.0 / 256.0 * (1.0 + dice.range(-0.01, 0.01));
    let mut strays = Strays::default();
    let (mut z_m, mut fills) = (bench.z_m, bench.exposure);
    let mut phase = |share: f64| -> Vec<Complex64> {
        let amplitude = (share / (1.0 - share)).sqrt();
        (0..colours)
            .map(|_| Complex64::from_polar(amplitude, dice.range(0.0, TAU)))
            .collect()
    };
    // Good panels leave some light unmodulated too.
    strays.undiffracted = phase(0.002);
    for plant in plants {
        match *plant {
            Plant::ZeroOrder(share) => strays.undiffracted = phase(share),
            Plant::Conjugate(share) => strays.conjugate = phase(share),
            Plant::Ghost {
                share,
                shift_px,
                path_m,
            } => {
                (strays.ghost, strays.ghost_shift_px, strays.ghost_path_m) = (phase(share), shift_px, path_m);
            }
            Plant::Range(by) => range *= by,
            Plant::Inverted => range = -range,
            Plant::Distance(depths) => z_m += depths * depth_of_focus(&bench.display),
            Plant::Saturated(by) => fills = by,
            _ => (),
        }
    }
    let curves = Curves {
        range: vec![range; colours],
        unevenness: 0.02,
        steepness: 0.02,
        bend: 0.0,
    };
    let aberration = Aberration::new(vec![[0; 5].map(|_| dice.range(-0.08, 0.08)); colours]).unwrap();
    let display = SimulatedDisplay::new(&bench.display, bench.zoom, bench.seed ^ shot)
        .unwrap()
        .with_curves(curves)
        .with_aberration(aberration)
        .with_strays(strays);
    let arriving = sent(&levels, plants);
    let camera = camera(bench, &mut dice);
    let photographs = (0..colours).map(|colour| {
        let levels = arriving.index_axis(Axis(0), colour);
        let mut light: Vec<f32> = display.intensity(levels, colour, z_m).unwrap().into_iter().collect();
        let bright = light.len() * 999 / 1000;
        let brightest = *light.select_nth_unstable_by(bright, f32::total_cmp).1;
        let camera = Camera {
            exposure: fills / f64::from(brightest),
            ..camera.clone()
        };
        let photo = display
            .clone()
            .with_camera(camera)
            .photograph(levels, colour, z_m, shot)
            .unwrap();
        if plants.contains(&Plant::Rotated90) {
            turned_by_90(&photo)
        } else {
            photo
        }
    });
    Taken {
        photographs: photographs.collect(),
        levels,
        target,
    }
}

/// Returns the distance over which the finest detail stays sharp, in metres.
pub(crate) fn depth_of_focus(display: &Display) -> f64 {
    (2.0 * display.pitch_m() / display.aperture_radius()).powi(2) / display.longest_wavelength_m()
}

/// Returns a disc's share of a pixel.
pub(crate) fn soft(distance: f64) -> f64 {
    0.5 - (distance.clamp(-1.0, 1.0) * PI / 2.0).sin() / 2.0
}

/// Photographs what is planted and diagnoses it. `shot` seeds the camera's noise.
pub(crate) fn diagnosed(bench: &Bench, plants: &[Plant], shot: u64) -> Result<Diagnosis, String> {
    let taken = taken(bench, plants, shot);
    let shown = Shown {
        levels: Levels::Bytes(taken.levels.as_slice().unwrap()),
        size: bench.display.size(),
        target: &taken.target,
        z_m: bench.z_m,
    };
    diagnose(&shown, &taken.photographs).map_err(|e| e.to_string())
}

/// Returns the causes that were found, or why there is no diagnosis.
pub(crate) fn names(diagnosis: &Result<Diagnosis, String>) -> Vec<&str> {
    match diagnosis {
        Ok(diagnosis) => diagnosis.findings.iter().map(|finding| finding.cause).collect(),
        Err(why) => vec![why],
    }
}
