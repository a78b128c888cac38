//! Measures the quality of holograms on a data set, as in the paper's Table 2. The measures are the amplitude PSNR and
//! SSIM of the midpoint hologram, and their means over a focal stack of each scene's 15 most frequent depths and 5
//! random depths. Any [`Method`] that makes a field can be measured, with the field itself or encoded.
//!
//! An encoded field is measured as an eye sees it: through the modulator's levels and the Fourier aperture. There are
//! two truths: the complex field of the data set, a coherent wave, and what incoherent light shows of the scene through
//! the same aperture ([`Natural`]). Pairs are valid up to their border, so the whole frame counts.

mod ceiling;

use crate::dataset::{self, Manifest};
use crate::evaluate::ceiling::Ceiling;
use crate::sensor::Sensor;
use ndarray::{Array2, Array3, Axis, concatenate, s};
use num_complex::Complex32;
use phasefront::Size;
use phasefront::{Display, EncoderOptions, Encoding, Network, RgbdFrame, Sweep, Target};
use phasefront_core::display::levels::LevelsMut;
use phasefront_core::frame::light_to_srgb;
use phasefront_core::method::MethodPlan;
use phasefront_core::method::mean_phase::remove_mean_phase;
use phasefront_core::method::network::InputKind;
use phasefront_core::method::seeded::SeededPlan;
use phasefront_core::method::sweep::SweepPlan;
use phasefront_core::optics::aperture::{Aperture, Opening};
use phasefront_core::pipeline::display_plan::DisplayPlan;
use phasefront_core::view::colours::ViewColours;
use phasefront_core::view::refocus::{Refocus, phase_only_field};
use phasefront_exact::incoherent::{self, Natural, Pupil};
use phasefront_exact::point_based::{self, Occlusion};
use phasefront_exact::sm_lbm;
use phasefront_exact::truth::{Figures, filled, judge, visible_depth, visible_frame, visible_rgb};
use phasefront_io::dice::Dice;
use phasefront_io::display::calibration::{self, AberrationFile};
use phasefront_io::hologram::AberratedOptics;
use phasefront_io::ldi::{Ldi, LdiLayer};
use phasefront_io::picture::difference;
use phasefront_io::{Result, picture};
use rayon::prelude::*;
use serde::Serialize;
use std::borrow::Cow;
use std::cmp::Reverse;
use std::f32::consts::TAU;
use std::path::Path;
use std::sync::Arc;

/// The number of bins in a scene's depth histogram.
pub const DEPTH_BINS: usize = 200;

/// The number of a scene's most frequent depths in a focal stack.
pub const FREQUENT_DEPTHS: usize = 15;

/// The number of random depths in a focal stack, from the other bins.
pub const RANDOM_DEPTHS: usize = 5;

/// The factor that multiplies differences in [`write_picture`].
pub const DIFFERENCE_GAIN: f32 = 4.0;

type MakeField<'a> = dyn Fn(&Ldi) -> Result<Array3<Complex32>> + Send + Sync + 'a;

/// A method that turns a scene into its complex midpoint hologram.
pub struct Method<'a> {
    /// The name in tables and file names.
    pub name: String,
    field: Box<MakeField<'a>>,
    /// The pre-filter that the field was trained for. It replaces every encoding.
    prefilter: Option<Arc<Network>>,
}

impl<'a> Method<'a> {
    /// Makes a method of any function from a scene to its midpoint hologram, (C, H, W), without the carrier.
    pub fn new(name: impl Into<String>, field: impl Fn(&Ldi) -> Result<Array3<Complex32>> + Send + Sync + 'a) -> Self {
        Method {
            name: name.into(),
            field: Box::new(field),
            prefilter: None,
        }
    }

    /// Returns the midpoint hologram, (C, H, W), of `scene`.
    ///
    /// # Errors
    /// Returns the errors of the method.
    pub fn field(&self, scene: &Ldi) -> Result<Array3<Complex32>> {
        (self.field)(scene)
    }

