//! A calibration from beginning to end on a simulated display, with what only a simulation knows: how far what was
//! found is from the truth.

use super::chart::{self, Curve, Map, Panel};
use super::curve::LEVELS;
use super::lut::{self, Refusal};
use super::marks;
use super::pattern::{PATTERNS, Pattern};
use super::photograph::Photograph;
use super::report::{self, LutReport};
use super::spot::{self, MIDDLE, Search, TRIALS};
use super::table::{self, Entry};
use super::{COLOURS, laser};
use crate::error::{Error, Result};
use crate::files;
use crate::scene::dice::Dice;
use crate::simulated_display::SimulatedDisplay;
use ndarray::{Array2, Array3, Axis, s, stack};
use num_complex::Complex32;
use phasefront::target::{Aberration, Response};
use phasefront::unstable::modulator::Modulator;
use phasefront::unstable::wave::zernike::Coefficients;
use phasefront::{Brightness, Display, EncoderOptions, Encoding, Target};
use serde::Serialize;
use std::f64::consts::TAU;
use std::io::Write;
use std::path::Path;

/// What is rehearsed.
#[derive(Debug, Clone)]
pub struct Rehearsal {
    /// The display's physics.
    pub display: Display,
    /// Pixels of the camera for one of the modulator.
    pub zoom: f64,
    /// Seed of the display's flaws and the camera's noise.
    pub seed: u64,
    /// z of the focused spot, metres.
    pub spot_z_m: f64,
    /// Whether all photographs of the patterns are kept.
    pub keep_captures: bool,
}

/// Three colours' number before a calibration and after it.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct BeforeAfter {
    /// With the factory's linear table and no correction.
    pub before: [f64; 3],
    /// With what was calibrated.
    pub after: [f64; 3],
}

/// What came of it, by the simulation's own truth.
#[derive(Debug, Clone, Serialize)]
pub struct Outcome {
    /// The measured curves and their table.
    pub lut: LutReport,
    /// Root mean square of the phase error over all pixels and reachable phases, radians.
    pub phase_error_rad: BeforeAfter,
    /// Light of double-phase black against white (Fig. 11), dB.
    pub black_db: BeforeAfter,
    /// Variation of the light of a flat grey over the frame, its standard deviation over its mean.
    pub unevenness: BeforeAfter,
    /// Strehl ratio of the focused spot.
    pub strehl: BeforeAfter,
    /// Coefficients of the correction that would be perfect, radians.
    pub true_coefficients: [Coefficients; 3],
    /// Those that the search found.
    pub found_coefficients: [Coefficients; 3],
    /// Photographs taken.
    pub photographs: usize,
}

