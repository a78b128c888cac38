//! Why a photograph of a displayed hologram looks wrong.
//!
//! The photograph is placed first, in any orientation, without the assumption that it is right (`placement`). Each
//! cause is then a free parameter of a forward model of what the camera sees (`scene`), and is fitted to the
//! photograph (`cause`). Causes are added one after another as long as the likelihood of the photograph rises. The
//! confidence of each is that of Vuong's test against the best model that has no more of it than a good display has,
//! and against models that have a similar cause in its place (`score`).

mod cause;
mod placement;
mod report;
mod scene;
mod score;
mod state;

use crate::camera::photograph::{Photograph, SATURATED_SHARE};
use cause::{Cause, Hypothesis, Search, depth_of_focus_m, search_m};
use phasefront::{Size, Target};
use phasefront_core::display::levels::Levels;
use phasefront_io::{Error, Result};
use placement::{Orientation, Place};
use rayon::prelude::*;
use scene::{Rect, Scene};
use score::Comparison;
use serde::Serialize;
use state::State;

/// The longest side of the part of a modulator that is compared, in pixels.
const MOST_ROI: usize = 256;
/// The largest number of causes in a model.
const MOST_CAUSES: usize = 6;
/// Vuong's statistic from which a cause is taken into the model.
const TAKEN: f64 = 2.0;
/// Vuong's statistic below which a cause is not tried again beside others.
const HOPELESS: f64 = -6.0;
/// The confidence from which a cause is reported.
const REPORTED: f64 = 0.9;
/// The share of a photograph's variance that no other place explains as well.
const CERTAIN: f64 = 0.95;
/// The likeness below which a photograph does not show the hologram.
const LIKENESS: f64 = 0.25;

/// A hologram that is shown.
#[derive(Debug, Clone, Copy)]
pub struct Shown<'a> {
    /// Its levels, (C, H, W).
    pub levels: Levels<'a>,
    /// Its size.
    pub size: Size,
    /// The display that it is for, with its correction.
    pub target: &'a Target,
    /// The z that the camera focuses on, in metres.
    pub z_m: f64,
}

/// A cause found in a photograph.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Its name, as in the table of the documentation.
    pub cause: &'static str,
    /// The probability that the photograph shows it, from 0 to 1.
    pub confidence: f64,
    /// What the photograph shows, with a figure.
    pub evidence: String,
    /// What to do next.
    pub next: String,
}

/// What a photograph says about a display.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnosis {
    /// The causes, the most probable one first; empty if nothing is wrong.
    pub findings: Vec<Finding>,
    /// The corners of the modulator in the photograph: top left, top right, bottom left, bottom right.
    pub corners: [[f64; 2]; 4],
    /// The share of the photograph's variance that the picture explains as it should be, in its place.
    pub explained_right: f64,
    /// The same with all causes that were found.
    pub explained: f64,
}

/// Returns why `photographs`, one of each laser's light, do not look as `shown` should.
///
/// # Errors
/// Returns an error if the photographs differ in size, are dark, or do not show the hologram, or if the camera's z is
/// too far away.
pub fn diagnose(shown: &Shown<'_>, photographs: &[Photograph]) -> Result<Diagnosis> {
    check(photographs)?;
    let display = &shown.target.display;
    let lasers = photographs.len();
    let plain = State::right(lasers, shown.z_m, [[0.0; 2]; 4]);
    let mut states = vec![plain.clone(), placement::washed_out(&plain)];
    states.push(State {
        inverted: true,
        ..plain.clone()
    });
    states.extend([0.7, 1.35].map(|range| State {
        range: vec![range; lasers],
        ..plain.clone()
    }));
    states.push(State {
        taps: [0.1; 2],
        ..plain.clone()
    });
    let depth_m = depth_of_focus_m(display);
    states.extend([-6.0, 6.0, -3.0, 3.0].map(|depths| State {
        z_m: shown.z_m + depths * depth_m,
        blur: 1.0,
        ..plain.clone()
    }));
    let places = placement::places(shown, photographs, &states, reach_m(shown))?;
    let refuse = |place: Option<&Place>| {
        let fits = place.map_or(0.0, |place| place.fits);
        Err(Error::Input(format!(
            "does not show the hologram: its picture fits nowhere (correlation {fits:.2}, at least {LIKENESS} is needed); have all of the picture in the photograph, at least a third as wide as it, and give the z that the camera focuses on"
        )))
    };
    let Some(place) = places.first().filter(|place| place.fits >= LIKENESS) else {
        return refuse(places.first());
    };
    let likely = places.iter().take(3).filter(|other| other.fits > place.fits - 0.15);
    of_places(
        shown,
        photographs,
        &likely.map(|place| place.corners).collect::<Vec<_>>(),
    )
}