    /// Takes the visible image itself, with phase 0, as the field: the baseline without any computation.
    pub fn rgb(display: &'a Display) -> Self {
        Self::new("rgb", move |ldi| {
            Ok(visible_frame(ldi, display)?.rgb().mapv(Complex32::from))
        })
    }

    /// Computes SM-LBM with `planes` planes on the visible layer, which equals an RGB-D image.
    pub fn visible(display: &'a Display, planes: usize) -> Self {
        Self::new("visible", move |ldi| {
            let front = Ldi::new(vec![ldi.layers[0].clone()])?;
            sm_lbm::hologram(&front, display, planes, &|_, _| {})
        })
    }

    /// Computes the point-based method at `planes` depths on the visible layer: the first row of the paper's Table 2.
    pub fn points(display: &'a Display, planes: usize) -> Self {
        Self::new("points", move |ldi| {
            point_based::hologram(ldi, display, planes, Occlusion::Input, &|_, _| {})
        })
    }

    /// Computes SM-LBM with `planes` planes on all layers.
    pub fn layers(display: &'a Display, planes: usize) -> Self {
        Self::new("layers", move |ldi| sm_lbm::hologram(ldi, display, planes, &|_, _| {}))
    }

    /// Computes SM-LBM with `planes` planes on the visible layer and the hidden surfaces that the sweep adds. This is
    /// the sweep with exact waves.
    pub fn filled(display: &'a Display, planes: usize) -> Self {
        Self::new("filled", move |ldi| {
            let filled = filled(&visible_frame(ldi, display)?, display)?;
            sm_lbm::hologram(&filled, display, planes, &|_, _| {})
        })
    }

    /// Computes the plane sweep on the visible layer of scenes of `size`×`size` pixels.
    ///
    /// # Errors
    /// Returns an error if the sweep cannot be planned.
    pub fn sweep(size: usize, display: &Display, sweep: Sweep) -> Result<Self> {
        let (plan, display) = (
            SweepPlan::new(
                Size {
                    width: size,
                    height: size,
                },
                display,
                sweep,
                0.0,
            )?,
            display.clone(),
        );
        Ok(Self::new("sweep", move |ldi| {
            let mut field = Array3::zeros((display.colours(), size, size));
            let values = field.as_slice_mut().expect("standard layout");
            plan.field(&visible_frame(ldi, &display)?, values, &mut plan.scratch())?;
            Ok(field)
        }))
    }

    /// Chooses the plane sweep or the network for each scene by its depth, as [`phasefront::Method::Auto`] does.
    ///
    /// # Errors
    /// Returns an error if one of the methods cannot be planned.
    pub fn auto(size: usize, display: &Display, sweep: Sweep, network: Arc<Network>) -> Result<Self> {
        let method = phasefront::Method::Auto(sweep, network);
        let (plan, display) = (
            MethodPlan::new(
                Size {
                    width: size,
                    height: size,
                },
                method,
                display,
            )?,
            display.clone(),
        );
        Ok(Self::new("auto", move |ldi| {
            let mut field = Array3::zeros((display.colours(), size, size));
            let values = field.as_slice_mut().expect("standard layout");
            plan.field(&visible_frame(ldi, &display)?, values, &mut plan.scratch())?;
            Ok(field)
        }))
    }

    fn seeded(name: String, network: &Network, size: usize, display: &Display) -> Result<Self> {
        let (plan, display) = (
            SeededPlan::new(
                Size {
                    width: size,
                    height: size,
                },
                network,
                display,
            )?,
            display.clone(),
        );
        Ok(Self::new(name, move |ldi| {
            let mut field = Array3::zeros((display.colours(), size, size));
            let values = field.as_slice_mut().expect("standard layout");
            plan.field(&visible_frame(ldi, &display)?, values, &mut plan.scratch())?;
            Ok(field)
        }))
    }

