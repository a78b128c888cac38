//! A complete calibration of a simulated display, compared with the true values that only a simulation knows.

pub mod learned;

use self::learned::Learned;
use crate::camera::marks;
use crate::camera::pattern::{PATTERNS, Pattern};
use crate::camera::photograph::Photograph;
use crate::colours;
use crate::curves::chart::{self, Curve, Map, Panel};
use crate::curves::curve::LEVELS;
use crate::curves::lut::{self, Refusal};
use crate::curves::report::{self, LutReport};
use crate::optics::laser;
use crate::optics::spot::{self, MIDDLE, Search, TRIALS};
use crate::simulated_display::SimulatedDisplay;
use ndarray::{Array2, Array3, Axis, s, stack};
use num_complex::Complex32;
use phasefront::Size;
use phasefront::target::{Aberration, Response};
use phasefront::{Brightness, Display, EncoderOptions, Encoding, Target};
use phasefront_core::display::levels::LevelsMut;
use phasefront_core::optics::zernike::Coefficients;
use phasefront_core::pipeline::display_plan::DisplayPlan;
use phasefront_io::dice::Dice;
use phasefront_io::display;
use phasefront_io::display::calibration::{self, Entry};
use phasefront_io::{Error, Result, output};
use serde::Serialize;
use std::f64::consts::TAU;
use std::io::Write;
use std::path::{Path, PathBuf};

/// The level that makes marks dark on a display with faults.
const FAULTY_DARK: u8 = 140;

/// The settings of a rehearsal.
#[derive(Debug, Clone)]
pub struct Rehearsal {
    /// The display's physical parameters.
    pub display: Display,
    /// The number of camera pixels per modulator pixel.
    pub zoom: f64,
    /// The seed of the display's flaws and the camera's noise.
    pub seed: u64,
    /// The z of the focused spot, in metres.
    pub spot_z_m: f64,
    /// Whether all photographs of the patterns are kept.
    pub keep_captures: bool,
    /// The numbers of photographs from which a model of a display with faults is learned, in ascending order; none for
    /// a display without faults. The display must have one laser.
    pub learn: Vec<usize>,
}

/// A value for each colour, before and after calibration.
#[derive(Debug, Clone, Default, Serialize)]
pub struct BeforeAfter {
    /// The values with the factory's linear table and no correction.
    pub before: Vec<f64>,
    /// The values with the calibration.
    pub after: Vec<f64>,
}

/// The results of a rehearsal, measured against the simulation's true values.
#[derive(Debug, Clone, Serialize)]
pub struct Outcome {
    /// The measured curves and their table.
    pub lut: LutReport,
    /// The RMS phase error over all pixels and reachable phases, in radians.
    pub phase_error_rad: BeforeAfter,
    /// The light of double-phase black relative to white (Fig. 11), in dB.
    pub black_db: BeforeAfter,
    /// The variation of the light of a flat grey over the frame: its standard deviation divided by its mean.
    pub unevenness: BeforeAfter,
    /// The Strehl ratio of the focused spot.
    pub strehl: BeforeAfter,
    /// The coefficients of the perfect correction, in radians.
    pub true_coefficients: Vec<Coefficients>,
    /// The coefficients that the search found.
    pub found_coefficients: Vec<Coefficients>,
    /// The number of photographs taken.
    pub photographs: usize,
    /// The PSNR of unseen holograms for each of [`learned::JUDGED`], in dB, calibrated without a learned model.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub psnr_db: Vec<f64>,
    /// What the learned models are worth.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub learned: Vec<Learned>,
}

