//! The display pixels along one axis and the readings around them.

/// The positions of the display's pixels among the readings along one axis.
#[derive(Debug, Clone)]
pub(super) struct AxisMap {
    /// The reading that each display pixel lies in.
    pub(super) cell: Vec<u32>,
    /// The offset of each display pixel from the middle of that reading, −½..=½.
    pub(super) offset: Vec<f32>,
    /// The range of display pixels that give each reading its colour: the first, and one past the last.
    pub(super) pixels: Vec<(u32, u32)>,
    /// Where each pixel lies in the middle of a reading of its own, except for those beyond the readings: the first
    /// reading in the display, and the pixel that lies in it.
    pub(super) straight: Option<(usize, usize)>,
}

impl AxisMap {
    pub(super) fn new(cells: usize, out: usize) -> Self {
        AxisMap {
            cell: vec![0; out],
            offset: vec![0.0; out],
            pixels: vec![(0, 0); cells],
            straight: None,
        }
    }

    /// Places the pixels over `length` readings from `from` on.
    pub(super) fn place(&mut self, from: f64, length: f64) {
        let (cells, out) = (self.pixels.len(), self.cell.len());
        for (o, (cell, offset)) in self.cell.iter_mut().zip(&mut self.offset).enumerate() {
            let centre = from + (o as f64 + 0.5) * length / out as f64 - 0.5;
            let nearest = centre.round().clamp(0.0, cells as f64 - 1.0);
            *cell = nearest as u32;
            *offset = (centre - nearest).clamp(-0.5, 0.5) as f32;
        }
        let beyond = (-from).max(0.0);
        let is_straight = length == out as f64 && from.fract() == 0.0 && beyond < out as f64 && from < cells as f64;
        self.straight = is_straight.then_some((from.max(0.0) as usize, beyond as usize));
        let mut first = 0;
        for (c, range) in self.pixels.iter_mut().enumerate() {
            let length = self.cell[first..]
                .iter()
                .take_while(|cell| **cell as usize == c)
                .count();
            // Readings between or beyond the display's pixels take the colour of an adjacent pixel.
            *range = match length {
                0 => (first.min(out - 1) as u32, first.min(out - 1) as u32 + 1),
                _ => (first as u32, (first + length) as u32),
            };
            first += length;
        }
    }

    /// Returns the display pixels that lie in the reading `cell`.
    pub(super) fn inside(&self, cell: usize) -> std::ops::Range<usize> {
        let (first, end) = self.pixels[cell];
        match self.cell[first as usize] as usize == cell {
            true => first as usize..end as usize,
            false => 0..0,
        }
    }

    /// Returns the display pixels that lie in the readings `cells`.
    pub(super) fn inside_all(&self, cells: std::ops::Range<usize>) -> std::ops::Range<usize> {
        let mut inside = cells.map(|cell| self.inside(cell)).filter(|pixels| !pixels.is_empty());
        let first = inside.next().unwrap_or(0..0);
        let end = inside.next_back().map_or(first.end, |last| last.end);
        first.start..end
    }

    /// Returns the readings on both sides of a display pixel, and the share of the second.
    pub(super) fn beside(&self, pixel: usize) -> (usize, usize, f32) {
        let (cell, offset) = (self.cell[pixel] as usize, self.offset[pixel]);
        match offset < 0.0 {
            true => (cell.saturating_sub(1), cell, 1.0 + offset),
            false => (cell, (cell + 1).min(self.pixels.len() - 1), offset),
        }
    }
}