    /// Runs a network on scenes of `size`×`size` pixels, with RGB-D or as many layers as its input has.
    ///
    /// # Errors
    /// Returns an error if the network is a pre-filter or is for another display.
    pub fn network(name: impl Into<String>, network: &Network, size: usize, display: &Display) -> Result<Self> {
        let name = name.into();
        if network.input() == InputKind::Seeded {
            return Self::seeded(name, network, size, display);
        }
        let of_layers = matches!(network.input(), InputKind::Ldi { .. });
        if !of_layers && !matches!(network.input(), InputKind::Rgbd | InputKind::RgbdXy) {
            return Err(phasefront::Error::Network(format!(
                "it takes '{}'; a network for 'rgbd', 'seeded' or layered depth images is needed",
                network.input()
            ))
            .into());
        }
        let (plan, display) = (
            network.plan_for(
                Size {
                    width: size,
                    height: size,
                },
                display,
            )?,
            display.clone(),
        );
        Ok(Self::new(name, move |ldi| {
            let mut field = Array3::zeros((display.colours(), size, size));
            let values = field.as_slice_mut().expect("standard layout");
            match of_layers {
                true => plan.field(&*ldi.for_display(&display), values, &mut plan.scratch())?,
                false => plan.field(&visible_frame(ldi, &display)?, values, &mut plan.scratch())?,
            }
            Ok(field)
        }))
    }

    /// Runs a network together with the pre-filter of its training, which is part of every encoding.
    ///
    /// # Errors
    /// Returns an error if [`Self::network`] does.
    pub fn pair(
        name: impl Into<String>,
        network: &Network,
        prefilter: Arc<Network>,
        size: usize,
        display: &Display,
    ) -> Result<Self> {
        Ok(Method {
            prefilter: Some(prefilter),
            ..Self::network(name, network, size, display)?
        })
    }

    /// Returns the encoder options for a field of this method, starting from `options`.
    fn encoder(&self, options: &EncoderOptions) -> EncoderOptions {
        EncoderOptions {
            encoding: match &self.prefilter {
                Some(prefilter) => Encoding::Deep(prefilter.clone()),
                None => options.encoding.clone(),
            },
            ..options.clone()
        }
    }
}

/// A way to display a field.
#[derive(Debug, Clone)]
pub struct Shown {
    /// The name in tables and file names.
    pub name: String,
    /// The target and the encoder of the levels. `None` shows the complex field itself.
    pub levels: Option<(Target, EncoderOptions)>,
    /// The steps of descent from the levels toward the `Ceiling`. 0 shows the levels unchanged.
    pub ceiling: usize,
    /// The viewing aperture, if it differs from the one that the levels are made for.
    pub through: Option<Opening>,
}

impl Shown {
    /// Shows the complex field itself.
    pub fn complex() -> Self {
        Shown {
            name: "complex".into(),
            levels: None,
            ceiling: 0,
            through: None,
        }
    }

    /// Shows levels for `target` by `options`, with `encoder` as the encoder's name.
    pub fn encoded(encoder: &str, target: Target, options: EncoderOptions) -> Self {
        Shown {
            name: encoded_name(encoder, &options),
            levels: Some((target, options)),
            ceiling: 0,
            through: None,
        }
    }

    /// Returns the pupil that views pass.
    fn pupil(&self, display: &Display) -> Pupil {
        self.through.map_or_else(|| Pupil::of_aperture(display), Pupil::from)
    }

    /// Returns this way for `method`, whose pre-filter replaces the encoder and the encoder's name.
    fn of(&self, method: &Method<'_>) -> Self {
        let levels = (self.levels.as_ref()).map(|(target, options)| (target.clone(), method.encoder(options)));
        let name = match (&levels, &method.prefilter) {
            (Some((_, options)), Some(_)) if self.ceiling == 0 => encoded_name("deep", options),
            _ => self.name.clone(),
        };
        Shown {
            name,
            levels,
            ceiling: self.ceiling,
            through: self.through,
        }
    }
}