/// Calibrates a simulated display. Writes the four calibration files, `outcome.json`, pictures and charts to `folder`.
/// `progress` receives the number of photographs and rows done, and their total.
///
/// # Errors
/// Returns an error if the display is too small for marks, if its sub-hologram does not fit, or if a file cannot be
/// written.
pub fn run(rehearsal: &Rehearsal, folder: &Path, progress: &dyn Fn(usize, usize)) -> Result<Outcome> {
    let display = &rehearsal.display;
    let stage = Stage {
        rehearsal,
        folder,
        pattern: match rehearsal.learn[..] {
            [] => Pattern::new(display.size())?,
            // Crosstalk brightens the marks, and takes more phase to make them dark.
            _ => Pattern::new(display.size())?.with_dark(FAULTY_DARK),
        },
        simulated: match rehearsal.learn[..] {
            [] => SimulatedDisplay::new(display, rehearsal.zoom, rehearsal.seed)?,
            _ => SimulatedDisplay::new(display, rehearsal.zoom, rehearsal.seed)?.with_faults(),
        },
        progress,
    };
    // The search for aberrations comes last and would otherwise fail only there.
    for colour in 0..display.colours() {
        spot::levels(&Target::from(display), colour, rehearsal.spot_z_m, MIDDLE, &[0.0; 5])?;
    }
    output::make_folder(folder)?;
    let curves = stage.curves()?;
    let per_pixel = lut::compact(&curves)?;
    calibration::write_per_pixel(&folder.join("table.pfp"), &per_pixel)?;
    report::draw(&curves, folder)?;
    let lut = report::report(&curves, &per_pixel);
    let calibrated = Response::PerPixel(per_pixel.into());
    let laser_map = stage.laser_map()?;
    let aberrations = stage.aberrations(&calibrated)?;
    write_display(&folder.join("display.toml"), display, "")?;

    let worth = stage.worth(&calibrated)?;
    stage.pictures(&calibrated, &laser_map, &aberrations.spots)?;
    let (psnr_db, learned) = stage.learned(&aberrations)?;
    let Aberrations { truth, found, .. } = aberrations;
    let outcome = Outcome {
        lut,
        phase_error_rad: worth.phase_error_rad,
        black_db: worth.black_db,
        unevenness: worth.unevenness,
        strehl: BeforeAfter {
            before: truth.iter().map(spot::strehl).collect(),
            after: truth
                .iter()
                .zip(&found)
                .map(|(a, b)| spot::strehl(&apart(a, b)))
                .collect(),
        },
        true_coefficients: truth,
        found_coefficients: found,
        photographs: display.colours() * (PATTERNS + 1) + aberrations.photographs,
        psnr_db,
        learned,
    };
    let path = folder.join("outcome.json");
    let text = serde_json::to_string_pretty(&outcome).map_err(|e| Error::file(&path, e))?;
    output::write_atomically(&path, |file| writeln!(file, "{text}"))?;
    Ok(outcome)
}

/// The settings, the output folder and the progress callback of a run.
struct Stage<'a> {
    rehearsal: &'a Rehearsal,
    folder: &'a Path,
    pattern: Pattern,
    simulated: SimulatedDisplay,
    progress: &'a dyn Fn(usize, usize),
}

/// The result of the search for aberrations.
struct Aberrations {
    truth: Vec<Coefficients>,
    found: Vec<Coefficients>,
    /// The spot of [`Stage::middle`] without a correction and with the one found.
    spots: [Photograph; 2],
    photographs: usize,
}

/// The quality of a calibration, measured against the simulation's true values.
struct Worth {
    phase_error_rad: BeforeAfter,
    black_db: BeforeAfter,
    unevenness: BeforeAfter,
}

