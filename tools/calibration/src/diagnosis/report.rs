//! The words of a diagnosis: for each cause its name, the evidence with a figure, and the next step.

use super::Finding;
use super::cause::{Cause, Search, share};
use super::state::{Chroma, State};
use phasefront::Display;

/// Returns the finding of a cause that is in `state`.
pub(super) fn finding(cause: Cause, search: &Search<'_>, state: &State, confidence: f64) -> Finding {
    let (evidence, next) = match cause {
        Cause::ZeroOrder | Cause::Conjugate | Cause::Ghost => stray(cause, state),
        Cause::Distance | Cause::Blur => sharpness(cause, search, state),
        Cause::Range => range(search.display, state),
        Cause::Inverted => (
            format!(
                "phases fall as levels rise; a camera focused at {} would see the same",
                mm(2.0 * search.display.offset_m() - state.z_m)
            ),
            "invert the table of levels in the driver, or measure the curve, `phasefront calibrate lut`; `phasefront pattern lens` must converge".into(),
        ),
        Cause::Bend => (
            format!("levels act as if raised to the power {:.2}", state.tone),
            "take gamma and colour profiles away, `phasefront link read`; then measure the curve, `phasefront calibrate lut`".into(),
        ),
        Cause::Order | Cause::Filter | Cause::Scale | Cause::Colours => link(cause, state),
    };
    Finding {
        cause: name(cause),
        confidence,
        evidence,
        next,
    }
}

fn mm(m: f64) -> String {
    format!("{:+.2} mm", m * 1e3)
}

fn stray(cause: Cause, state: &State) -> (String, String) {
    let percent = |amplitudes| format!("{:.1} %", 100.0 * share(amplitudes));
    match cause {
        Cause::ZeroOrder => (
            format!("{} of the panel's light is not modulated", percent(&state.undiffracted)),
            "`phasefront pattern checkerboard`: turn the half-wave plate until the spot in the middle is darkest; `carrier_mrad` moves the picture away from what stays".into(),
        ),
        Cause::Conjugate => (
            format!("{} of the light makes the conjugate image", percent(&state.conjugate)),
            "`phasefront pattern grating`: turn the polarizers until the spot on the other side is darkest; if it stays, measure the curve, `phasefront calibrate lut`".into(),
        ),
        _ => {
            let [x, y] = state.ghost_shift;
            (
                format!(
                    "a second image with {} of the light lies {:.1} pixels to the {} and {:.1} {}",
                    percent(&state.ghost),
                    x.abs(),
                    if x < 0.0 { "left" } else { "right" },
                    y.abs(),
                    if y < 0.0 { "up" } else { "down" },
                ),
                "a surface between panel and camera reflects: tilt windows, filters and the beam splitter one after another until the image moves, and block it".into(),
            )
        }
    }
}

fn sharpness(cause: Cause, search: &Search<'_>, state: &State) -> (String, String) {
    if cause == Cause::Blur {
        return (
            format!(
                "blurred by {:.1} pixels (standard deviation), beside what the hologram does",
                state.blur
            ),
            "focus the camera's lens, and keep it still: a wrong z does not explain the blur".into(),
        );
    }
    let away_m = state.z_m - search.right.z_m;
    (
        format!(
            "sharp for z = {}, {} from where the camera should focus",
            mm(state.z_m),
            mm(away_m)
        ),
        format!(
            "move the camera's focus by {}, or make the hologram with `offset_mm = {:.2}`; `phasefront refocus HOLOGRAM --z-mm {:.2}` shows what it sees now",
            mm(-away_m),
            (search.display.offset_m() - away_m) * 1e3,
            state.z_m * 1e3
        ),
    )
}