/// Calibrates a simulated display into `folder`: the four files of a calibration, `outcome.json`, pictures and drawings.
/// `progress` hears of the photographs and rows done, of all.
///
/// # Errors
/// A display too small for marks or whose sub-hologram does not fit; files that cannot be written.
pub fn run(
    rehearsal: &Rehearsal,
    folder: &Path,
    progress: &dyn Fn(usize, usize),
) -> Result<Outcome> {
    let display = &rehearsal.display;
    let shape @ (height, width) = (display.height(), display.width());
    let pattern = Pattern::new(height, width)?;
    let simulated = SimulatedDisplay::new(display, rehearsal.zoom, rehearsal.seed)?;
    let factory = Response::linear(display.bits())?;
    let rounds = 3 * spot::ROUNDS * TRIALS;
    let work = 3 * (PATTERNS + height) + rounds;
    let mut photographs = 0;

    // Curves: 256 photographs a colour, focused on the modulator.
    let modulator_z_m = display.offset_m();
    let captures = folder.join("captures");
    let mut curves = Vec::new();
    for (colour, name) in COLOURS.iter().enumerate() {
        let captures = captures.join(name);
        if rehearsal.keep_captures {
            make(&captures)?;
        }
        let shoot = |k: usize| -> Result<Photograph> {
            let frame = pattern.frame(k as u8);
            let photo = simulated.photograph(frame.view(), colour, modulator_z_m, k as u64)?;
            if rehearsal.keep_captures {
                photo.write(&captures.join(format!("capture_{k:03}.png")))?;
            }
            Ok(photo)
        };
        let source = |k: usize| shoot(k).map_err(|e| lut::What::Unreadable(e.to_string()));
        let done = |n: usize, of: usize| progress(colour * of + n, work);
        let measured = lut::measure(&pattern, colour, &source, folder, &done);
        curves.push(measured.map_err(|refusal| match refusal {
            Refusal::Other(e) => e,
            Refusal::Problems(all) => {
                Error::Input(all.first().map_or_else(String::new, ToString::to_string))
            }
        })?);
        photographs += PATTERNS;
    }
    let curves: [lut::Curves; 3] = curves
        .try_into()
        .map_err(|_| Error::Input("three colours".into()))?;
    let per_pixel = lut::compact(&curves)?;
    table::write_per_pixel(&folder.join("table.pfp"), &per_pixel)?;
    report::draw(&curves, folder)?;
    let lut_report = report::report(&curves, &per_pixel);
    let calibrated = Response::PerPixel(per_pixel.into());

    // The laser: a photograph of a diffuser a colour.
    let mut maps = Vec::new();
    for (colour, name) in COLOURS.iter().enumerate() {
        let marked = simulated.photograph(pattern.frame(0).view(), colour, modulator_z_m, 0)?;
        let registration = marks::register(&marked, &pattern)?;
        let photo = simulated.photograph_diffuser(colour, 1 << 20)?;
        photographs += 1;
        if rehearsal.keep_captures {
            photo.write(&captures.join(name).join("diffuser.png"))?;
        }
        maps.push(laser::mixture(&laser::map(&photo, &registration, shape)?, 1)?.0);
    }
    let views: Vec<_> = maps.iter().map(|map| map.view()).collect();
    let laser_map = stack(Axis(0), &views).map_err(|e| Error::Input(e.to_string()))?;
    table::write_laser(&folder.join("laser.png"), laser_map.view())?;

    // Aberrations: the same lens for all colours, as path; its phase goes with 1/λ.
    let mut dice = Dice::new(rehearsal.seed ^ 0xab);
    let green: Coefficients = std::array::from_fn(|_| dice.range(-1.1, 1.1));
    let wavelengths = display.wavelengths_m();
    let truth = wavelengths.map(|lambda| green.map(|a| a * wavelengths[1] / lambda));
    let aberrated = simulated.clone().with_aberration(Aberration::new(truth)?);
    let target = Target {
        response: calibrated.clone(),
        ..Target::from(display)
    };
    let mut found = [[0.0; 5]; 3];
    let mut tried = Vec::new();
    let mut spots = Vec::new();
    for colour in 0..3 {
        let mut camera = aberrated.camera().clone();
        camera.exposure = spot::exposure(display, colour, rehearsal.spot_z_m);
        let before_lens = aberrated.clone().with_camera(camera);
        let shoot = |a: &Coefficients, shot: usize| -> Result<Photograph> {
            let z_m = rehearsal.spot_z_m;
            let levels = spot::levels(&target, colour, z_m, MIDDLE, a)?;
            before_lens.photograph(levels.view(), colour, z_m, (1 << 21) + shot as u64)
        };
        let mut search = Search::from([0.0; 5]);
        let mut history = vec![(0.0, spot::strehl(&truth[colour]))];
        while !search.is_done() {
            let mut sharp = [0.0; TRIALS];
            for (i, trial) in search.trials().iter().enumerate() {
                let photo = shoot(trial, search.round * TRIALS + i)?;
                sharp[i] = spot::sharpness(&photo, spot::window(rehearsal.zoom))?;
                photographs += 1;
            }
            search = search.learn(&sharp);
            let left = apart(&truth[colour], &search.best);
            history.push((search.round as f64, spot::strehl(&left)));
            progress(
                3 * (PATTERNS + height) + (colour * spot::ROUNDS + search.round) * TRIALS,
                work,
            );
        }
        found[colour] = search.best;
        tried.push(Curve {
            name: COLOURS[colour].into(),
            points: history,
            dots: false,
        });
        if colour == 1 {
            spots = vec![shoot(&[0.0; 5], 9000)?, shoot(&search.best, 9001)?];
        }
    }
    let entry = Entry {
        z_mm: rehearsal.spot_z_m * 1e3,
        x: None,
        y: None,
        red: found[0],
        green: found[1],
        blue: found[2],
    };
    table::write_aberrations(&folder.join("aberration.toml"), &[entry])?;
    let panel = Panel {
        title: "Strehl ratio of the search".into(),
        x: "round",
        y: "Strehl ratio",
        curves: tried,
    };
    chart::write_curves(&folder.join("search.svg"), &[panel], 1)?;
    write_display(&folder.join("display.toml"), display)?;

    // What it is worth.
    let side = (24.0 * rehearsal.zoom) as usize;
    let cropped: Vec<_> = spots.iter().map(|photo| crop(photo, side)).collect();
    write_pair(&folder.join("spot.png"), &cropped)?;
    draw_laser(folder, &simulated, &laser_map)?;
    let file = files::read_display(&folder.join("display.toml"))?;
    let bare = Target::from(display);
    let both = |f: &dyn Fn(&Response, usize) -> Result<f64>| -> Result<BeforeAfter> {
        let mut all = BeforeAfter::default();
        for colour in 0..3 {
            all.before[colour] = f(&factory, colour)?;
            all.after[colour] = f(&calibrated, colour)?;
        }
        Ok(all)
    };
    let phase_error_rad = both(&|response, c| Ok(phase_error(&simulated, response, c)))?;
    let black_db = both(&|response, c| black_level(&simulated, response, c))?;
    let mut unevenness = BeforeAfter::default();
    for colour in 0..3 {
        unevenness.before[colour] = flat_grey(&simulated, &bare, colour)?;
        unevenness.after[colour] = flat_grey(&simulated, &file.target, colour)?;
    }
    black_pictures(&simulated, &factory, &calibrated, folder)?;
    for k in [0usize, 128] {
        let frame = pattern.frame(k as u8);
        let photo = simulated.photograph(frame.view(), 1, modulator_z_m, k as u64)?;
        photo.write(&folder.join(format!("capture_{k:03}.png")))?;
    }
    let outcome = Outcome {
        lut: lut_report,
        phase_error_rad,
        black_db,
        unevenness,
        strehl: BeforeAfter {
            before: truth.map(|a| spot::strehl(&a)),
            after: std::array::from_fn(|c| spot::strehl(&apart(&truth[c], &found[c]))),
        },
        true_coefficients: truth,
        found_coefficients: found,
        photographs,
    };
    let path = folder.join("outcome.json");
    let text = serde_json::to_string_pretty(&outcome).map_err(|e| Error::file(&path, e))?;
    files::write_atomically(&path, |file| writeln!(file, "{text}"))?;
    Ok(outcome)
}

