//! Converts a network's output to the complex field that it represents.

use super::InputKind;
use crate::parallel::prelude::*;
use crate::runtime::error::Error;
use crate::runtime::error::Result;
use num_complex::Complex32;
use phasefront_kernels::wide;

/// The number of pixels of a parallel part, and of a piece that is processed at once.
const PART: usize = 1 << 12;
const PIECE: usize = 256;

/// The representation of a complex field of three colours by a network's six output planes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Head {
    /// The paper's representation: with `t` the tanh of the last layer, amplitude `(t[c] + 1)·√½ ∈ [0, √2]` and phase
    /// `π·t[3+c]`.
    AmplitudePhase,
    /// A correction `o` of the input. The real part is `rgb[c] + o[c]`, with the front image `rgb` in [0, 1], and the
    /// imaginary part is `o[3+c]`. If the input is or holds a field `u`, the result is instead
    /// `u[c] + o[c] + i·o[3+c]`.
    RealImaginary,
}

impl Head {
    /// Returns the name in a network's metadata, `phasefront.head`.
    pub fn name(self) -> &'static str {
        match self {
            Head::AmplitudePhase => "amplitude-phase",
            Head::RealImaginary => "real-imaginary",
        }
    }

    /// Turns `output` (6, H, W) into `field` (3, H, W), without the carrier, at z = 0 (or at the plane of the input for
    /// a pre-filter).
    ///
    /// `input` is the network's input, planes of `kind`; only [`Head::RealImaginary`] reads it. Runs on the current
    /// rayon pool and allocates nothing.
    ///
    /// # Errors
    /// Returns an error if the lengths do not match.
    pub fn field(self, kind: InputKind, output: &[f32], input: &[f32], field: &mut [Complex32]) -> Result<()> {
        self.field_of(kind, &[0, 1, 2], output, input, field)
    }

    /// Works like [`Self::field`] for some `colours` of the output, in their order.
    pub(super) fn field_of(
        self,
        kind: InputKind,
        colours: &[usize],
        output: &[f32],
        input: &[f32],
        field: &mut [Complex32],
    ) -> Result<()> {
        let (count, area) = (colours.len(), field.len() / colours.len());
        if field.len() != count * area || output.len() != 6 * area || input.len() != kind.channels() * area {
            return Err(Error::Frame(format!(
                "head: output {}, input {} and field {} values; 6, {} and {count} planes of one size are right",
                output.len(),
                input.len(),
                field.len(),
                kind.channels()
            )));
        }
        if area == 0 {
            return Ok(());
        }
        for (colour, plane) in colours.iter().zip(field.chunks_exact_mut(area)) {
            plane.par_chunks_mut(PART).enumerate().for_each(|(part, run)| {
                let at = part * PART;
                let values = std::array::from_fn(|k| &output[k * area + at..][..run.len()]);
                let base = |plane: usize, from: usize, into: &mut [f32]| {
                    into.copy_from_slice(&input[plane * area + at + from..][..into.len()]);
                };
                wide!(self.row(kind, &[*colour], values, base, [run]));
            });
        }
        Ok(())
    }

    /// Computes a run of pixels of [`Head::field`] for these `colours` of the output. `base` reads pixels of an input
    /// plane, starting at the given pixel of the run.
    #[inline(always)]
    pub(super) fn row<const C: usize>(
        self,
        kind: InputKind,
        colours: &[usize; C],
        values: [&[f32]; 6],
        base: impl Fn(usize, usize, &mut [f32]),
        field: [&mut [Complex32]; C],
    ) {
        if self == Head::AmplitudePhase {
            return Self::amplitude_phase(colours, values, field);
        }
        for (&c, field) in colours.iter().zip(field) {
            let (first, second) = (values[c], values[3 + c]);
            let (mut re, mut im) = ([0.0; PIECE], [0.0; PIECE]);
            for (piece, out) in field.chunks_mut(PIECE).enumerate() {
                let (at, count) = (piece * PIECE, out.len());
                match kind {
                    InputKind::Field | InputKind::BlurredField => {
                        base(c, at, &mut re[..count]);
                        base(3 + c, at, &mut im[..count]);
                    }
                    InputKind::SplitBlurredField => {
                        for (plane, part) in [(c, &mut re), (3 + c, &mut im)] {
                            let mut remainder = [0.0; PIECE];
                            base(plane, at, &mut part[..count]);
                            base(6 + plane, at, &mut remainder[..count]);
                            for (value, remainder) in part.iter_mut().zip(&remainder) {
                                *value += remainder / InputKind::REMAINDER_GAIN;
                            }
                        }
                    }
                    InputKind::Seeded => {
                        // A seed u is encoded as ½(Re u − ½) and ½ Im u, after RGB-D.
                        base(4 + c, at, &mut re[..count]);
                        base(7 + c, at, &mut im[..count]);
                        re[..count].iter_mut().for_each(|re| *re = 2.0 * *re + 0.5);
                        im[..count].iter_mut().for_each(|im| *im *= 2.0);
                    }
                    InputKind::Rgbd | InputKind::RgbdXy | InputKind::Ldi { .. } => {
                        base(c, at, &mut re[..count]);
                        // Colours are encoded minus a half.
                        re[..count].iter_mut().for_each(|re| *re += 0.5);
                    }
                }
                let parts = out.iter_mut().zip(&first[at..]).zip(&second[at..]);
                for (((out, first), second), (re, im)) in parts.zip(re.iter().zip(&im)) {
                    *out = Complex32::new(re + first, im + second);
                }
            }
        }
    }

    /// Computes a run of pixels of [`Head::AmplitudePhase`].
    #[inline(always)]
    pub(super) fn amplitude_phase<const C: usize>(
        colours: &[usize; C],
        values: [&[f32]; 6],
        field: [&mut [Complex32]; C],
    ) {
        for (&c, field) in colours.iter().zip(field) {
            for ((out, a), p) in field.iter_mut().zip(values[c]).zip(values[3 + c]) {
                let amplitude = (a + 1.0) * std::f32::consts::FRAC_1_SQRT_2;
                let (sin, cos) = sin_cos_pi(*p);
                *out = Complex32::new(amplitude * cos, amplitude * sin);
            }
        }
    }
}