fn link(cause: Cause, state: &State) -> (String, String) {
    let check = "`phasefront link pattern` and `phasefront link read`";
    match cause {
        Cause::Order => {
            let [r, g, b] = state.order.map(|laser| ["red", "green", "blue"][laser]);
            (
                format!("red, green and blue show the levels of {r}, {g} and {b}"),
                format!("swap the colours of the frame or of the lasers; {check} tell which"),
            )
        }
        Cause::Filter => {
            let [h, v] = state.taps.map(|tap| 100.0 * tap);
            (
                format!("each level takes {h:.0} % from each neighbour in its row, {v:.0} % from those in its column"),
                format!(
                    "{check}: take sharpness and scaling away; `phasefront calibrate model` learns the panel's own crosstalk"
                ),
            )
        }
        Cause::Scale => (
            format!(
                "levels arrive {:+.2} % larger, between the panel's pixels",
                100.0 * (state.zoom - 1.0)
            ),
            format!("set the screen to its own resolution without overscan; check with {check}"),
        ),
        _ => {
            let Chroma::Shared { wide, high } = state.chroma else {
                return Default::default();
            };
            (
                format!(
                    "{wide}×{high} pixels share their colours, as in YCbCr 4:2:{}",
                    if high == 1 { 2 } else { 0 }
                ),
                format!("set the link to RGB, 4:4:4; check with {check}"),
            )
        }
    }
}

fn range(display: &Display, state: &State) -> (String, String) {
    let list = |digits: usize| {
        let all: Vec<_> = state.range.iter().map(|range| format!("{range:.digits$}")).collect();
        match all.as_slice() {
            [one] => one.clone(),
            all => format!("[{}]", all.join(", ")),
        }
    };
    let nm: Vec<_> = display
        .wavelengths_m()
        .iter()
        .map(|l| format!("{:.0}", l * 1e9))
        .collect();
    let mean = state.range.iter().sum::<f64>() / state.range.len() as f64;
    let limited = (mean - 219.0 / 255.0).abs() < 0.02;
    (
        format!(
            "levels span {} of the phase that the display's file says, at {} nm",
            list(2),
            nm.join(", ")
        ),
        format!(
            "set `range_turns = {}` if the file says nothing of the range, else multiply; {}",
            list(2),
            if limited {
                "or the link sends the limited range 16 to 235: `phasefront link read`"
            } else {
                "`phasefront calibrate lut` measures it"
            }
        ),
    )
}

fn name(cause: Cause) -> &'static str {
    match cause {
        Cause::ZeroOrder => "zero order",
        Cause::Conjugate => "conjugate image",
        Cause::Ghost => "ghost image",
        Cause::Distance => "wrong distance",
        Cause::Range => "wrong phase range",
        Cause::Inverted => "inverted curve",
        Cause::Order => "colour order",
        Cause::Filter => "link filters pixels",
        Cause::Scale => "link scales pixels",
        Cause::Colours => "link mixes colours",
        Cause::Bend => "bent curve",
        Cause::Blur => "blurred photograph",
    }
}

/// Returns the finding of a turned or mirrored picture.
pub(super) fn turned(cause: &'static str, mirrored: bool, confidence: f64) -> Finding {
    Finding {
        cause,
        confidence,
        evidence: "the picture fits in no other orientation as well".into(),
        next: match (cause, mirrored) {
            ("mirrored left to right", _) => {
                "set `flip_x = true` in the display's file, unless the camera sees the picture through a mirror"
            }
            ("mirrored top to bottom", _) => {
                "set `flip_y = true` in the display's file, unless the camera sees the picture through a mirror"
            }
            ("rotated by 180°", _) => {
                "set `flip_x = true` and `flip_y = true` in the display's file, or turn the camera"
            }
            (_, true) => {
                "turn the camera upright; what is left is a mirror: `flip_x` or `flip_y` of the display's file"
            }
            (_, false) => "turn the camera upright, or the panel's screen in the system's settings",
        }
        .into(),
    }
}

/// Returns the finding of a photograph of which `share` of the pixels are at the sensor's limit.
pub(super) fn saturated(share: f64) -> Finding {
    Finding {
        cause: "saturated photograph",
        confidence: 0.999,
        evidence: format!("{:.1} % of the pixels are at the sensor's limit", 100.0 * share),
        next: "expose it shorter and photograph it again; what is at the limit says nothing about the display".into(),
    }
}
