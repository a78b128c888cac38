//! Where the pattern lies in a capture: its orientation, the order of colours, enlargement and shift.

use super::pattern::{Layout, Part};
use super::shot::{Axis, Cover, Seen, Shot, Turn};
use phasefront::Size;

/// Returns the correlation of pairs, from -1 to 1, or 0 if one side is constant.
fn correlation(pairs: impl Iterator<Item = (f64, f64)>) -> f64 {
    let [mut n, mut a, mut b, mut aa, mut bb, mut ab] = [0.0; 6];
    for (x, y) in pairs {
        n += 1.0;
        a += x;
        b += y;
        aa += x * x;
        bb += y * y;
        ab += x * y;
    }
    let spread = (n * aa - a * a) * (n * bb - b * b);
    if spread > 0.0 {
        (n * ab - a * b) / spread.sqrt()
    } else {
        0.0
    }
}

/// Returns the means of a grid of squares, from the grey value of each pixel.
fn thumbnail(Size { width, height }: Size, grey: impl Fn(usize, usize) -> f64) -> Vec<f64> {
    const GRID: usize = 28;
    let mut sums = vec![(0.0, 0.0); GRID * GRID];
    for y in 0..height {
        for x in 0..width {
            let (sum, count) = &mut sums[y * GRID / height * GRID + x * GRID / width];
            *sum += grey(y, x);
            *count += 1.0;
        }
    }
    sums.iter().map(|(sum, count)| sum / f64::max(*count, 1.0)).collect()
}

/// Returns how a capture of the pattern `layout` is turned, or `None` if it does not show the pattern.
pub(super) fn turn(shot: &Shot, layout: Layout) -> Option<Turn> {
    let want = thumbnail(layout.size, |y, x| {
        layout.pixel(y, x).iter().map(|value| f64::from(*value)).sum::<f64>() / 3.0
    });
    // A turn by 90° exchanges the sides of the capture.
    let (width, height) = (layout.size.width, layout.size.height);
    let turned = width != height
        && shot.size
            == Size {
                width: height,
                height: width,
            };
    let mut best = (0.3, None);
    for exchanged in [false, true]
        .into_iter()
        .filter(|exchanged| *exchanged == turned || width == height)
    {
        for [flip_x, flip_y] in [[false, false], [true, false], [false, true], [true, true]] {
            let turn = Turn {
                exchanged,
                flip_x,
                flip_y,
            };
            let upright = shot.turned_back(turn);
            let seen = thumbnail(upright.size, |y, x| upright.grey(y, x));
            let fits = correlation(seen.into_iter().zip(want.iter().copied()));
            if fits > best.0 {
                best = (fits, Some(turn));
            }
        }
    }
    best.1
}

/// The width over which rulers are compared, in pixels: a blur up to it moves no edge.
const BLUR: f64 = 3.0;

/// Returns the level of the ruler at each tenth of a pixel, blurred over [`BLUR`].
fn ruler(length: usize) -> Vec<f32> {
    let level = |at: f64| f64::from(Layout::ruler(length, (at.max(0.0) as usize).min(length - 1)));
    let place = |tenth: usize| tenth as f64 / 10.0;
    let parts = (BLUR * 10.0) as usize;
    let mean = |tenth: usize| {
        let first = place(tenth) - BLUR / 2.0 + 0.05;
        (0..parts).map(|part| level(first + place(part))).sum::<f64>() / parts as f64
    };
    (0..=10 * length).map(|tenth| mean(tenth) as f32).collect()
}

