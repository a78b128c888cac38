//! Earlier choices of a video's pixels at edges. Noise would change the surface of a nearly undecided pixel from frame
//! to frame. A pixel whose colour stays therefore prefers the surface that it had, and its depth follows slowly. Where
//! something moves, colours at edges change, and the pixel is decided anew.

/// The lead of the surface that the pixel had.
const KEEP: f32 = 6.0;
/// The largest difference of depth to the surface that the pixel had, as a share of the volume.
const SAME: f32 = 0.06;
/// The largest difference of amplitudes at which a colour stays.
const ALIKE: f32 = 0.1;
/// The share of the way to its new depth that a pixel moves in a frame.
const SHARE: f32 = 0.5;

/// The last depth of a pixel at an edge, and its colour then.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Choice {
    depth: f32,
    colour: [u8; 3],
    is_known: bool,
}

impl Choice {
    /// Returns the lead of each surface, by its depth, for a pixel of this `colour`: [`KEEP`] for the surface nearest to
    /// the last depth, and 0 for all others.
    pub(super) fn leads<const N: usize>(&self, colour: [f32; 3], depths: impl Iterator<Item = f32>) -> [f32; N] {
        let mut leads = [0.0; N];
        if self.holds(colour) {
            let apart = depths.map(|depth| (depth - self.depth).abs()).enumerate();
            let nearest = apart.min_by(|a, b| a.1.total_cmp(&b.1));
            if let Some((i, _)) = nearest.filter(|(_, apart)| *apart <= SAME) {
                leads[i] = KEEP;
            }
        }
        leads
    }

    /// Returns the depth of a pixel of this `colour` that is `depth` by itself, and remembers it.
    pub(super) fn follow(&mut self, colour: [f32; 3], depth: f32) -> f32 {
        let stays = self.holds(colour) && (depth - self.depth).abs() <= SAME;
        let depth = if stays {
            self.depth + SHARE * (depth - self.depth)
        } else {
            depth
        };
        *self = Choice {
            depth,
            colour: colour.map(byte),
            is_known: true,
        };
        depth
    }

    /// Returns whether a pixel of this `colour` has a choice and has kept its colour.
    fn holds(&self, colour: [f32; 3]) -> bool {
        let [r, g, b] = [0, 1, 2].map(|c| colour[c] - f32::from(self.colour[c]) * (1.0 / 255.0));
        self.is_known && r * r + g * g + b * b <= ALIKE * ALIKE
    }
}

fn byte(amplitude: f32) -> u8 {
    (amplitude * 255.0 + 0.5) as u8
}