fn make(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|e| Error::file(folder, format!("cannot be made: {e}")))
}

fn apart(a: &Coefficients, b: &Coefficients) -> Coefficients {
    std::array::from_fn(|i| a[i] - b[i])
}

/// The display's file, which refers to the others.
fn write_display(path: &Path, display: &Display) -> Result<()> {
    // Numbers and lists of them are written alike in JSON and TOML.
    let values = serde_json::to_value(display).map_err(|e| Error::file(path, e))?;
    let mut text = String::new();
    for (key, value) in values.as_object().into_iter().flatten() {
        text.push_str(&format!("{key} = {value}\n"));
    }
    text.push_str(
        "per_pixel = \"table.pfp\"\nlaser = \"laser.png\"\naberration = \"aberration.toml\"\n",
    );
    files::write_atomically(path, |file| file.write_all(text.as_bytes()))
}

/// The root mean square of what `response` leaves of the phases it is asked for where curves reach, by the true curves.
pub fn phase_error(simulated: &SimulatedDisplay, response: &Response, colour: usize) -> f64 {
    let (h, w) = (simulated.display().height(), simulated.display().width());
    let (mut square, mut count) = (0.0, 0.0);
    for y in 0..h {
        for x in 0..w {
            let curve: [f64; LEVELS] =
                std::array::from_fn(|level| simulated.phase(colour, y, x, level as f64));
            for step in 0..64 {
                let phase = f64::from(step) / 64.0 * TAU;
                if phase > curve[LEVELS - 1] {
                    break;
                }
                let level = response.level(phase as f32, (colour * h + y) * w + x);
                let turns = (curve[usize::from(level)] - phase) / TAU;
                square += ((turns - turns.round()) * TAU).powi(2);
                count += 1.0;
            }
        }
    }
    f64::sqrt(square / count)
}

/// Levels, (H, W), of a double phase of `half` and −`half`.
fn checkerboard(
    simulated: &SimulatedDisplay,
    response: &Response,
    colour: usize,
    half: f32,
) -> Array2<u8> {
    let (h, w) = (simulated.display().height(), simulated.display().width());
    Array2::from_shape_fn((h, w), |(y, x)| {
        let phase = if (x + y) % 2 == 0 {
            half
        } else {
            std::f32::consts::TAU - half
        };
        response.level(phase, (colour * h + y) * w + x)
    })
}

/// The light of double-phase black against that of white, away from the rim, dB: Fig. 11.
///
/// # Errors
/// None that a simulated display meets.
pub fn black_level(
    simulated: &SimulatedDisplay,
    response: &Response,
    colour: usize,
) -> Result<f64> {
    let z_m = simulated.display().offset_m();
    let mean = |half: f32| -> Result<f64> {
        let levels = checkerboard(simulated, response, colour, half);
        let light = simulated.intensity(levels.view(), colour, z_m)?;
        let (h, w) = light.dim();
        let inner = light.slice(s![
            16.min(h / 4)..h - 16.min(h / 4),
            16.min(w / 4)..w - 16.min(w / 4)
        ]);
        Ok(f64::from(inner.mean().unwrap_or(0.0)))
    };
    // A phase of 0 exactly would be 2π for the one half.
    Ok(10.0 * (mean(std::f32::consts::FRAC_PI_2)? / mean(1e-3)?).log10())
}