/// Finds the place of the ruler in `profile`, the mean level along an axis, near `start`. The ruler is that of the part
/// `range` of the pattern. Returns the correlation with it too.
fn along(profile: &[f64], range: &std::ops::Range<usize>, start: Axis) -> (f64, Axis) {
    let ruler = ruler(start.sent);
    let (first, last) = (range.start as f64 + BLUR, range.end as f64 - BLUR);
    let fits = |axis: &Axis, stride: usize| {
        let pairs = (0..profile.len()).step_by(stride).filter_map(|at| {
            let place = axis.place(at);
            (place >= first && place < last).then(|| (profile[at], f64::from(ruler[(10.0 * place).round() as usize])))
        });
        // Little of the ruler fits anywhere.
        let visible = (axis.zoom * (last - first)).min(profile.len() as f64 - axis.shift.abs());
        if visible < 0.6 * range.len() as f64 {
            -1.0
        } else {
            correlation(pairs)
        }
    };
    // A picture at its own place fits almost as well as any other.
    let own = fits(&start, 1);
    let cell = Layout::cell(start.sent) as f64;
    let (mut step_zoom, mut step_shift) = (cell / start.seen as f64, cell / 3.0);
    let mut best = (own, start);
    if own < 0.9 {
        let zooms = (0.25 / step_zoom) as i32;
        let shifts = (start.seen as f64 / 8.0 / step_shift) as i32;
        for (zoom, shift) in (-zooms..=zooms).flat_map(|zoom| (-shifts..=shifts).map(move |shift| (zoom, shift))) {
            let axis = Axis {
                zoom: start.zoom * (1.0 + f64::from(zoom) * step_zoom),
                shift: f64::from(shift) * step_shift,
                ..start
            };
            let fit = fits(&axis, (cell / 2.0) as usize);
            if fit > best.0 {
                best = (fit, axis);
            }
        }
        best.0 = fits(&best.1, 1);
    }
    while step_shift > 0.01 {
        let around = best.1;
        for (zoom, shift) in (-1..=1).flat_map(|zoom| (-1..=1).map(move |shift| (zoom, shift))) {
            let axis = Axis {
                zoom: around.zoom * (1.0 + f64::from(zoom) * step_zoom),
                shift: around.shift + f64::from(shift) * step_shift,
                ..around
            };
            let fit = fits(&axis, 1);
            if fit > best.0 + 1e-9 {
                best = (fit, axis);
            }
        }
        if best.1 == around {
            (step_zoom, step_shift) = (step_zoom / 2.0, step_shift / 2.0);
        }
    }
    if own > best.0 - 0.003 { (own, start) } else { best }
}

/// Finds the place of the pattern in an upright capture, along x and y. Returns `None` if its rulers are not there.
pub(super) fn place(shot: &Shot, layout: Layout) -> Option<(Axis, Axis)> {
    let Size { width, height } = shot.size;
    let fitted = [
        Axis::fitted(width, layout.size.width),
        Axis::fitted(height, layout.size.height),
    ];
    let (mut x, mut y) = ((0.0, fitted[0]), (0.0, fitted[1]));
    let middle = |range: &std::ops::Range<usize>, axis: &Axis, at: usize| {
        let quarter = range.len() as f64 / 4.0;
        let place = axis.place(at);
        place >= range.start as f64 + quarter && place < range.end as f64 - quarter
    };
    // The place along one axis says where the ruler of the other one is.
    for _ in 0..2 {
        let upper_and_lower = [0, 1].map(|n| {
            let (rows, columns) = layout.area(Part::RulerX(n));
            let inside: Vec<_> = (0..height).filter(|row| middle(&rows, &y.1, *row)).collect();
            let mean = |column: usize| {
                inside.iter().map(|row| shot.grey(*row, column)).sum::<f64>() / inside.len().max(1) as f64
            };
            along(&(0..width).map(mean).collect::<Vec<_>>(), &columns, fitted[0])
        });
        let [upper, lower] = upper_and_lower;
        x = if lower.0 > upper.0 + 0.01 { lower } else { upper };
        let (rows, columns) = layout.area(Part::RulerY);
        let inside: Vec<_> = (0..width).filter(|column| middle(&columns, &x.1, *column)).collect();
        let mean =
            |row: usize| inside.iter().map(|column| shot.grey(row, *column)).sum::<f64>() / inside.len().max(1) as f64;
        y = along(&(0..height).map(mean).collect::<Vec<_>>(), &rows, fitted[1]);
    }
    (x.0 > 0.5 && y.0 > 0.5).then_some((x.1, y.1))
}