impl Stage<'_> {
    /// Returns the names of the colours.
    fn colours(&self) -> &'static [&'static str] {
        colours(&self.rehearsal.display)
    }

    /// Returns the colour that pictures are of: green, or the only one.
    fn middle(&self) -> usize {
        self.colours().len() / 2
    }

    /// Returns the number of photographs and rows before the search for aberrations, and in total.
    fn work(&self) -> [usize; 2] {
        let colours = self.colours().len();
        let before = colours * (PATTERNS + self.rehearsal.display.size().height);
        [before, before + colours * spot::ROUNDS * TRIALS]
    }

    /// Returns the folder for the photographs of a colour, if they are kept.
    fn captures(&self, colour: usize) -> Option<PathBuf> {
        let kept = self.rehearsal.keep_captures;
        kept.then(|| self.folder.join("captures").join(self.colours()[colour]))
    }

    /// Measures the curves from 256 photographs per colour, focused on the modulator.
    fn curves(&self) -> Result<Vec<lut::Curves>> {
        let modulator_z_m = self.rehearsal.display.offset_m();
        let [_, work] = self.work();
        let mut curves = Vec::new();
        for (colour, name) in self.colours().iter().enumerate() {
            let captures = self.captures(colour);
            captures.as_deref().map_or(Ok(()), output::make_folder)?;
            let shoot = |k: usize| -> Result<Photograph> {
                let frame = self.pattern.frame(k as u8);
                let frame = frame.view();
                let photo = (self.simulated).photograph(frame, colour, modulator_z_m, k as u64)?;
                if let Some(captures) = &captures {
                    photo.write(&captures.join(format!("capture_{k:03}.png")))?;
                }
                Ok(photo)
            };
            let source = |k: usize| shoot(k).map_err(|e| lut::What::Unreadable(e.to_string()));
            let done = |n: usize, of: usize| (self.progress)(colour * of + n, work);
            let measured = lut::measure(&self.pattern, name, &source, self.folder, &done);
            curves.push(measured.map_err(|refusal| match refusal {
                Refusal::Other(e) => e,
                Refusal::Problems(all) => Error::Input(all.first().map_or_else(String::new, ToString::to_string)),
            })?);
        }
        Ok(curves)
    }

    /// Measures the laser's amplitude from one photograph of a diffuser per colour.
    fn laser_map(&self) -> Result<Array3<f32>> {
        let display = &self.rehearsal.display;
        let size = display.size();
        let frame = self.pattern.frame(0);
        let mut maps = Vec::new();
        for colour in 0..self.colours().len() {
            let marked = (self.simulated).photograph(frame.view(), colour, display.offset_m(), 0)?;
            let registration = marks::register(&marked, &self.pattern)?;
            let photo = self.simulated.photograph_diffuser(colour, 1 << 20)?;
            if let Some(captures) = self.captures(colour) {
                photo.write(&captures.join("diffuser.png"))?;
            }
            maps.push(laser::mixture(&laser::map(&photo, &registration, size)?, 1)?.0);
        }
        let views: Vec<_> = maps.iter().map(|map| map.view()).collect();
        let map = stack(Axis(0), &views).map_err(|e| Error::Input(e.to_string()))?;
        calibration::write_laser(&self.folder.join("laser.png"), map.view())?;
        Ok(map)
    }

    /// Searches for aberrations with a focused spot. The simulated lens has the same optical path for all colours, so
    /// its phase is proportional to 1/λ.
    fn aberrations(&self, calibrated: &Response) -> Result<Aberrations> {
        let Rehearsal {
            display, spot_z_m: z_m, ..
        } = self.rehearsal;
        let mut dice = Dice::new(self.rehearsal.seed ^ 0xab);
        let middle: Coefficients = std::array::from_fn(|_| dice.range(-1.1, 1.1));
        let wavelengths = display.wavelengths_m();
        let middle_m = wavelengths[self.middle()];
        let truth: Vec<Coefficients> = (wavelengths.iter())
            .map(|wavelength_m| middle.map(|a| a * middle_m / wavelength_m))
            .collect();
        let aberrated = (self.simulated.clone()).with_aberration(Aberration::new(truth.clone())?);
        let target = Target {
            response: calibrated.clone(),
            ..Target::from(display)
        };
        let (mut found, mut photographs) = (Vec::new(), 0);
        let (mut tried, mut spots) = (Vec::new(), Vec::new());
        for (colour, name) in self.colours().iter().enumerate() {
            let mut camera = aberrated.camera().clone();
            camera.exposure = spot::exposure(display, colour, *z_m);
            let before_lens = aberrated.clone().with_camera(camera);
            let shoot = |a: &Coefficients, shot: usize| -> Result<Photograph> {
                let levels = spot::levels(&target, colour, *z_m, MIDDLE, a)?;
                before_lens.photograph(levels.view(), colour, *z_m, (1 << 21) + shot as u64)
            };
            let (search, points) = self.search(colour, &truth[colour], &shoot)?;
            photographs += search.round * TRIALS;
            found.push(search.best);
            tried.push(Curve {
                name: (*name).into(),
                points,
                dots: false,
            });
            if colour == self.middle() {
                spots = vec![shoot(&[0.0; 5], 9000)?, shoot(&search.best, 9001)?];
            }
        }
        self.write_aberrations(&found, tried)?;
        Ok(Aberrations {
            truth,
            found,
            spots: (spots.try_into()).map_err(|_| Error::Input("two spots".into()))?,
            photographs,
        })
    }

    /// Runs one colour's search to its end and records the Strehl ratio after each round.
    fn search(
        &self,
        colour: usize,
        truth: &Coefficients,
        shoot: &dyn Fn(&Coefficients, usize) -> Result<Photograph>,
    ) -> Result<(Search, Vec<(f64, f64)>)> {
        let [before, work] = self.work();
        let mut search = Search::from([0.0; 5]);
        let mut history = vec![(0.0, spot::strehl(truth))];
        while !search.is_done() {
            let mut sharp = [0.0; TRIALS];
            for (i, trial) in search.trials().iter().enumerate() {
                let photo = shoot(trial, search.round * TRIALS + i)?;
                sharp[i] = spot::sharpness(&photo, spot::window(self.rehearsal.zoom))?;
            }
            search = search.learn(&sharp);
            let left = apart(truth, &search.best);
            history.push((search.round as f64, spot::strehl(&left)));
            let rounds = colour * spot::ROUNDS + search.round;
            (self.progress)(before + rounds * TRIALS, work);
        }
        Ok((search, history))
    }

    fn write_aberrations(&self, found: &[Coefficients], tried: Vec<Curve>) -> Result<()> {
        let mut entry = Entry::flat(self.rehearsal.spot_z_m * 1e3, None, self.colours().len());
        for (colour, found) in found.iter().enumerate() {
            *entry.colour_mut(colour) = *found;
        }
        calibration::write_aberrations(&self.folder.join("aberration.toml"), &[entry])?;
        let panel = Panel {
            title: "Strehl ratio of the search".into(),
            x: "round",
            y: "Strehl ratio",
            curves: tried,
        };
        chart::write_curves(&self.folder.join("search.svg"), &[panel], 1)
    }

    fn worth(&self, calibrated: &Response) -> Result<Worth> {
        let simulated = &self.simulated;
        let display = &self.rehearsal.display;
        let factory = Response::linear(display.bits())?;
        let file = display::read_display(&self.folder.join("display.toml"))?;
        let bare = Target::from(display);
        let both = |f: &dyn Fn(&Response, usize) -> Result<f64>| -> Result<BeforeAfter> {
            let mut all = BeforeAfter::default();
            for colour in 0..self.colours().len() {
                all.before.push(f(&factory, colour)?);
                all.after.push(f(calibrated, colour)?);
            }
            Ok(all)
        };
        let mut unevenness = BeforeAfter::default();
        for colour in 0..self.colours().len() {
            unevenness.before.push(flat_grey(simulated, &bare, colour)?);
            unevenness.after.push(flat_grey(simulated, &file.target, colour)?);
        }
        Ok(Worth {
            phase_error_rad: both(&|response, c| Ok(phase_error(simulated, response, c)))?,
            black_db: both(&|response, c| black_level(simulated, response, c))?,
            unevenness,
        })
    }

    /// Learns a model from each number of photographs, and returns what is displayed without a model and with them.
    /// Writes the last model.
    fn learned(&self, aberrations: &Aberrations) -> Result<(Vec<f64>, Vec<Learned>)> {
        if self.rehearsal.learn.is_empty() {
            return Ok((vec![], vec![]));
        }
        let path = self.folder.join("display.toml");
        let simulated = (self.simulated.clone()).with_aberration(Aberration::new(aberrations.truth.clone())?);
        let target = display::read_display(&path)?.corrected()?;
        let without = learned::judge(&simulated, &target, 0)?;
        let mut all = Vec::new();
        for count in &self.rehearsal.learn {
            let samples = learned::photographs(&simulated, &target, 0, *count)?;
            let (target, learned) = learned::learn(&simulated, &target, &samples)?;
            if let Some(model) = &target.model {
                calibration::write_model(&self.folder.join("model.pfm"), model)?;
            }
            all.push(learned);
        }
        write_display(&path, &self.rehearsal.display, "model = \"model.pfm\"\n")?;
        Ok((without, all))
    }

    fn pictures(&self, calibrated: &Response, laser_map: &Array3<f32>, spots: &[Photograph; 2]) -> Result<()> {
        let (folder, display) = (self.folder, &self.rehearsal.display);
        let side = (24.0 * self.rehearsal.zoom) as usize;
        let cropped = spots.each_ref().map(|photo| crop(photo, side));
        write_pair(&folder.join("spot.png"), &cropped)?;
        draw_laser(folder, &self.simulated, laser_map)?;
        let factory = Response::linear(display.bits())?;
        black_pictures(&self.simulated, &factory, calibrated, folder)?;
        for k in [0usize, 128] {
            let frame = self.pattern.frame(k as u8);
            let photo = (self.simulated).photograph(frame.view(), self.middle(), display.offset_m(), k as u64)?;
            photo.write(&folder.join(format!("capture_{k:03}.png")))?;
        }
        Ok(())
    }
}

