//! The planes that a point is on, and the share of light that it blocks and emits there.
//!
//! A point between two planes is on both. On each it blocks a share of the light from behind and emits the same share
//! of its own. The nearer it is to a plane, the larger the share. One of the two shares is always 1, so nothing shines
//! through a surface, and the sum of the light is the point's amplitude. At [`MEET`] of the way from the rear plane to
//! the front plane both shares are 1.
//!
//! [`mod@super::reference`] states the rule plainly. Tiles evaluate it for runs of points.

use super::Sweep;

/// The part of the way from the rear to the front plane at which a point is fully on both planes. It was chosen by
/// quality on validation scenes.
pub const MEET: f32 = 0.65;

/// The planes of a point: twice the plane's index if the point is on one plane, and one more than twice the front
/// plane's index if it is between two.
pub(super) type Slot = u16;

impl Sweep {
    /// Returns the position of normalized `depth` among the planes: k on plane k, where 0 is the nearest. Points before
    /// the first plane are on it, and points behind the last are on that one.
    pub(super) fn position(&self, depth: f32) -> f32 {
        let position = depth * self.planes as f32;
        let position = if self.between_planes {
            position - 0.5
        } else {
            position.floor()
        };
        position.clamp(0.0, (self.planes - 1) as f32)
    }

    /// Returns the planes of a point of normalized `depth`.
    pub(super) fn slot(&self, depth: f32) -> Slot {
        let position = self.position(depth);
        (position.floor() + position.ceil()) as Slot
    }
}

/// The share of points on one of their planes as a linear function of their depth, up to 1.
#[derive(Clone, Copy)]
pub(super) struct Share {
    at_zero: f32,
    slope: f32,
}

impl Share {
    /// Returns the share on plane `k` among `planes` of points between it and the next plane in front of it or behind
    /// it.
    pub(super) fn on(k: usize, planes: usize, behind_plane: bool) -> Self {
        // 1 on the plane, 0 on the other.
        let (towards, gain) = if behind_plane {
            (-1.0, 1.0 / MEET)
        } else {
            (1.0, 1.0 / (1.0 - MEET))
        };
        Share {
            at_zero: gain * (1.0 - towards * (k as f32 + 0.5)),
            slope: gain * towards * planes as f32,
        }
    }

    /// Returns the share of a point of normalized `depth`.
    #[inline(always)]
    pub(super) fn of(self, depth: f32) -> f32 {
        (self.at_zero + self.slope * depth).clamp(0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::Display;
    use crate::method::sweep::reference;

    /// Returns the planes and shares of a point by the rule that tiles use.
    fn shares(sweep: &Sweep, depth: f32) -> Vec<(usize, f32)> {
        let slot = usize::from(sweep.slot(depth));
        if slot.is_multiple_of(2) {
            return vec![(slot / 2, 1.0)];
        }
        [true, false]
            .map(|behind_plane| {
                let k = slot / 2 + usize::from(!behind_plane);
                (k, Share::on(k, sweep.planes, behind_plane).of(depth))
            })
            .to_vec()
    }

    #[test]
    fn one_plane_always_holds_the_whole_point_and_no_other_than_two_hold_any() {
        for (planes, between_planes) in [(1, true), (2, true), (9, true), (1024, true), (9, false)] {
            let sweep = Sweep {
                between_planes,
                ..Sweep::of_planes(&Display::default(), planes)
            };
            for i in 0..=2000 {
                let depth = i as f32 / 2000.0;
                let shares = shares(&sweep, depth);
                let most = shares.iter().map(|(_, share)| *share).fold(0.0, f32::max);
                assert!(most > 0.999, "{planes} {depth}: {shares:?}");
                for k in 0..planes {
                    let share: f32 = shares.iter().filter(|(on, _)| *on == k).map(|(_, share)| share).sum();
                    let expected = reference::share(&sweep, depth, k);
                    assert!(
                        (f64::from(share) - expected).abs() < 1e-3,
                        "{planes} {depth} {k}: {share} {expected}"
                    );
                }
            }
        }
    }
}