fn encoded_name(encoder: &str, options: &EncoderOptions) -> String {
    let EncoderOptions {
        dark_threshold,
        local_steps,
        midpoint_steps,
        focus_steps,
        ..
    } = options;
    let more = match (midpoint_steps, focus_steps) {
        (0, 0) => String::new(),
        (0, more) => format!(", natural {more}"),
        (more, _) => format!(" + {more}"),
    };
    format!("{encoder}, dark {dark_threshold}, steps {local_steps}{more}")
}

/// Returns the ways of `shown` that apply to fields of `method`. A pre-filter replaces every encoder, so ways that
/// differ only in the encoder become one.
pub fn ways(method: &Method<'_>, shown: &[Shown]) -> Vec<Shown> {
    let mut ways: Vec<Shown> = Vec::new();
    for shown in shown.iter().map(|shown| shown.of(method)) {
        if method.prefilter.is_none() || ways.iter().all(|other| other.name != shown.name) {
            ways.push(shown);
        }
    }
    ways
}

/// The measures of one scene by both truths.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Judged {
    /// Against the coherent wave of the data set.
    #[serde(flatten)]
    pub coherent: Figures,
    /// Against incoherent light.
    pub natural: Natural,
    /// The mean CIEDE2000 of the colours at the midpoint from those of the coherent wave, as
    /// [`difference::of_pictures`] gives it for the light of the lasers.
    pub ciede2000: f64,
}

impl Judged {
    fn mean(scenes: impl Iterator<Item = Judged> + Clone) -> Self {
        let count = scenes.clone().count() as f64;
        let mean =
            |figure: fn(Figures) -> f64| scenes.clone().map(|judged| figure(judged.coherent)).sum::<f64>() / count;
        Judged {
            coherent: Figures {
                amplitude_psnr: mean(|f| f.amplitude_psnr),
                amplitude_ssim: mean(|f| f.amplitude_ssim),
                focal_psnr: mean(|f| f.focal_psnr),
                focal_ssim: mean(|f| f.focal_ssim),
                brightness: mean(|f| f.brightness),
                light: mean(|f| f.light),
            },
            natural: Natural::mean(scenes.clone().map(|judged| judged.natural)),
            ciede2000: scenes.map(|judged| judged.ciede2000).sum::<f64>() / count,
        }
    }
}

/// Both truths of one scene.
struct Truths<'a> {
    ldi: &'a Ldi,
    display: &'a Display,
    /// The depths of focus of both, in metres: those of the coherent wave come first.
    z_m: Vec<f64>,
    coherent: Vec<Array3<f32>>,
    /// What incoherent light shows through each pupil so far.
    natural: Vec<(Pupil, incoherent::Judge)>,
}

impl<'a> Truths<'a> {
    /// Prepares the truths of `pair`, the coherent one at the midpoint and at the normalized `depths`.
    fn new(viewer: &Viewer, manifest: &'a Manifest, pair: &'a dataset::Pair, depths: &[f64]) -> Result<Self> {
        let display = &manifest.display;
        let mut z_m = vec![0.0];
        z_m.extend(depths.iter().map(|d| display.z_of_depth(*d)));
        let coherent = viewer.views(None, &pair.hologram, &Shown::complex(), &z_m)?.views;
        z_m.extend(incoherent::Judge::z_m(display));
        Ok(Truths {
            ldi: &pair.ldi,
            display,
            z_m,
            coherent,
            natural: Vec::new(),
        })
    }

