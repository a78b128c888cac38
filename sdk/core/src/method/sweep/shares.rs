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
pub(super) type Slot = i16;

impl Sweep {
    /// Returns the position of normalized `depth` among the planes: k on plane k, where 0 is the nearest. Points before
    /// the first plane are on it, and points behind the last are on that one.
    #[inline(always)]
    pub(super) fn position(&self, depth: f32) -> f32 {
        let position = depth * self.planes as f32;
        let position = if self.between_planes {
            position - 0.5
        } else {
            position as i32 as f32
        };
        position.clamp(0.0, (self.planes - 1) as f32)
    }

    /// Returns the planes of a point at `position`.
    #[inline(always)]
    pub(super) fn slot(position: f32) -> Slot {
        let front = position as i32;
        (2 * front + i32::from(position > front as f32)) as Slot
    }
}

/// Returns the least and the most of slots.
#[inline(always)]
pub(super) fn range(slots: &[Slot]) -> [Slot; 2] {
    let least = slots.iter().fold(Slot::MAX, |least, slot| least.min(*slot));
    let most = slots.iter().fold(0, |most, slot| most.max(*slot));
    [least, most]
}

/// Returns the share of a point at `position` on plane `k`.
#[inline(always)]
pub(super) fn share(position: f32, k: f32) -> f32 {
    // `f32::min` also considers NaN, which costs more.
    let least = |a: f32, b: f32| if a < b { a } else { b };
    let behind = position - k;
    let (as_rear, as_front) = ((1.0 + behind) * (1.0 / (1.0 - MEET)), (1.0 - behind) * (1.0 / MEET));
    let share = least(as_rear, as_front);
    least(if share > 0.0 { share } else { 0.0 }, 1.0)
}

/// Returns a share in units of 2⁻¹⁵.
#[inline(always)]
pub(super) fn in_units(share: f32) -> i32 {
    round(share * 32768.0)
}

/// Rounds a value of 0 to 2¹⁶ to the nearest integer.
#[inline(always)]
pub(super) fn round(value: f32) -> i32 {
    // With this addend, the integer is in the lower bits of the sum. A conversion would not be vectorised as well.
    const ADDEND: f32 = (3 << 22) as f32;
    (value + ADDEND).to_bits().cast_signed() - ADDEND.to_bits().cast_signed()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::display::Display;
    use crate::method::sweep::reference;

    /// Returns the planes and shares of a point by the rule that tiles use.
    fn shares(sweep: &Sweep, depth: f32) -> Vec<(usize, f32)> {
        let position = sweep.position(depth);
        let slot = Sweep::slot(position) as usize;
        (slot / 2..=slot.div_ceil(2))
            .map(|k| (k, share(position, k as f32)))
            .collect()
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
