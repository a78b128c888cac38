//! The causes that a diagnosis knows: how each changes the state of a display, and how much of it is right.

use super::scene::Parts;
use super::score::{Comparison, Sampled, Score, score};
use super::state::{Chroma, State};
use ndarray::Array2;
use num_complex::{Complex32, Complex64};
use phasefront::{Display, Size};
use phasefront_core::optics::fft::{Fft2, fast_size};
use phasefront_io::Result;
use std::f64::consts::TAU;

/// A cause of a wrong picture that the light's model describes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Cause {
    ZeroOrder,
    Conjugate,
    Ghost,
    Distance,
    Range,
    Inverted,
    Order,
    Filter,
    Scale,
    Colours,
    Bend,
    Blur,
}

/// The share of stray light that a good display has.
const STRAY: f64 = 0.01;
/// How far a good display's phase range is from what its file says, relatively.
const RANGE: f64 = 0.05;
/// The exponent of a curve that is straight enough, and its reciprocal.
const TONE: f64 = 1.06;
/// The outer weight of a filter that a good link may have.
const TAP: f64 = 0.02;
/// The blur of a focused camera in pixels of the modulator, beside half of its own.
const BLUR: f64 = 0.8;
/// How far ghost images are searched for, in pixels.
const GHOST: [f64; 2] = [4.0, 48.0];
/// The longer ways of ghost images' light that are tried, in depths of focus.
const GHOST_PATHS: [f64; 3] = [0.0, 4.0, 9.0];
/// The number of places of ghost images that are tried.
const GHOSTS: usize = 3;
/// Steps of a search along one parameter.
const GOLDEN: usize = 7;

/// A state and how it fits.
#[derive(Debug, Clone)]
pub(super) struct Hypothesis {
    pub state: State,
    pub score: Score,
}

/// The search for the state that fits best.
pub(super) struct Search<'a> {
    pub comparison: Comparison<'a>,
    pub display: &'a Display,
    /// The state of a display that is right.
    pub right: State,
    /// The number of a photograph's pixels for each of the modulator's.
    pub zoom: f64,
}

/// Returns the depth over which the finest detail stays sharp, in metres.
pub(super) fn depth_of_focus_m(display: &Display) -> f64 {
    (2.0 * display.pitch_m() / display.aperture_radius()).powi(2) / display.longest_wavelength_m()
}

/// Returns how far from the right z a camera's focus is searched for, in metres.
pub(super) fn search_m(display: &Display) -> f64 {
    (14.0 * depth_of_focus_m(display)).max(display.volume_depth_m())
}

/// Returns the share of the light that has the relative amplitude of each laser.
pub(super) fn share(amplitudes: &[Complex64]) -> f64 {
    let of = |value: &Complex64| value.norm_sqr() / (1.0 + value.norm_sqr());
    amplitudes.iter().map(of).sum::<f64>() / amplitudes.len() as f64
}

impl Cause {
    pub(super) const ALL: [Cause; 12] = [
        Cause::ZeroOrder,
        Cause::Conjugate,
        Cause::Ghost,
        Cause::Distance,
        Cause::Range,
        Cause::Inverted,
        Cause::Order,
        Cause::Filter,
        Cause::Scale,
        Cause::Colours,
        Cause::Bend,
        Cause::Blur,
    ];

    /// Returns the causes that look most like this one.
    pub(super) fn alike(self) -> &'static [Cause] {
        match self {
            Cause::ZeroOrder => &[Cause::Range, Cause::Bend, Cause::Filter],
            Cause::Conjugate => &[Cause::Range, Cause::Bend, Cause::Filter],
            Cause::Ghost => &[Cause::ZeroOrder],
            Cause::Distance => &[Cause::Inverted, Cause::Blur],
            Cause::Range => &[Cause::ZeroOrder, Cause::Bend, Cause::Filter],
            Cause::Inverted => &[Cause::Distance],
            Cause::Order => &[Cause::Distance, Cause::Inverted],
            Cause::Filter => &[Cause::ZeroOrder, Cause::Range, Cause::Bend, Cause::Colours],
            Cause::Scale => &[Cause::Filter],
            Cause::Colours => &[Cause::Filter, Cause::ZeroOrder],
            Cause::Bend => &[Cause::Range, Cause::ZeroOrder, Cause::Filter],
            Cause::Blur => &[Cause::Distance, Cause::Filter],
        }
    }
}