/// Returns the diagnosis at the best of some places, each with its corners.
fn of_places(shown: &Shown<'_>, photographs: &[Photograph], places: &[[[f64; 2]; 4]]) -> Result<Diagnosis> {
    let roi = compared(shown.size);
    let search = Search {
        comparison: Comparison {
            scene: Scene::new(shown, roi, reach_m(shown))?,
            photographs,
        },
        display: &shown.target.display,
        right: State::right(photographs.len(), shown.z_m, [[0.0; 2]; 4]),
        zoom: score::zoom_of(places[0], shown.size),
    };
    let mut found = Vec::new();
    for corners in places {
        let right = State {
            corners: placement::corners_of(roi, *corners, shown.size)?,
            ..search.right.clone()
        };
        found.push(Found::new(&search, right)?);
        if found.iter().any(|found: &Found| found.now.score.explained() > CERTAIN) {
            break;
        }
    }
    found.sort_by(|a, b| b.now.score.likelihood.total_cmp(&a.now.score.likelihood));
    let best = found.swap_remove(0);
    let best = best.in_orientation(&search)?;
    let mut findings = best.findings(&search)?;
    let orientation = Orientation::of(best.now.state.corners);
    if let Some(fault) = orientation.fault() {
        findings.push(report::turned(fault, orientation.mirrored, confidence(best.turned)));
    }
    findings.extend(saturation(photographs));
    findings.sort_by(|a, b| b.confidence.total_cmp(&a.confidence));
    Ok(Diagnosis {
        findings,
        corners: whole_corners(roi, best.now.state.corners, shown.size)?,
        explained_right: best.right.score.explained().max(0.0),
        explained: best.now.score.explained().max(0.0),
    })
}

/// Returns how far light goes from the modulator to the planes that are searched.
fn reach_m(shown: &Shown<'_>) -> f64 {
    let display = &shown.target.display;
    (shown.z_m - display.offset_m()).abs() + search_m(display)
}

fn check(photographs: &[Photograph]) -> Result<()> {
    let size = |photo: &Photograph| (photo.width, photo.height);
    let [first, rest @ ..] = photographs else {
        return Err(Error::Input("no photograph to look at".into()));
    };
    if first.width < 32 || first.height < 32 {
        return Err(Error::Input(format!(
            "a photograph of {}×{}; it must be at least 32×32",
            first.width, first.height
        )));
    }
    if let Some(other) = rest.iter().find(|photo| size(photo) != size(first)) {
        return Err(Error::Input(format!(
            "photographs of {:?} and {:?}; those of all lasers must be of one size",
            size(first),
            size(other)
        )));
    }
    for photo in photographs {
        let most = photo.values.iter().copied().max().unwrap_or_default();
        if f64::from(most) < 0.02 * f64::from(photo.full) {
            return Err(Error::Input(format!(
                "too dark: its brightest pixel has {:.1} % of the range; expose it longer, until the brightest reaches half",
                100.0 * f64::from(most) / f64::from(photo.full)
            )));
        }
    }
    Ok(())
}

/// Returns the part of a modulator that is compared: its middle, or all of a small one.
fn compared(size: Size) -> Rect {
    let part = |length: usize| length.min(MOST_ROI);
    let (width, height) = (part(size.width), part(size.height));
    Rect {
        x: (size.width - width) / 2,
        y: (size.height - height) / 2,
        size: Size { width, height },
    }
}

fn whole_corners(roi: Rect, corners: [[f64; 2]; 4], Size { width, height }: Size) -> Result<[[f64; 2]; 4]> {
    let map = score::map_of(corners, roi.size)?;
    let (left, top) = (-(roi.x as f64), -(roi.y as f64));
    let (right, down) = (left + width as f64, top + height as f64);
    Ok([[left, top], [right, top], [left, down], [right, down]].map(|corner| map.map(corner)))
}

/// Returns the probability of a standard normal number below `z`, from 0 to 0.999.
fn confidence(z: f64) -> f64 {
    // Abramowitz and Stegun, 7.1.26.
    let x = z.abs() / std::f64::consts::SQRT_2;
    let t = 1.0 / (1.0 + 0.327_591_1 * x);
    let series =
        t * (0.254_829_592 + t * (-0.284_496_736 + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))));
    let erf = 1.0 - series * (-x * x).exp();
    (0.5 * (1.0 + erf * z.signum())).clamp(0.0, 0.999)
}