/// Photographs of black side by side, by the factory's table and by the calibrated one, ten times as bright as white is shown.
fn black_pictures(
    simulated: &SimulatedDisplay,
    factory: &Response,
    calibrated: &Response,
    folder: &Path,
) -> Result<()> {
    let mut camera = simulated.camera().clone();
    camera.exposure *= 10.0;
    let bright = simulated.clone().with_camera(camera);
    let z_m = simulated.display().offset_m();
    let photos: Result<Vec<_>> = [factory, calibrated]
        .into_iter()
        .map(|response| {
            let levels = checkerboard(simulated, response, 1, std::f32::consts::FRAC_PI_2);
            bright.photograph(levels.view(), 1, z_m, 1 << 22)
        })
        .collect();
    write_pair(&folder.join("black.png"), &photos?)
}

/// How much the light of a flat half grey differs over the frame, away from the rim: its standard deviation over its mean.
fn flat_grey(simulated: &SimulatedDisplay, target: &Target, colour: usize) -> Result<f64> {
    let shape @ (h, w) = (simulated.display().height(), simulated.display().width());
    // Where the laser is weakest the modulator must be able to make up for it.
    let options = EncoderOptions {
        encoding: Encoding::DoublePhase,
        brightness: Brightness::Fixed(1.0),
    };
    let plan = Modulator::new(shape, target, &options)?;
    let mut field = Array3::from_elem((3, h, w), Complex32::new(0.4, 0.0));
    let mut levels = Array3::zeros((3, h, w));
    plan.modulate(
        field.as_slice_mut().expect("standard layout"),
        levels.as_slice_mut().expect("standard layout"),
        &mut plan.scratch(),
    );
    let plane = levels.index_axis(Axis(0), colour);
    let light = simulated.intensity(plane, colour, simulated.display().offset_m())?;
    let (h, w) = light.dim();
    let inner = light
        .slice(s![h / 8..h - h / 8, w / 8..w - w / 8])
        .mapv(f64::from);
    Ok(inner.std(0.0) / inner.mean().unwrap_or(1.0))
}

/// The laser's map and what it is off the truth.
fn draw_laser(folder: &Path, simulated: &SimulatedDisplay, map: &Array3<f32>) -> Result<()> {
    let (_, rows, columns) = map.dim();
    let (h, w) = (simulated.display().height(), simulated.display().width());
    let maps: Vec<Map> = (0..3)
        .flat_map(|colour| {
            let found = map.index_axis(Axis(0), colour).to_owned();
            let truth = Array2::from_shape_fn((rows, columns), |(i, j)| {
                let at = |node: usize, n: usize, nodes: usize| {
                    node as f64 * (n - 1) as f64 / (nodes - 1) as f64
                };
                simulated.laser(colour, at(i, h, rows), at(j, w, columns)) as f32
            });
            let most = |a: &Array2<f32>| a.iter().copied().fold(0.0, f32::max);
            let off = &found / most(&found) - &truth / most(&truth);
            [
                Map {
                    title: format!("{}: laser amplitude", COLOURS[colour]),
                    values: found,
                },
                Map {
                    title: format!("{}: off the truth", COLOURS[colour]),
                    values: off,
                },
            ]
        })
        .collect();
    let (amplitudes, off): (Vec<_>, Vec<_>) =
        maps.into_iter().enumerate().partition(|(i, _)| i % 2 == 0);
    let all: Vec<Map> = amplitudes
        .into_iter()
        .chain(off)
        .map(|(_, map)| map)
        .collect();
    chart::write_maps(&folder.join("laser.svg"), &all, 3)
}

/// The middle of a photograph.
fn crop(photo: &Photograph, side: usize) -> Photograph {
    let side = side.min(photo.height).min(photo.width);
    let (top, left) = ((photo.height - side) / 2, (photo.width - side) / 2);
    let values = (top..top + side)
        .flat_map(|y| &photo.values[y * photo.width + left..][..side])
        .copied()
        .collect();
    Photograph {
        height: side,
        width: side,
        values,
        full: photo.full,
    }
}

/// Two photographs of one size side by side.
fn write_pair(path: &Path, photos: &[Photograph]) -> Result<()> {
    const GAP: usize = 6;
    let (height, width) = (photos[0].height, photos[0].width);
    let mut values = Vec::with_capacity(height * (2 * width + GAP));
    for y in 0..height {
        for (i, photo) in photos.iter().enumerate() {
            values.extend(std::iter::repeat_n(photo.full, if i > 0 { GAP } else { 0 }));
            values.extend(&photo.values[y * width..][..width]);
        }
    }
    Photograph {
        height,
        width: values.len() / height,
        values,
        full: photos[0].full,
    }
    .write(path)
}