    /// Judges the views at each of the depths of focus.
    fn judge(&mut self, seen: &Seen, pupil: Pupil, margin: usize) -> Result<Judged> {
        if self.natural.iter().all(|(known, _)| *known != pupil) {
            let judge = incoherent::Judge::of(self.ldi, self.display, pupil)?;
            self.natural.push((pupil, judge));
        }
        let (coherent, natural) = seen.views.split_at(self.coherent.len());
        let judge_of = self.natural.iter().find(|(known, _)| *known == pupil);
        let (_, of_pupil) = judge_of.expect("one was made for it");
        Ok(Judged {
            coherent: Figures {
                light: seen.light,
                ..judge(coherent, &self.coherent, margin)?
            },
            natural: of_pupil.judge(natural, margin)?,
            ciede2000: self.colour_difference(&coherent[0], margin),
        })
    }
}

impl Truths<'_> {
    /// Returns the difference of the colours of `view`, at the midpoint, without `margin` pixels at the border.
    fn colour_difference(&self, view: &Array3<f32>, margin: usize) -> f64 {
        let colours = ViewColours::Srgb(light_to_srgb(self.display));
        let light = |view: &Array3<f32>| {
            let (_, height, width) = view.dim();
            let inner = s![.., margin..height - margin, margin..width - margin];
            difference::light_of_view(view.slice(inner), &colours)
        };
        match (light(view), light(&self.coherent[0])) {
            (Some(view), Some(truth)) => difference::of_pictures(view.view(), truth.view()),
            _ => unreachable!("views are light"),
        }
    }
}

/// The results of one way on all scenes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// The name of the [`Method`].
    pub method: String,
    /// The sensor whose depth the method received. `None` is the true depth.
    pub sensor: Option<Sensor>,
    /// The mean share of pixels whose depth was wrong by more than [`WRONG`].
    pub wrong_depth: f64,
    /// The name of the [`Shown`].
    pub shown: String,
    /// The means over the scenes.
    pub mean: Judged,
    /// For each scene: its index in the data set and its measures.
    pub scenes: Vec<(usize, Judged)>,
}

impl Row {
    /// Returns the indices of the `count` scenes with the lowest amplitude PSNR, worst first.
    pub fn worst(&self, count: usize) -> Vec<usize> {
        let mut scenes = self.scenes.clone();
        scenes.sort_by(|(_, a), (_, b)| a.coherent.amplitude_psnr.total_cmp(&b.coherent.amplitude_psnr));
        scenes.iter().take(count).map(|(index, _)| *index).collect()
    }
}

/// Returns the normalized depths of a scene's focal stack: the middles of the fullest bins of the histogram of its
/// visible depths, followed by those of random other bins. The same `seed` gives the same depths.
pub fn stack_depths(depth: &Array2<f32>, seed: u64) -> Vec<f64> {
    let mut counts = [0usize; DEPTH_BINS];
    for d in depth.iter().filter(|d| !d.is_nan()) {
        counts[((d * DEPTH_BINS as f32) as usize).min(DEPTH_BINS - 1)] += 1;
    }
    let mut bins: Vec<usize> = (0..DEPTH_BINS).collect();
    bins.sort_by_key(|bin| Reverse(counts[*bin]));
    let mut dice = Dice::new(seed);
    for i in FREQUENT_DEPTHS..FREQUENT_DEPTHS + RANDOM_DEPTHS {
        bins.swap(i, dice.integer(i, DEPTH_BINS - 1));
    }
    bins.truncate(FREQUENT_DEPTHS + RANDOM_DEPTHS);
    bins.iter().map(|bin| (*bin as f64 + 0.5) / DEPTH_BINS as f64).collect()
}

/// Displays the holograms of one data set: it holds plans for the data set's shape and display. If the holograms
/// correct an aberration that is constant over depth, views pass through that aberration (the paper's Fig. 8).
pub struct Viewer {
    size: usize,
    optics: Option<AberratedOptics>,
    complex: Refocus,
    /// z of the volume's ends.
    ends_m: [f64; 2],
}