fn saturation(photographs: &[Photograph]) -> Option<Finding> {
    let most = photographs.iter().map(Photograph::saturated).fold(0.0, f64::max);
    (most > SATURATED_SHARE).then(|| report::saturated(most))
}

/// The model that was found for one place.
struct Found {
    right: Hypothesis,
    now: Hypothesis,
    causes: Vec<Cause>,
    /// Vuong's statistic against the best other orientation.
    turned: f64,
}

impl Found {
    /// Adds causes to the state of a right display as long as the photograph becomes more likely.
    fn new(search: &Search<'_>, right: State) -> Result<Self> {
        let right = search.hypothesis(right, 6)?;
        let mut now = right.clone();
        let mut causes = Vec::new();
        let mut hopeless: Vec<Cause> = Vec::new();
        for _ in 0..MOST_CAUSES {
            let untried = Cause::ALL.into_par_iter().filter(|cause| {
                // A picture that is mostly explained comes pixel for pixel.
                let useful = *cause != Cause::Scale || now.score.explained() < 0.85;
                let open = !causes.contains(cause) && !hopeless.contains(cause);
                useful && *cause != Cause::Blur && open && search.applies(*cause)
            });
            let tried: Result<Vec<_>> = untried
                .map(|cause| Ok((cause, search.fit(cause, &now.state)?)))
                .collect();
            let tried = tried?;
            let far = tried
                .iter()
                .filter(|(_, next)| next.score.against(&now.score) < HOPELESS);
            hopeless.extend(far.map(|(cause, _)| *cause));
            let best = (tried
                .into_iter()
                .filter(|(cause, next)| search.has(*cause, &next.state)))
            .max_by(|a, b| a.1.score.likelihood.total_cmp(&b.1.score.likelihood));
            let Some((cause, next)) = best.filter(|(_, next)| next.score.against(&now.score) > TAKEN) else {
                break;
            };
            causes.push(cause);
            now = next;
            for other in causes[..causes.len() - 1].iter() {
                now = Self::better(now, search, *other)?;
            }
        }
        Ok(Found {
            right,
            now,
            causes,
            turned: f64::MAX,
        })
    }

    /// Returns the model in the orientation that fits best with its causes. A picture that is damaged can be placed
    /// wrongly before they are known.
    fn in_orientation(mut self, search: &Search<'_>) -> Result<Self> {
        let [a, b, c, d] = self.now.state.corners;
        for corners in [[b, a, d, c], [c, d, a, b], [d, c, b, a]] {
            let with = State {
                corners,
                ..self.now.state.clone()
            };
            let other = search.hypothesis(with, 5)?;
            if other.score.likelihood > self.now.score.likelihood {
                let next = Found::new(search, search.right_at(&other.state))?;
                if next.now.score.likelihood > self.now.score.likelihood {
                    let turned = next.now.score.against(&self.now.score);
                    self = Found { turned, ..next };
                    continue;
                }
            }
            self.turned = self.turned.min(self.now.score.against(&other.score));
        }
        Ok(self)
    }

    /// Fits a cause anew beside the others.
    fn better(now: Hypothesis, search: &Search<'_>, cause: Cause) -> Result<Hypothesis> {
        if matches!(cause, Cause::Inverted | Cause::Order | Cause::Colours | Cause::Scale) {
            return Ok(now);
        }
        let again = search.fit(cause, &now.state)?;
        Ok(if again.score.likelihood > now.score.likelihood {
            again
        } else {
            now
        })
    }

    /// Returns the causes of which there is more than on a good display, with their confidence.
    fn findings(&self, search: &Search<'_>) -> Result<Vec<Finding>> {
        let mut findings = Vec::new();
        for cause in self.causes.iter().copied().chain([Cause::Blur]) {
            if !search.has(cause, &self.now.state) {
                continue;
            }
            let within = search.within(cause, &self.now.state);
            // The blur itself must not be fitted anew without it.
            let without = match cause {
                Cause::Blur => Hypothesis {
                    score: search.comparison.score(&within)?,
                    state: within,
                },
                _ => search.hypothesis(within, 2)?,
            };
            let mut least = self.now.score.against(&without.score);
            for other in cause.alike() {
                if self.causes.contains(other) || *other == Cause::Blur || !search.applies(*other) {
                    continue;
                }
                let instead = search.fit(*other, &without.state)?;
                least = least.min(self.now.score.against(&instead.score));
            }
            let confidence = confidence(least);
            if confidence >= REPORTED {
                findings.push(report::finding(cause, search, &self.now.state, confidence));
            }
        }
        Ok(findings)
    }
}
