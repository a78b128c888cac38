//! The faults of a picture that arrives in another place, orientation or order of colours, or is covered, in words.

use super::shot::{Axis, Cover, Turn};
use phasefront::Size;

pub(super) fn turn_fault(turn: Turn) -> Option<String> {
    let how = match (turn.exchanged, turn.flip_x, turn.flip_y) {
        (false, false, false) => return None,
        (false, true, true) => "rotated by 180°",
        (false, true, false) => "mirrored left to right",
        (false, false, true) => "mirrored top to bottom",
        (true, true, false) | (true, false, true) => "rotated by 90°",
        (true, ..) => "mirrored about a diagonal",
    };
    Some(format!(
        "{how}: set the screen's orientation to landscape, or flip_x and flip_y in the display's file if the modulator needs it"
    ))
}

pub(super) fn order_fault(order: Option<[usize; 3]>) -> Option<String> {
    let Some(order) = order else {
        return Some("no colour: red, green and blue arrive alike; capture in RGB".into());
    };
    if order == [0, 1, 2] {
        return None;
    }
    const NAMES: [&str; 3] = ["red", "green", "blue"];
    let moved: Vec<_> = (0..3)
        .filter(|colour| order[*colour] != *colour)
        .map(|colour| format!("{} arrives as {}", NAMES[colour], NAMES[order[colour]]))
        .collect();
    let name = if order == [2, 1, 0] { "BGR" } else { "colours swapped" };
    Some(format!(
        "{name}: {}; change the order of colours in the driver or the converter",
        moved.join(", ")
    ))
}

pub(super) fn axis_faults(x: &Axis, y: &Axis) -> Vec<String> {
    if (x.seen, y.seen) != (x.sent, y.sent) {
        return vec![format!(
            "scaled: {}×{} arrive of {}×{}; set the screen to the modulator's own resolution",
            x.seen, y.seen, x.sent, y.sent
        )];
    }
    let percent = |axis: &Axis| 100.0 * axis.enlargement();
    // Half a pixel at the edge of the frame.
    let zooms = |axis: &Axis| (axis.enlargement() - 1.0).abs() * axis.seen as f64 > 0.5;
    let mut faults = Vec::new();
    match (zooms(x), zooms(y)) {
        (true, true) if (x.enlargement() > 1.0) == (y.enlargement() > 1.0) => {
            let (name, what) = if x.enlargement() > 1.0 {
                ("overscan", "the edges are cut off")
            } else {
                ("underscan", "a border is added")
            };
            faults.push(format!(
                "{name}: the picture arrives at {:.1} % of its width and {:.1} % of its height, and {what}; set overscan and underscan to 0 in the driver",
                percent(x),
                percent(y)
            ));
        }
        (true, true) => faults.push(format!(
            "rows and columns resampled: the picture arrives at {:.1} % of its width and {:.1} % of its height; set the screen to the modulator's own resolution",
            percent(x),
            percent(y)
        )),
        (wide, high) => {
            for (is, name, axis, side) in [
                (wide, "columns resampled", x, "width"),
                (high, "rows resampled", y, "height"),
            ] {
                if is {
                    faults.push(format!(
                        "{name}: the picture arrives at {:.1} % of its {side}; set the screen to the modulator's own resolution",
                        percent(axis)
                    ));
                }
            }
        }
    }
    if faults.is_empty() && !(x.is_exact() && y.is_exact()) {
        faults.push(format!(
            "shifted: the picture arrives {:.1} pixels to the right and {:.1} down; set the position to 0 in the driver",
            x.shift, y.shift
        ));
    }
    faults
}

pub(super) fn cover_fault(cover: Cover, Size { width, height }: Size) -> String {
    let Cover { x, y, size } = cover;
    let (wide, high) = (5 * size.width >= 4 * width, 5 * size.height >= 4 * height);
    let at = match (wide, high) {
        (true, false) if y + size.height == height => Some(format!("the lower {} rows", size.height)),
        (true, false) if y == 0 => Some(format!("the upper {} rows", size.height)),
        (false, true) if x == 0 => Some(format!("the left {} columns", size.width)),
        (false, true) if x + size.width == width => Some(format!("the right {} columns", size.width)),
        _ => None,
    };
    match at {
        Some(at) => format!(
            "taskbar: a bar hides up to {at}; show the frame in full screen, over all bars, with `phasefront show`"
        ),
        None => format!(
            "covered: {} pixels at ({x}, {y}) show something else, a window, a pointer or a logo; show the frame over all else with `phasefront show`",
            size
        ),
    }
}