impl Viewer {
    /// Plans views from any depth of the volume.
    ///
    /// # Errors
    /// Returns an error if waves cannot be propagated through the volume or the aberration is invalid.
    pub fn new(manifest: &Manifest) -> Result<Self> {
        let display = &manifest.display;
        let ends_m = [0.5, -0.5].map(|part| part * display.volume_depth_m());
        let correction = match manifest.aberration.is_empty() {
            true => None,
            false => match calibration::aberrations(&manifest.aberration)? {
                AberrationFile::Uniform(all) => all.constant(),
                AberrationFile::Spatial(_) => None,
            },
        };
        let size = Size {
            width: manifest.size,
            height: manifest.size,
        };
        Ok(Viewer {
            optics: correction
                .map(|correction| AberratedOptics::new(size, display, &correction))
                .transpose()?,
            complex: Refocus::new(
                Size {
                    width: manifest.size,
                    height: manifest.size,
                },
                display,
                &ends_m,
                None,
            )?,
            size: manifest.size,
            ends_m,
        })
    }

    /// Returns the amplitudes of the midpoint hologram `field`, (C, H, W), at each of `z_m`, in metres, when `shown`
    /// displays it. Natural focus needs the `frame` of the field.
    ///
    /// # Errors
    /// Returns an error if a z lies outside the volume or the levels cannot be planned.
    pub fn views(
        &self,
        frame: Option<&RgbdFrame>,
        field: &Array3<Complex32>,
        shown: &Shown,
        z_m: &[f64],
    ) -> Result<Seen> {
        let size = Size {
            width: self.size,
            height: self.size,
        };
        let mut values = field.iter().copied().collect::<Vec<_>>();
        let mut light = 1.0;
        let of_levels;
        let refocus = match &shown.levels {
            None => &self.complex,
            Some((target, options)) => {
                let modulator = match frame {
                    Some(_) => DisplayPlan::for_frames(size, 0.0, target, options)?,
                    None => DisplayPlan::new(size, target, options)?,
                };
                let mut scratch = modulator.scratch();
                if let Some(frame) = frame {
                    modulator.aim(frame, &mut scratch);
                }
                if !modulator.keeps_phase() {
                    remove_mean_phase(&mut values, field.dim().0);
                }
                modulator.propagate(&mut values, &mut scratch);
                let mut levels = vec![0; values.len()];
                let modulation = modulator.modulate(None, &mut values, LevelsMut::Bytes(&mut levels), &mut scratch);
                if shown.ceiling > 0 {
                    self.lift(field, target, modulation.scale, shown.ceiling, &mut levels)?;
                }
                phase_only_field(&levels, &target.response, modulation.scale, &mut values);
                let opening = (shown.through).unwrap_or(Opening::centred(target.display.aperture_radius()));
                light = self.light(&values, opening)?;
                of_levels = Refocus::new(size, &target.display, &self.ends_m, Some(opening))?;
                &of_levels
            }
        };
        if let Some(optics) = &self.optics {
            optics.pass(&mut values);
        }
        let views = refocus.focal_stack(&values, z_m)?.into_iter();
        let view = |view| Array3::from_shape_vec(field.dim(), view).expect("the field's shape");
        Ok(Seen {
            views: views.map(view).collect(),
            light,
        })
    }

    /// Moves `levels` by `steps` of descent toward the amplitudes of the midpoint hologram `field`.
    fn lift(
        &self,
        field: &Array3<Complex32>,
        target: &Target,
        scale: f32,
        steps: usize,
        levels: &mut [u8],
    ) -> Result<()> {
        let ceiling = Ceiling::new(self.size, &target.display)?;
        let wave: Vec<Complex32> = field.iter().map(|u| u / scale).collect();
        let wanted = self.complex.focal_stack(&wave, &ceiling.z_m())?;
        let phases = levels.iter().enumerate();
        let mut phases: Vec<f32> = phases.map(|(at, level)| target.response.phase(*level, at)).collect();
        ceiling.optimise(&mut phases, &wanted, steps);
        for (at, (level, phase)) in levels.iter_mut().zip(&phases).enumerate() {
            *level = target.response.level(phase.rem_euclid(TAU), at);
        }
        Ok(())
    }

