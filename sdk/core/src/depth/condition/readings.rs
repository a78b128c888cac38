//! Conditioned readings, from which the depth of pixels is decided here or on a GPU.

use super::axis::AxisMap;
use super::edges::Kind;
use super::{history, pixels, surfaces};
use crate::Size;

/// The conditioned readings of a frame and where the display's pixels lie among them.
#[derive(Debug, Clone, Copy)]
pub struct ConditionedReadings<'a> {
    pub(super) depth: &'a [f32],
    pub(super) kinds: &'a [Kind],
    pub(super) x: &'a AxisMap,
    pub(super) y: &'a AxisMap,
    pub(super) are_coarse: bool,
    pub(super) has_past: bool,
}

/// The pixels along one side of the display, and the readings along it.
#[derive(Debug, Clone, Copy)]
pub struct ReadingsAxis<'a> {
    /// The reading that each pixel lies in.
    pub cell: &'a [u32],
    /// The offset of each pixel from the middle of that reading, −½..=½.
    pub offset: &'a [f32],
    /// The pixels that give each reading its colour: the first, and one past the last.
    pub pixels: &'a [(u32, u32)],
}

impl<'a> ConditionedReadings<'a> {
    /// Returns the number of readings along each axis.
    pub fn size(&self) -> Size {
        Size {
            width: self.x.pixels.len(),
            height: self.y.pixels.len(),
        }
    }

    /// Returns the size of the display.
    pub fn out(&self) -> Size {
        Size {
            width: self.x.cell.len(),
            height: self.y.cell.len(),
        }
    }

    /// Returns the normalized depth of the readings, (h, w), without holes.
    pub fn depth(&self) -> &'a [f32] {
        self.depth
    }

    /// Returns the kinds of the readings, (h, w): 0 inside a surface; at an edge 1 on a surface, 2 filled, 3 mixed.
    pub fn kinds(&self) -> impl Iterator<Item = u8> + 'a {
        self.kinds.iter().map(|kind| *kind as u8)
    }

    /// Returns the places of pixels along x and along y.
    pub fn axes(&self) -> [ReadingsAxis<'a>; 2] {
        [self.x, self.y].map(|axis| ReadingsAxis {
            cell: &axis.cell,
            offset: &axis.offset,
            pixels: &axis.pixels,
        })
    }

    /// Returns whether readings have several pixels, so that an edge in them may be a ramp.
    pub fn are_coarse(&self) -> bool {
        self.are_coarse
    }

    /// Returns whether the choices of the previous frame count.
    pub fn has_past(&self) -> bool {
        self.has_past
    }

    /// Returns the depth around the pixel (`y`, `x`) without a decision: interpolated inside a surface, and that of the
    /// nearest reading at an edge.
    pub fn depth_near(&self, y: usize, x: usize) -> f32 {
        let width = self.x.pixels.len();
        let nearest = self.y.cell[y] as usize * width + self.x.cell[x] as usize;
        if self.kinds[nearest].is_at_edge() {
            return self.depth[nearest].clamp(0.0, 1.0);
        }
        let (above, below, share) = self.y.beside(y);
        let (left, right, along) = self.x.beside(x);
        let row = |row: usize| {
            let (a, b) = (self.depth[row * width + left], self.depth[row * width + right]);
            a + along * (b - a)
        };
        let (a, b) = (row(above), row(below));
        (a + share * (b - a)).clamp(0.0, 1.0)
    }
}

/// Returns the names and values of the constants by which pixels are decided, for programs on a GPU.
pub fn constants() -> [(&'static str, f32); 13] {
    [
        ("TOLERANCE", surfaces::TOLERANCE),
        ("FILLED", surfaces::FILLED),
        ("LEAST_VARIANCE", surfaces::LEAST_VARIANCE),
        ("PLACE", pixels::PLACE),
        ("MOST_EVIDENCE", pixels::MOST_EVIDENCE),
        ("NEIGHBOURS", pixels::NEIGHBOURS),
        ("NEAR", pixels::NEAR),
        ("ALIKE", pixels::ALIKE),
        ("LEAST_ALIKE", pixels::LEAST_ALIKE),
        ("KEEP", history::KEEP),
        ("SAME", history::SAME),
        ("STAYS", history::ALIKE),
        ("SHARE", history::SHARE),
    ]
}
