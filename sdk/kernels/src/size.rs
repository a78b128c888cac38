//! The size of a picture.

/// The width and the height of a picture, a plane or a modulator, in pixels.
///
/// Every signature takes and returns sizes in this form; arrays keep their shape, (H, W).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Size {
    /// The number of pixels along x.
    pub width: usize,
    /// The number of pixels along y.
    pub height: usize,
}

impl Size {
    /// Returns the size of a plane whose array has the shape (H, W).
    pub const fn from_shape((height, width): (usize, usize)) -> Self {
        Size { width, height }
    }

    /// Returns the shape of a plane's array, (H, W).
    pub const fn shape(self) -> (usize, usize) {
        (self.height, self.width)
    }

    /// Returns the number of pixels.
    ///
    /// Does not overflow for sizes that were checked against the pixels that fit in memory.
    pub const fn pixels(self) -> usize {
        self.width * self.height
    }
}

/// Writes the size as `1920×1080`, the width first.
impl std::fmt::Display for Size {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}×{}", self.width, self.height)
    }
}