/// Returns `(sin πt, cos πt)` for |t| ≤ 1e6, to 2e-7. It has no branches, so loops over it vectorise.
#[inline(always)]
fn sin_cos_pi(t: f32) -> (f32, f32) {
    // Reduce to r in [-1/4, 1/4], t = r + k/2. Adding 1.5·2²³ rounds to an integer and leaves it in the low bits.
    const ROUND: f32 = 12_582_912.0;
    let shifted = 2.0 * t + ROUND;
    let quarter = shifted.to_bits();
    let r = t - 0.5 * (shifted - ROUND);
    let r2 = r * r;
    // Taylor series of sin πr and cos πr. The first omitted term is below 1e-8 on the interval.
    let sin =
        r * (std::f32::consts::PI + r2 * (-5.167_713 + r2 * (2.550_164 + r2 * (-0.599_264_5 + r2 * 0.082_145_89))));
    let cos = 1.0 + r2 * (-4.934_802 + r2 * (4.058_712 + r2 * (-1.335_263 + r2 * (0.235_330_63 + r2 * -0.025_806_89))));
    // Odd quarters swap sine and cosine. The second bit of k gives the sign.
    let odd = 0u32.wrapping_sub(quarter & 1);
    let (s, c) = (sin.to_bits(), cos.to_bits());
    let (s, c) = ((s & !odd) | (c & odd), (c & !odd) | (s & odd));
    let sign_sin = (quarter & 2) << 30;
    let sign_cos = (quarter.wrapping_add(1) & 2) << 30;
    (f32::from_bits(s ^ sign_sin), f32::from_bits(c ^ sign_cos))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn sine_and_cosine_agree_with_f64() {
        for k in -40_000..=40_000 {
            let t = k as f32 / 20_000.0;
            let (sin, cos) = sin_cos_pi(t);
            let exact = f64::from(t) * std::f64::consts::PI;
            assert!((f64::from(sin) - exact.sin()).abs() < 3e-7, "sin π·{t}: {sin}");
            assert!((f64::from(cos) - exact.cos()).abs() < 3e-7, "cos π·{t}: {cos}");
        }
    }

    #[test]
    fn heads_follow_their_definitions() {
        // Two pixels, with one plane for each colour.
        let output: Vec<f32> = (0..12).map(|k| (k as f32 - 5.5) / 6.0).collect();
        let input: Vec<f32> = (0..8).map(|k| k as f32 / 8.0 - 0.5).collect();
        let mut field = vec![Complex32::default(); 6];
        Head::AmplitudePhase
            .field(InputKind::Rgbd, &output, &input, &mut field)
            .unwrap();
        for (k, value) in field.iter().enumerate() {
            let expected =
                Complex32::from_polar((output[k] + 1.0) * 0.5f32.sqrt(), std::f32::consts::PI * output[6 + k]);
            assert!((value - expected).norm() < 1e-6, "{k}: {value} against {expected}");
        }
        Head::RealImaginary
            .field(InputKind::Rgbd, &output, &input, &mut field)
            .unwrap();
        for (k, value) in field.iter().enumerate() {
            let expected = Complex32::new(k as f32 / 8.0 + output[k], output[6 + k]);
            assert!((value - expected).norm() < 1e-6, "{k}: {value} against {expected}");
        }
        let there: Vec<f32> = (0..12).map(|k| (k as f32 * 0.7).sin()).collect();
        Head::RealImaginary
            .field(InputKind::Field, &output, &there, &mut field)
            .unwrap();
        for (k, value) in field.iter().enumerate() {
            let expected = Complex32::new(there[k] + output[k], there[6 + k] + output[6 + k]);
            assert!((value - expected).norm() < 1e-6, "{k}: {value} against {expected}");
        }
    }

    #[test]
    fn wrong_lengths_are_refused() {
        let mut field = vec![Complex32::default(); 3];
        for (kind, output, input) in [
            (InputKind::Rgbd, 5, 4),
            (InputKind::Rgbd, 6, 3),
            (InputKind::Field, 6, 4),
        ] {
            let (output, input) = (vec![0.0; output], vec![0.0; input]);
            let head = Head::RealImaginary;
            assert!(head.field(kind, &output, &input, &mut field).is_err());
        }
    }
}
