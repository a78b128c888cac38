//! Thin objects: threads, sticks and twigs, as shapes whose x and y are in pixels and whose z is already a depth.

use crate::scene::shapes::{Shape, turn};
use phasefront_io::dice::Dice;
use std::f64::consts::TAU;

/// Makes a thread along x that sags by `sag` pixels and extends `half` pixels to either side of its middle line. From
/// its left to its right end it comes nearer by `drop`, a fraction of the volume's depth.
pub(super) fn wire(length: f64, half: f64, sag: f64, drop: f64) -> Shape {
    Shape::grid(24, 1, |u, v| {
        let hang = sag * (4.0 * u * (u - 1.0) + 0.5);
        [length * (u - 0.5), hang + half * (2.0 * v - 1.0), drop * (u - 0.5)]
    })
}

/// Makes a straight [`wire`].
pub(super) fn stick(length: f64, half: f64, drop: f64) -> Shape {
    Shape::grid(1, 1, |u, v| {
        [length * (u - 0.5), half * (2.0 * v - 1.0), drop * (u - 0.5)]
    })
}

/// Makes twigs, grass or cracks: straight pieces that fork and become thinner. The first piece is `length` pixels long
/// and extends `half` pixels to either side.
pub(super) fn branches(dice: &mut Dice, length: f64, half: f64) -> Shape {
    let mut tips = vec![([0.0, 0.0, 0.0], TAU * dice.unit(), length, half)];
    let mut shape = Shape::default();
    let mut pieces = dice.integer(6, 60);
    while let Some((from, angle, length, half)) = tips.pop() {
        let (sin, cos) = libm::sincos(angle);
        let lean = dice.range(-0.03, 0.03);
        let to = [from[0] - sin * length, from[1] + cos * length, from[2] + lean];
        let middle = std::array::from_fn(|i| 0.5 * (from[i] + to[i]));
        let along = turn([0.0, 0.0, 1.0], angle);
        shape.append(&Shape::sheet().moved([half, 0.5 * length, 1.0], along, middle));
        for _ in 0..dice.integer(1, 3) {
            if pieces > 0 {
                pieces -= 1;
                let bent = angle + dice.range(-0.8, 0.8);
                let shorter = length * dice.range(0.6, 0.95);
                // The order is breadth first, so that no single twig takes all pieces.
                tips.insert(0, (to, bent, shorter, (half * 0.8).max(0.5)));
            }
        }
    }
    shape
}