fn apart(a: &Coefficients, b: &Coefficients) -> Coefficients {
    std::array::from_fn(|i| a[i] - b[i])
}

/// Writes the display file, which refers to the others, with `more` lines.
fn write_display(path: &Path, display: &Display, more: &str) -> Result<()> {
    // JSON and TOML have the same syntax for numbers and for lists of them.
    let values = serde_json::to_value(display).map_err(|e| Error::file(path, e))?;
    let mut text = String::new();
    for (key, value) in values.as_object().into_iter().flatten() {
        text.push_str(&format!("{key} = {value}\n"));
    }
    text.push_str("per_pixel = \"table.pfp\"\nlaser = \"laser.png\"\naberration = \"aberration.toml\"\n");
    text.push_str(more);
    output::write_atomically(path, |file| file.write_all(text.as_bytes()))
}

/// Computes the RMS phase error of `response` over all reachable phases, according to the true curves.
pub fn phase_error(simulated: &SimulatedDisplay, response: &Response, colour: usize) -> f64 {
    let Size { width: w, height: h } = simulated.display().size();
    let (mut square, mut count) = (0.0, 0.0);
    for y in 0..h {
        for x in 0..w {
            let curve: [f64; LEVELS] = std::array::from_fn(|level| simulated.phase(colour, y, x, level as f64));
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

/// Returns the levels, (H, W), of a double phase of `half` and −`half`.
fn checkerboard(simulated: &SimulatedDisplay, response: &Response, colour: usize, half: f32) -> Array2<u8> {
    let Size { width: w, height: h } = simulated.display().size();
    Array2::from_shape_fn((h, w), |(y, x)| {
        let phase = if (x + y) % 2 == 0 {
            half
        } else {
            std::f32::consts::TAU - half
        };
        response.level(phase, (colour * h + y) * w + x)
    })
}

/// Returns the light of double-phase black relative to white, away from the border, in dB (Fig. 11).
///
/// # Errors
/// Never returns an error for a simulated display.
pub fn black_level(simulated: &SimulatedDisplay, response: &Response, colour: usize) -> Result<f64> {
    let z_m = simulated.display().offset_m();
    let mean = |half: f32| -> Result<f64> {
        let levels = checkerboard(simulated, response, colour, half);
        let light = simulated.intensity(levels.view(), colour, z_m)?;
        let (h, w) = light.dim();
        let inner = light.slice(s![16.min(h / 4)..h - 16.min(h / 4), 16.min(w / 4)..w - 16.min(w / 4)]);
        Ok(f64::from(inner.mean().unwrap_or(0.0)))
    };
    // A phase of exactly 0 would become 2π in one of the halves.
    Ok(10.0 * (mean(std::f32::consts::FRAC_PI_2)? / mean(1e-3)?).log10())
}

/// Creates photographs of black side by side, with the factory's table and with the calibrated one, ten times as bright
/// as white is displayed.
fn black_pictures(
    simulated: &SimulatedDisplay,
    factory: &Response,
    calibrated: &Response,
    folder: &Path,
) -> Result<()> {
    let mut camera = simulated.camera().clone();
    camera.exposure *= 10.0;
    let bright = simulated.clone().with_camera(camera);
    let (z_m, middle) = (simulated.display().offset_m(), simulated.display().colours() / 2);
    let photos: Result<Vec<_>> = [factory, calibrated]
        .into_iter()
        .map(|response| {
            let levels = checkerboard(simulated, response, middle, std::f32::consts::FRAC_PI_2);
            bright.photograph(levels.view(), middle, z_m, 1 << 22)
        })
        .collect();
    write_pair(&folder.join("black.png"), &photos?)
}

/// Returns the variation of the light of a flat half grey over the frame, away from the border: its standard deviation
/// divided by its mean.
fn flat_grey(simulated: &SimulatedDisplay, target: &Target, colour: usize) -> Result<f64> {
    let size @ Size { width: w, height: h } = simulated.display().size();
    // Where the laser is weakest, the modulator must be able to compensate.
    let options = EncoderOptions {
        brightness: Brightness::Fixed(1.0),
        ..Encoding::DoublePhase.into()
    };
    let plan = DisplayPlan::new(size, target, &options)?;
    let colours = target.display.colours();
    let mut field = Array3::from_elem((colours, h, w), Complex32::new(0.4, 0.0));
    let mut levels = Array3::zeros((colours, h, w));
    plan.modulate(
        None,
        field.as_slice_mut().expect("standard layout"),
        LevelsMut::Bytes(levels.as_slice_mut().expect("standard layout")),
        &mut plan.scratch(),
    );
    let plane = levels.index_axis(Axis(0), colour);
    let light = simulated.intensity(plane, colour, simulated.display().offset_m())?;
    let (h, w) = light.dim();
    let inner = light.slice(s![h / 8..h - h / 8, w / 8..w - w / 8]).mapv(f64::from);
    Ok(inner.std(0.0) / inner.mean().unwrap_or(1.0))
}

/// Draws the laser's map and its error.
fn draw_laser(folder: &Path, simulated: &SimulatedDisplay, map: &Array3<f32>) -> Result<()> {
    let (_, rows, columns) = map.dim();
    let names = colours(simulated.display());
    let Size { width: w, height: h } = simulated.display().size();
    let maps: Vec<Map> = (0..names.len())
        .flat_map(|colour| {
            let found = map.index_axis(Axis(0), colour).to_owned();
            let truth = Array2::from_shape_fn((rows, columns), |(i, j)| {
                let at = |node: usize, n: usize, nodes: usize| node as f64 * (n - 1) as f64 / (nodes - 1) as f64;
                simulated.laser(colour, at(i, h, rows), at(j, w, columns)) as f32
            });
            let most = |a: &Array2<f32>| a.iter().copied().fold(0.0, f32::max);
            let off = &found / most(&found) - &truth / most(&truth);
            [
                Map {
                    title: format!("{}: laser amplitude", names[colour]),
                    values: found,
                },
                Map {
                    title: format!("{}: off the truth", names[colour]),
                    values: off,
                },
            ]
        })
        .collect();
    let (amplitudes, off): (Vec<_>, Vec<_>) = maps.into_iter().enumerate().partition(|(i, _)| i % 2 == 0);
    let all: Vec<Map> = amplitudes.into_iter().chain(off).map(|(_, map)| map).collect();
    chart::write_maps(&folder.join("laser.svg"), &all, names.len())
}

/// Returns the middle of a photograph.
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

/// Writes two photographs of the same size side by side.
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