impl Search<'_> {
    /// Returns whether the display can have the cause.
    pub(super) fn applies(&self, cause: Cause) -> bool {
        let lasers = self.comparison.lasers();
        match cause {
            Cause::Order | Cause::Colours => lasers == 3,
            // The conjugate of the light on the panel looks like it.
            Cause::Inverted => (self.right.z_m - self.display.offset_m()).abs() > 0.5 * depth_of_focus_m(self.display),
            _ => true,
        }
    }

    /// Returns whether `state` has more of the cause than a good display.
    pub(super) fn has(&self, cause: Cause, state: &State) -> bool {
        self.within(cause, state) != *state
    }

    /// Returns `state` with no more of the cause than a good display has.
    pub(super) fn within(&self, cause: Cause, state: &State) -> State {
        let mut state = state.clone();
        let less = |all: &mut Vec<Complex64>| {
            while share(all) > STRAY {
                all.iter_mut().for_each(|value| *value *= 0.98);
            }
        };
        match cause {
            Cause::ZeroOrder => less(&mut state.undiffracted),
            Cause::Conjugate => less(&mut state.conjugate),
            Cause::Ghost => less(&mut state.ghost),
            Cause::Distance => {
                let most = 0.5 * depth_of_focus_m(self.display);
                state.z_m = state.z_m.clamp(self.right.z_m - most, self.right.z_m + most);
            }
            Cause::Range => {
                let mean = state.range.iter().sum::<f64>() / state.range.len() as f64;
                let far = state.range.iter().any(|range| (range - 1.0).abs() > 1.5 * RANGE);
                if (mean - 1.0).abs() > RANGE || far {
                    state
                        .range
                        .iter_mut()
                        .for_each(|range| *range = range.clamp(1.0 - RANGE, 1.0 + RANGE));
                }
            }
            Cause::Inverted => state.inverted = self.right.inverted,
            Cause::Order => state.order = self.right.order,
            Cause::Filter => state.taps = state.taps.map(|tap| tap.clamp(-TAP, TAP)),
            Cause::Scale => state.zoom = 1.0,
            Cause::Colours => state.chroma = Chroma::Own,
            Cause::Bend => state.tone = state.tone.clamp(1.0 / TONE, TONE),
            Cause::Blur => state.blur = state.blur.min(BLUR + 0.5 / self.zoom),
        }
        state
    }

    /// Returns the state of a right display in the place of `state`.
    pub(super) fn right_at(&self, state: &State) -> State {
        State {
            corners: state.corners,
            ..self.right.clone()
        }
    }

    /// Returns the hypothesis of a state, placed and blurred as it fits best.
    pub(super) fn hypothesis(&self, mut state: State, steps: usize) -> Result<Hypothesis> {
        state.corners = self.comparison.placed(&state, steps)?;
        let sampled = self.comparison.sampled(state.corners)?;
        let lasers = 0..self.comparison.lasers();
        let fields: Vec<Vec<f32>> = lasers.map(|laser| self.unblurred(&state, laser)).collect();
        let of = |blur: f64| -> f64 {
            let each = fields.iter().zip(&sampled);
            each.map(|(light, sampled)| score(&self.comparison.scene.blurred(light.clone(), blur), sampled).likelihood)
                .sum()
        };
        state.blur = golden([0.2, 2.0 + 1.0 / self.zoom], GOLDEN, of);
        let score = self.comparison.score_of(&state, &sampled);
        Ok(Hypothesis { state, score })
    }

    fn unblurred(&self, state: &State, laser: usize) -> Vec<f32> {
        let parts = [Complex64::ONE, state.undiffracted[laser], state.conjugate[laser]];
        let field = self.comparison.scene.field(state, laser, parts, state.ghost[laser]);
        field.iter().map(|value| value.norm_sqr()).collect()
    }

    /// Returns `from` with the amount of the cause that fits best.
    pub(super) fn fit(&self, cause: Cause, from: &State) -> Result<Hypothesis> {
        let sampled = self.comparison.sampled(from.corners)?;
        let likelihood = |state: &State| self.comparison.score_of(state, &sampled).likelihood;
        let best_of = |states: Vec<State>| best(states, likelihood);
        let state = match cause {
            Cause::ZeroOrder | Cause::Conjugate => self.stray(cause, from, &sampled),
            Cause::Ghost => self.ghost(from, &sampled),
            Cause::Distance => self.distance(from, likelihood),
            Cause::Range => self.range(from, &sampled),
            Cause::Inverted => State {
                inverted: !from.inverted,
                ..from.clone()
            },
            Cause::Order => {
                let orders = [[2, 1, 0], [1, 0, 2], [0, 2, 1], [1, 2, 0], [2, 0, 1], [0, 1, 2]];
                let other = orders.into_iter().filter(|order| *order != from.order);
                best_of(other.map(|order| State { order, ..from.clone() }).collect())
            }
            Cause::Filter => self.filter(from, likelihood),
            Cause::Scale => self.scale(from)?,
            Cause::Colours => {
                let shared = [(2, 1), (2, 2)].map(|(wide, high)| State {
                    chroma: Chroma::Shared { wide, high },
                    ..from.clone()
                });
                best_of(shared.into())
            }
            Cause::Bend => {
                let tones = [0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.1, 1.2, 1.35, 1.5, 1.7, 1.9, 2.2, 2.5];
                let at = |tone: f64| State { tone, ..from.clone() };
                let near = best_of(tones.map(at).into()).tone;
                at(golden([near * 0.88, near * 1.14], GOLDEN, |tone| likelihood(&at(tone))))
            }
            // Every hypothesis has the blur that fits best.
            Cause::Blur => from.clone(),
        };
        self.hypothesis(state, 2)
    }

    fn distance(&self, from: &State, likelihood: impl Fn(&State) -> f64) -> State {
        let (depth, most) = (depth_of_focus_m(self.display), search_m(self.display));
        let at = |z_m: f64| State { z_m, ..from.clone() };
        let steps = (1..=8).map(|n| 0.5 * f64::from(n)).chain((5..=10).map(f64::from));
        let steps = steps
            .chain((0..30).map(|n| 12.0 + 2.5 * f64::from(n)))
            .map(|step| step * depth);
        let all = steps.take_while(|step| *step <= most).flat_map(|step| [-step, step]);
        let mut all: Vec<_> = all.map(|step| at(self.right.z_m + step)).collect();
        all.push(at(self.right.z_m));
        let near = best(all, &likelihood).z_m;
        let width = depth.max(0.15 * (near - self.right.z_m).abs());
        at(golden([near - width, near + width], GOLDEN + 3, |z_m| {
            likelihood(&at(z_m))
        }))
    }

    fn range(&self, from: &State, sampled: &[Sampled]) -> State {
        let mut state = from.clone();
        for (laser, sampled) in sampled.iter().enumerate() {
            let mut with = from.clone();
            let mut likelihood = |range: f64| {
                with.range[laser] = range;
                score(&self.comparison.scene.light(&with, laser), sampled).likelihood
            };
            let all: Vec<_> = (3..=19)
                .map(|n| f64::from(n) / 10.0)
                .map(|range| (likelihood(range), range))
                .collect();
            let near = all
                .into_iter()
                .max_by(|a, b| a.0.total_cmp(&b.0))
                .map_or(1.0, |best| best.1);
            state.range[laser] = golden([near - 0.1, near + 0.1], GOLDEN, likelihood);
        }
        state
    }

    fn filter(&self, from: &State, likelihood: impl Fn(&State) -> f64) -> State {
        let at = |taps: [f64; 2]| State { taps, ..from.clone() };
        let along = [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
        let sizes = [-0.1, 0.06, 0.12, 0.19, 0.26];
        let all = along.iter().flat_map(|[h, v]| sizes.map(|tap| at([h * tap, v * tap])));
        let [mut h, mut v] = best(all.collect(), &likelihood).taps;
        if h != 0.0 {
            h = golden([h - 0.08, h + 0.08], GOLDEN, |h| likelihood(&at([h, v])));
        }
        if v != 0.0 {
            v = golden([v - 0.08, v + 0.08], GOLDEN, |v| likelihood(&at([h, v])));
        }
        at([h, v])
    }

    /// Returns `state` with levels enlarged by `zoom`, its picture at the same place of the photograph.
    fn scaled(&self, from: &State, zoom: f64) -> Result<State> {
        let roi = self.comparison.scene.roi;
        let map = super::score::map_of(from.corners, roi.size)?;
        let whole = self.comparison.scene.whole();
        let middle = [
            whole.width as f64 / 2.0 - roi.x as f64,
            whole.height as f64 / 2.0 - roi.y as f64,
        ];
        let (w, h) = (roi.size.width as f64, roi.size.height as f64);
        let by = from.zoom / zoom;
        let corner = |[x, y]: [f64; 2]| map.map([middle[0] + (x - middle[0]) * by, middle[1] + (y - middle[1]) * by]);
        Ok(State {
            zoom,
            corners: [[0.0, 0.0], [w, 0.0], [0.0, h], [w, h]].map(corner),
            ..from.clone()
        })
    }

    fn scale(&self, from: &State) -> Result<State> {
        let Size { width, height } = self.comparison.scene.roi.size;
        let laser = self.comparison.lasers() / 2;
        let fits = |state: &State| -> Result<f64> {
            let sampled = Sampled::new(
                &self.comparison.photographs[laser],
                state.corners,
                self.comparison.scene.roi.size,
            )?;
            Ok(score(&self.comparison.scene.light(state, laser), &sampled).likelihood)
        };
        let step = 0.5 / width.max(height) as f64;
        let count = (0.06 / step) as i32;
        let mut best = (f64::MIN, from.clone());
        for n in (-count..=count).filter(|n| n.abs() > 1) {
            let state = self.scaled(from, 1.0 + f64::from(n) * step)?;
            let fit = fits(&state)?;
            if fit > best.0 {
                best = (fit, state);
            }
        }
        let near = best.1.zoom;
        let of = |zoom: f64| {
            self.scaled(from, zoom)
                .and_then(|state| fits(&state))
                .unwrap_or(f64::MIN)
        };
        self.scaled(from, golden([near - step, near + step], GOLDEN, of))
    }

    /// Returns `from` with the light of a cause that adds coherently, of the amplitude and phase that fit best.
    fn stray(&self, cause: Cause, from: &State, sampled: &[Sampled]) -> State {
        let mut state = from.clone();
        let scene = &self.comparison.scene;
        for (laser, sampled) in sampled.iter().enumerate() {
            let (zero, twin) = (from.undiffracted[laser], from.conjugate[laser]);
            let (rest, basis) = match cause {
                Cause::ZeroOrder => ([Complex64::ONE, Complex64::ZERO, twin], [0.0, 1.0, 0.0]),
                _ => ([Complex64::ONE, zero, Complex64::ZERO], [0.0, 0.0, 1.0]),
            };
            let rest = scene.field(from, laser, rest, from.ghost[laser]);
            let basis = scene.field(from, laser, basis.map(Complex64::from), from.ghost[laser]);
            let added = self.added(&rest, &basis, from.blur, sampled).1;
            match cause {
                Cause::ZeroOrder => state.undiffracted[laser] = added,
                _ => state.conjugate[laser] = added,
            }
        }
        state
    }

    /// Returns the amplitude with which the field `basis` adds to the field `rest`, after its likelihood. The light of
    /// both is quadratic in it.
    fn added(&self, rest: &[Complex32], basis: &[Complex32], blur: f64, sampled: &Sampled) -> (f64, Complex64) {
        let scene = &self.comparison.scene;
        let plane = |value: &dyn Fn(Complex32, Complex32) -> f32| {
            let both = rest.iter().zip(basis);
            scene.blurred(both.map(|(rest, basis)| value(*rest, *basis)).collect(), blur)
        };
        let own = plane(&|rest, _| rest.norm_sqr());
        let square = plane(&|_, basis| basis.norm_sqr());
        let real = plane(&|rest, basis| 2.0 * (rest.conj() * basis).re);
        let imaginary = plane(&|rest, basis| -2.0 * (rest.conj() * basis).im);
        let likelihood = |a: Complex64| {
            let (r, i, s) = (a.re as f32, a.im as f32, a.norm_sqr() as f32);
            let light = Array2::from_shape_fn(own.dim(), |at| {
                own[at] + s * square[at] + r * real[at] + i * imaginary[at]
            });
            score(&light, sampled).likelihood
        };
        let polar = [0.08, 0.2, 0.4, 0.75]
            .into_iter()
            .flat_map(|radius| (0..6).map(move |n| Complex64::from_polar(radius, TAU * f64::from(n) / 6.0)));
        let start = polar.map(|a| (likelihood(a), a));
        let mut best = start.fold((likelihood(Complex64::ZERO), Complex64::ZERO), |best, next| {
            if next.0 > best.0 { next } else { best }
        });
        let mut step = (0.35 * best.1.norm()).max(0.02);
        while step > 0.004 {
            let around = best.1;
            for turn in 0..4 {
                let next = around + Complex64::from_polar(step, TAU * f64::from(turn) / 4.0);
                let fit = likelihood(next);
                if fit > best.0 {
                    best = (fit, next);
                }
            }
            if best.1 == around {
                step /= 2.0;
            }
        }
        best
    }

    /// Returns `from` with the ghost image that fits best.
    fn ghost(&self, from: &State, sampled: &[Sampled]) -> State {
        let none = State {
            ghost: vec![Complex64::ZERO; sampled.len()],
            ..from.clone()
        };
        let lasers = 0..sampled.len();
        let rest: Vec<_> = lasers
            .map(|laser| {
                let parts = [Complex64::ONE, none.undiffracted[laser], none.conjugate[laser]];
                (parts, self.comparison.scene.field(&none, laser, parts, Complex64::ZERO))
            })
            .collect();
        let copies = |state: &State, laser: usize| {
            let (parts, rest): &(Parts, Vec<Complex32>) = &rest[laser];
            let mut basis = self.comparison.scene.field(state, laser, *parts, Complex64::ONE);
            basis.iter_mut().zip(rest).for_each(|(both, rest)| *both -= rest);
            basis
        };
        let with = |shift: [f64; 2], path_m: f64| State {
            ghost_shift: shift,
            ghost_path_m: path_m,
            ..none.clone()
        };
        let at = |shift: [f64; 2], path_m: f64| -> (f64, State) {
            let mut state = with(shift, path_m);
            let mut sum = 0.0;
            for (laser, (_, rest)) in rest.iter().enumerate() {
                let (fit, added) = self.added(rest, &copies(&state, laser), from.blur, &sampled[laser]);
                (sum, state.ghost[laser]) = (sum + fit, added);
            }
            (sum, state)
        };
        let mut places = Vec::new();
        for depths in GHOST_PATHS {
            let path_m = depths * depth_of_focus_m(self.display);
            let pairs: Vec<_> = (rest.iter().enumerate())
                .map(|(laser, (_, rest))| (rest.as_slice(), copies(&with([0.0; 2], path_m), laser)))
                .collect();
            let found = self.ghost_shifts(&none, &pairs, sampled);
            places.extend(found.into_iter().map(|(gain, shift)| (gain, shift, path_m)));
        }
        places.sort_by(|a, b| b.0.total_cmp(&a.0));
        let tried = places
            .into_iter()
            .take(GHOSTS + 1)
            .map(|(_, shift, path_m)| at(shift, path_m));
        let mut best = tried.fold(
            (f64::MIN, none.clone()),
            |best, next| if next.0 > best.0 { next } else { best },
        );
        let depth_m = depth_of_focus_m(self.display);
        for [right, down, depths] in [
            [0.5, 0.0, 0.0],
            [-0.5, 0.0, 0.0],
            [0.0, 0.5, 0.0],
            [0.0, -0.5, 0.0],
            [0.0, 0.0, -2.0],
            [0.0, 0.0, 2.0],
        ] {
            let ([x, y], path_m) = (best.1.ghost_shift, best.1.ghost_path_m);
            let next = at([x + right, y + down], path_m + depths * depth_m);
            if next.0 > best.0 {
                best = next;
            }
        }
        best.1
    }

    /// Returns the shifts whose ghost image lowers what is left of the photographs fastest, by the gradient of its
    /// square: the correlation of each laser's field, weighted by what is left, with the ghost image's. Returns how
    /// fast, too.
    fn ghost_shifts(
        &self,
        state: &State,
        fields: &[(&[Complex32], Vec<Complex32>)],
        sampled: &[Sampled],
    ) -> Vec<(f64, [f64; 2])> {
        let (size @ Size { width, height }, [left, top]) = self.comparison.scene.around();
        let most = GHOST[1] as usize;
        let padded = Size {
            width: fast_size(width + most),
            height: fast_size(height + most),
        };
        let fft = Fft2::new(size, padded);
        let whole = Fft2::new(padded, padded);
        let correlation = |a: &[Complex32], b: &[Complex32]| -> Vec<Complex32> {
            let spectrum = |plane: &[Complex32]| {
                let mut scratch = fft.scratch();
                fft.rows_forward(plane, &mut scratch.rows, &mut scratch.work);
                fft.spectrum(&scratch.rows, &mut scratch.columns, |_, _, _| (), &mut scratch.work);
                scratch.columns
            };
            let (mut product, other) = (spectrum(a), spectrum(b));
            product.iter_mut().zip(other).for_each(|(a, b)| *a *= b.conj());
            let mut scratch = whole.scratch();
            whole.columns_inverse(&mut product, |_, _| (), &mut scratch.work);
            whole.rows_inverse(&product, &mut scratch.rows, &mut scratch.work);
            scratch.rows
        };
        let mut gains = vec![0.0f64; padded.pixels()];
        for (laser, (field, copy)) in fields.iter().enumerate() {
            let fit = score(&self.comparison.scene.light(state, laser), &sampled[laser]);
            let roi = self.comparison.scene.roi.size;
            let weighed = |value: &dyn Fn((usize, usize), Complex32) -> Complex32| -> Vec<Complex32> {
                let at = |at: usize| {
                    let (y, x) = (at / width, at % width);
                    let inside = (top..top + roi.height).contains(&y) && (left..left + roi.width).contains(&x);
                    if inside {
                        value((y - top, x - left), field[at])
                    } else {
                        Complex32::ZERO
                    }
                };
                (0..width * height).map(at).collect()
            };
            let missing = weighed(&|at, u| u * (sampled[laser].light[at] - fit.expected[at]) * fit.gain[at]);
            let energy = weighed(&|at, u| Complex32::from(u.norm_sqr() * fit.gain[at].powi(2)));
            let light: Vec<_> = copy.iter().map(|u| Complex32::from(u.norm_sqr())).collect();
            let (slope, norm) = (correlation(&missing, copy), correlation(&energy, &light));
            let least = norm.iter().map(|value| value.re).fold(0.0, f32::max) * 0.02;
            for ((gain, slope), norm) in gains.iter_mut().zip(slope).zip(norm) {
                *gain += f64::from(slope.norm_sqr() / norm.re.max(least).max(f32::MIN_POSITIVE));
            }
        }
        let signed = |k: usize, n: usize| if 2 * k < n { k as f64 } else { k as f64 - n as f64 };
        let mut all: Vec<_> = gains
            .into_iter()
            .enumerate()
            .map(|(at, gain)| {
                (
                    gain,
                    [
                        signed(at % padded.width, padded.width),
                        signed(at / padded.width, padded.height),
                    ],
                )
            })
            .filter(|(_, [x, y])| (GHOST[0]..GHOST[1]).contains(&x.hypot(*y)))
            .collect();
        all.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut shifts: Vec<(f64, [f64; 2])> = Vec::new();
        for (gain, [x, y]) in all {
            if shifts.len() == GHOSTS {
                break;
            }
            if shifts.iter().all(|(_, [u, v])| (u - x).hypot(v - y) > 3.0) {
                shifts.push((gain, [x, y]));
            }
        }
        shifts
    }
}

fn best(states: Vec<State>, likelihood: impl Fn(&State) -> f64) -> State {
    let all = states.into_iter().map(|state| (likelihood(&state), state));
    let best = all.max_by(|a, b| a.0.total_cmp(&b.0));
    best.expect("there are states to try").1
}

/// Returns the place of the largest value of `of` in a range by golden sections.
fn golden([mut low, mut high]: [f64; 2], steps: usize, mut of: impl FnMut(f64) -> f64) -> f64 {
    const PART: f64 = 0.618_033_988_749_895;
    let (mut a, mut b) = (high - PART * (high - low), low + PART * (high - low));
    let (mut at_a, mut at_b) = (of(a), of(b));
    for _ in 0..steps {
        if at_a > at_b {
            (high, b, at_b) = (b, a, at_a);
            a = high - PART * (high - low);
            at_a = of(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + PART * (high - low);
            at_b = of(b);
        }
    }
    if at_a > at_b { a } else { b }
}