    /// Returns the share of the light of `shown`, (C, H, W) at the modulator, that passes `opening`.
    fn light(&self, shown: &[Complex32], opening: Opening) -> Result<f64> {
        let energy = |values: &[Complex32]| values.iter().map(|v| f64::from(v.norm_sqr())).sum::<f64>();
        let aperture = Aperture::new(
            Size {
                width: self.size,
                height: self.size,
            },
            opening,
        )?;
        let mut scratch = aperture.scratch();
        let mut passed = shown.to_vec();
        for plane in passed.chunks_exact_mut(self.size * self.size) {
            aperture.filter(plane, &mut scratch);
        }
        Ok(energy(&passed) / energy(shown))
    }
}

/// The views of a hologram.
pub struct Seen {
    /// The amplitudes, (C, H, W), for each z.
    pub views: Vec<Array3<f32>>,
    /// The share of the modulator's light that passes the aperture. 1 for a complex field.
    pub light: f64,
}

/// The difference from the true depth, as a fraction of the volume, above which a pixel's depth is wrong.
pub const WRONG: f32 = 0.03;

/// A scene with the depth that methods receive.
struct Sensed<'a> {
    scene: Cow<'a, Ldi>,
    /// The share of pixels whose depth is wrong by more than [`WRONG`].
    wrong: f64,
}

impl<'a> Sensed<'a> {
    /// Returns the scene `ldi` with its true depth or, without hidden layers, with the depth that a session makes of a
    /// `sensor`'s reading. `seed` selects the reading.
    fn new(ldi: &'a Ldi, sensor: Option<Sensor>, seed: u64) -> Result<Self> {
        let Some(sensor) = sensor else {
            return Ok(Sensed {
                scene: Cow::Borrowed(ldi),
                wrong: 0.0,
            });
        };
        let (rgb, truth) = (visible_rgb(ldi), visible_depth(ldi));
        let depth = sensor.read(truth.view(), seed).session_depth(&rgb)?;
        let wrong = depth.iter().zip(&truth).filter(|(a, b)| (**a - **b).abs() > WRONG);
        Ok(Sensed {
            wrong: wrong.count() as f64 / truth.len() as f64,
            scene: Cow::Owned(Ldi::new(vec![LdiLayer { rgb, depth }])?),
        })
    }
}

/// The part of a data set to evaluate.
#[derive(Debug, Clone)]
pub struct Sample {
    /// The indices of the pairs.
    pub scenes: Vec<usize>,
    /// The seed of the random depths in the focal stacks.
    pub seed: u64,
    /// The sensors whose depth methods receive after the true depth.
    pub sensors: Vec<Sensor>,
    /// The number of pixels at the border of each scene that do not count. At an offset, light from outside enters a
    /// small frame, and no modulator of that size sends this light.
    pub margin: usize,
}