/// Returns the channel in which each of red, green and blue arrives, or `None` if the capture has no colours.
pub(super) fn order(seen: &Seen) -> Option<[usize; 3]> {
    let mut rise = [[0.0; 3]; 3];
    for (colour, rise) in rise.iter_mut().enumerate() {
        let (_, columns) = seen.layout.area(Part::Ramp(1 + colour));
        let middle = usize::midpoint(columns.start, columns.end);
        let mut halves = [([0.0; 3], 0.0); 2];
        seen.each(Part::Ramp(1 + colour), |(y, x), (_, u)| {
            let (sum, count) = &mut halves[usize::from(u >= middle)];
            let rgb = seen.shot.at(y, x);
            *sum = std::array::from_fn(|c| sum[c] + f64::from(rgb[c]));
            *count += 1.0;
        });
        let [(dark, few), (light, many)] = halves;
        *rise = std::array::from_fn(|c| light[c] / f64::max(many, 1.0) - dark[c] / f64::max(few, 1.0));
    }
    let orders = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    let value = |order: &[usize; 3]| (0..3).map(|colour| rise[colour][order[colour]]).sum::<f64>();
    let best = orders.into_iter().max_by(|a, b| value(a).total_cmp(&value(b)))?;
    let all: f64 = rise.iter().flatten().sum();
    // Without colours, each channel has a third of all.
    (value(&best) > 0.5 * all).then_some(best)
}

/// Finds a rectangle in which the capture shows something else than the pattern. `curve` is the arriving level of each
/// level that is sent.
pub(super) fn cover(seen: &Seen, curve: impl Fn(u8) -> f64) -> Option<Cover> {
    /// The side of the squares that are compared.
    const SIDE: usize = 8;
    /// Levels by which another picture differs; a link's other faults change the mean of a square by less.
    const APART: f64 = 32.0;
    let Size { width, height } = seen.shot.size;
    let (mut foreign, mut whole) = (0, 0);
    let (mut left, mut top, mut right, mut bottom) = (width, height, 0, 0);
    let columns: Vec<_> = (0..width).map(|x| seen.x.pixel(x)).collect();
    for y in (0..height / SIDE).map(|n| n * SIDE) {
        for x in (0..width / SIDE).map(|n| n * SIDE) {
            let mut apart = Some(0.0);
            for (y, x) in (y..y + SIDE).flat_map(|y| (x..x + SIDE).map(move |x| (y, x))) {
                apart = match (apart, seen.y.pixel(y), columns[x]) {
                    (Some(apart), Some(v), Some(u)) => {
                        let want = seen.layout.pixel(v, u).map(&curve).iter().sum::<f64>() / 3.0;
                        Some(apart + seen.shot.grey(y, x) - want)
                    }
                    _ => None,
                };
            }
            let Some(apart) = apart else { continue };
            whole += 1;
            if apart.abs() > APART * (SIDE * SIDE) as f64 {
                foreign += 1;
                (left, top) = (left.min(x), top.min(y));
                (right, bottom) = (right.max(x + SIDE), bottom.max(y + SIDE));
            }
        }
    }
    if foreign == 0 || 2 * foreign > whole {
        return None;
    }
    // What hides the pattern ends somewhere in the squares around.
    let wider = |at: usize, most: usize| if at + 2 * SIDE > most { most } else { at + SIDE };
    let lower = |at: usize| if at < 2 * SIDE { 0 } else { at - SIDE };
    let (x, y) = (lower(left), lower(top));
    Some(Cover {
        x,
        y,
        size: Size {
            width: wider(right, width) - x,
            height: wider(bottom, height) - y,
        },
    })
}