/// Evaluates each of `methods` in its [`ways`] of `shown` on the `sample` of the data set in `dir`, on the true depth
/// and on that of each sensor. The rows are in that order: a depth's methods together, and a method's ways. `done` is
/// called after each scene.
///
/// A method with hidden layers as input has them only with the true depth.
///
/// # Errors
/// Returns an error if there are no scenes, if the margin leaves no pixels, if a pair cannot be read, or if a method
/// fails.
pub fn evaluate(
    manifest: &Manifest,
    dir: &Path,
    sample: &Sample,
    methods: &[Method<'_>],
    shown: &[Shown],
    done: &(dyn Fn() + Sync),
) -> Result<Vec<Row>> {
    let Sample {
        scenes,
        seed,
        sensors,
        margin,
    } = sample;
    if 2 * margin >= manifest.size {
        return Err(phasefront_io::Error::Input(format!(
            "a margin of {margin} px leaves nothing of scenes of {} px",
            manifest.size
        )));
    }
    if scenes.is_empty() {
        return Err(phasefront_io::Error::file(
            dir,
            "no scenes to evaluate on in this split; the data set needs at least 40 for one",
        ));
    }
    let viewer = Viewer::new(manifest)?;
    let each: Vec<_> = methods.iter().map(|method| (method, ways(method, shown))).collect();
    let depths: Vec<Option<Sensor>> = std::iter::once(None).chain(sensors.iter().copied().map(Some)).collect();
    let of_scenes = scenes
        .par_iter()
        .map(|&index| {
            let pair = dataset::read_pair(manifest, dir, index)?;
            let at = stack_depths(&pair.ldi.layers[0].depth, (seed << 32) + index as u64);
            let mut truths = Truths::new(&viewer, manifest, &pair, &at)?;
            let mut figures = Vec::new();
            for sensor in &depths {
                let Sensed { scene, wrong } = Sensed::new(&pair.ldi, *sensor, (seed << 32) + index as u64)?;
                for (method, ways) in &each {
                    let field = (method.field)(&scene)?;
                    let frame = visible_frame(&scene, &manifest.display)?;
                    for shown in ways {
                        let seen = viewer.views(Some(&frame), &field, shown, &truths.z_m)?;
                        let judged = truths.judge(&seen, shown.pupil(&manifest.display), *margin)?;
                        figures.push((judged, wrong));
                    }
                }
            }
            done();
            Ok(figures)
        })
        .collect::<Result<Vec<_>>>()?;
    let rows = depths.iter().flat_map(|sensor| {
        let ways = (each.iter()).flat_map(|(method, ways)| ways.iter().map(move |shown| (method, shown)));
        ways.map(move |(method, shown)| (sensor, method, shown))
    });
    Ok(rows
        .enumerate()
        .map(|(row, (sensor, method, shown))| {
            let each = || of_scenes.iter().map(|figures| figures[row].0);
            Row {
                method: method.name.clone(),
                sensor: *sensor,
                wrong_depth: of_scenes.iter().map(|figures| figures[row].1).sum::<f64>() / scenes.len() as f64,
                shown: shown.name.clone(),
                mean: Judged::mean(each()),
                scenes: scenes.iter().copied().zip(each()).collect(),
            }
        })
        .collect())
}

/// Writes a PNG of pair `index` by `method` as `shown`, one of its [`ways`]. It shows, side by side, the visible image,
/// the midpoint's amplitude, the true amplitude, and [`DIFFERENCE_GAIN`] times their difference.
///
/// # Errors
/// Returns an error if the pair cannot be read, the method fails, or the file cannot be written.
pub fn write_picture(
    path: &Path,
    manifest: &Manifest,
    dir: &Path,
    index: usize,
    method: &Method<'_>,
    shown: &Shown,
) -> Result<()> {
    let viewer = Viewer::new(manifest)?;
    let pair = dataset::read_pair(manifest, dir, index)?;
    let frame = visible_frame(&pair.ldi, &manifest.display)?;
    let ours = viewer
        .views(Some(&frame), &(method.field)(&pair.ldi)?, shown, &[0.0])?
        .views
        .remove(0);
    let complex = Shown::complex();
    let truth = viewer.views(None, &pair.hologram, &complex, &[0.0])?.views.remove(0);
    let difference = (&ours - &truth).mapv(|v| v.abs() * DIFFERENCE_GAIN);
    let gap = Array3::from_elem((ours.dim().0, manifest.size, 4), 1.0);
    let input = frame.rgb().to_owned();
    let panels = [&input, &gap, &ours, &gap, &truth, &gap, &difference].map(|panel| panel.view());
    let strip = concatenate(Axis(2), &panels).expect("panels of one height");
    picture::write_amplitude(path, strip.view())
}
