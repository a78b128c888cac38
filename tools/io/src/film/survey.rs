//! A look at a film's pictures before any of them is used: whether its depth is grey, where colour and depth that lie
//! side by side are parted, and how bright its light is.

use super::{Film, Picture, Pixels};
use crate::{Error, Result};
use std::path::Path;

/// The most pictures that a survey looks at. They are those that decode alone, so that they are spread over the film.
const MOST_PICTURES: u32 = 64;
/// The difference between the colours of a pixel, of 255, above which it is no grey of a lossy film.
const COLOURED: u8 = 16;
/// The share of coloured pixels above which depth is in false colours.
const MANY: f64 = 0.01;

/// Checks that the pictures of the film at `path` are grey, as depth is.
///
/// # Errors
/// Returns an error if they have colours, or if ffmpeg cannot read the film.
pub fn check_grey(path: &Path) -> Result<()> {
    let (mut coloured, mut all) = (0, 0);
    let mut film = Film::survey(path, Pixels::Rgb, None, MOST_PICTURES)?;
    while let Some(picture) = film.read()? {
        let pixels = picture.bytes.as_chunks::<3>().0;
        coloured += pixels.iter().filter(|pixel| is_coloured(pixel)).count() as u64;
        all += pixels.len() as u64;
    }
    check_coloured(path, coloured, all)
}

fn is_coloured([r, g, b]: &[u8; 3]) -> bool {
    r.max(g).max(b) - r.min(g).min(b) > COLOURED
}

/// Refuses depth of which too many pixels are `coloured`.
fn check_coloured(path: &Path, coloured: u64, all: u64) -> Result<()> {
    if coloured as f64 <= MANY * all as f64 {
        return Ok(());
    }
    Err(Error::file(
        path,
        "its depth holds colours: it looks like a film of colour, or depth in false colours; depth is grey",
    ))
}

/// The columns of pictures that hold colour at the left and depth at the right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sides {
    /// The number of columns of a picture.
    pub width: usize,
    /// The number of columns of the colour, and of the depth.
    pub side: usize,
}

impl Sides {
    /// Returns the number of columns between colour and depth.
    pub fn margin(&self) -> usize {
        self.width - 2 * self.side
    }
}

/// Finds the sides of the pictures of the film at `path`: its halves, or what a margin of one colour in their middle
/// leaves of them.
///
/// # Errors
/// Returns an error if the pictures cannot be parted, if the depth has colours, or if ffmpeg cannot read the film.
pub fn sides(path: &Path) -> Result<Sides> {
    let mut film = Film::survey(path, Pixels::Rgb, None, MOST_PICTURES)?;
    let mut columns: Option<Columns> = None;
    while let Some(picture) = film.read()? {
        let columns = columns.get_or_insert_with(|| Columns::new(picture.size.width));
        if columns.width() != picture.size.width {
            break; // The reader of the frames reports that the size changes.
        }
        columns.add(&picture);
    }
    let columns = columns.ok_or_else(|| Error::file(path, "holds no picture"))?;
    let width = columns.width();
    let margin = columns.margin();
    let side = (width - margin) / 2;
    if side == 0 || !(width - margin).is_multiple_of(2) {
        return Err(Error::file(
            path,
            format!("pictures {width} pixels wide have no two halves for colour and depth beside it"),
        ));
    }
    let coloured = columns.coloured[width - side..].iter().sum::<u64>();
    check_coloured(path, coloured, columns.rows * side as u64)?;
    Ok(Sides { width, side })
}

/// The range and the mean of each column of a film, and how many of its pixels are coloured.
struct Columns {
    least: Vec<[u8; 3]>,
    most: Vec<[u8; 3]>,
    sum: Vec<[u64; 3]>,
    coloured: Vec<u64>,
    rows: u64,
}

impl Columns {
    /// The range of a column of one colour in a lossy film.
    const FLAT: u8 = 16;
    /// The difference between the means of columns that have one colour.
    const SAME: f64 = 2.0;
    /// The least difference between the means of columns at an edge.
    const EDGE: f64 = 8.0;
    /// The columns beside an edge to which a codec's blocks spread it.
    const BLURRED: usize = 8;

    fn new(width: usize) -> Self {
        Columns {
            least: vec![[255; 3]; width],
            most: vec![[0; 3]; width],
            sum: vec![[0; 3]; width],
            coloured: vec![0; width],
            rows: 0,
        }
    }

    fn width(&self) -> usize {
        self.least.len()
    }

    fn add(&mut self, picture: &Picture) {
        for row in picture.bytes.chunks_exact(3 * self.width()) {
            for (x, pixel) in row.as_chunks::<3>().0.iter().enumerate() {
                self.coloured[x] += u64::from(is_coloured(pixel));
                for (c, &value) in pixel.iter().enumerate() {
                    self.least[x][c] = self.least[x][c].min(value);
                    self.most[x][c] = self.most[x][c].max(value);
                    self.sum[x][c] += u64::from(value);
                }
            }
            self.rows += 1;
        }
    }

    /// Returns the largest difference between the mean colours of two columns.
    fn apart(&self, a: usize, b: usize) -> f64 {
        let apart = |c: usize| self.sum[a][c].abs_diff(self.sum[b][c]) as f64 / self.rows as f64;
        (0..3).map(apart).fold(0.0, f64::max)
    }

    /// Checks whether column `x` has one colour, that of column `as_in`, in every picture.
    fn is_like(&self, x: usize, as_in: usize) -> bool {
        let flat = (0..3).all(|c| self.most[x][c] - self.least[x][c] <= Self::FLAT);
        flat && self.apart(x, as_in) <= Self::SAME
    }

    /// Returns the number of columns of the margin in the middle.
    fn margin(&self) -> usize {
        let width = self.width();
        let (left, right) = (width.saturating_sub(1) / 2, width / 2);
        // A background of one colour reaches the sides of the film too, and so do the bars beside a narrow picture.
        let is_background = self.is_like(0, left) && self.is_like(width - 1, left);
        if is_background || !(self.is_like(left, left) && self.is_like(right, left)) {
            return 0;
        }
        let (before, begins) = self.reach(|n| left.checked_sub(n));
        let (after, ends) = self.reach(|n| Some(right + n).filter(|x| *x < width));
        // Where a picture begins with the white of a margin, the other side shows how wide the margin is. Other colours
        // may be those of a wall.
        let is_white = self.sum[left].iter().all(|sum| *sum >= 250 * self.rows);
        let is_margin = begins && ends && before.abs_diff(after) <= 2 || is_white && (begins || ends);
        if is_margin {
            right - left + 1 + 2 * before.min(after)
        } else {
            0
        }
    }

    /// Returns how far the colour of column 0 reaches, where `column` counts from there to a side of the film, and
    /// whether it ends at an edge.
    fn reach(&self, column: impl Fn(usize) -> Option<usize>) -> (usize, bool) {
        let Some(from) = column(0) else { return (0, false) };
        let clear = (1..)
            .take_while(|n| column(*n).is_some_and(|x| self.is_like(x, from)))
            .count();
        // The margin's last columns may be blurred. It ends where the mean colour changes most.
        let change = |n: usize| Some(self.apart(column(n)?, column(n + 1)?));
        let near = (clear..clear + Self::BLURRED).filter_map(|n| Some((n, change(n)?)));
        let edge = near.max_by(|(_, a), (_, b)| a.total_cmp(b));
        edge.map_or((clear, false), |(n, change)| (n, change >= Self::EDGE))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use phasefront::Size;

    /// Returns the margin that is found in pictures of `height` rows of these pixels.
    fn margin(width: usize, pixel: impl Fn(usize, usize) -> [u8; 3]) -> usize {
        let mut columns = Columns::new(width);
        let pixels = (0..32 * width).flat_map(|i| pixel(i / width, i % width));
        columns.add(&Picture {
            size: Size { width, height: 32 },
            bytes: pixels.collect(),
        });
        columns.margin()
    }

    fn scene(y: usize, x: usize) -> [u8; 3] {
        [(7 * x + 5 * y) as u8, (3 * x + 11 * y) as u8, 90]
    }

    #[test]
    fn a_margin_is_found_whatever_its_width_and_colour() {
        for (side, wide, colour) in [
            (60, 50, [255; 3]),
            (61, 7, [0; 3]),
            (64, 2, [128, 90, 20]),
            (40, 21, [255; 3]),
        ] {
            let found = margin(2 * side + wide, |y, x| match x {
                x if x < side => scene(y, x),
                x if x < side + wide => colour,
                x => [scene(y, x - side - wide)[0]; 3],
            });
            assert_eq!(found, wide);
        }
    }

    #[test]
    fn a_blurred_margin_and_a_picture_that_begins_with_its_colour_are_told_apart() {
        let (side, wide) = (60, 24);
        let found = margin(2 * side + wide, |y, x| match x {
            x if x < side - 9 => scene(y, x),
            x if x < side + wide - 3 => [255; 3], // The colour's last nine columns are white.
            x if x < side + wide => [if y % 4 == 0 { 190 } else { 255 }; 3],
            x => [scene(y, x)[0] / 2; 3],
        });
        assert_eq!(found, wide);
    }

    #[test]
    fn backgrounds_and_bars_are_no_margin() {
        assert_eq!(margin(120, scene), 0);
        let bars = |y, x: usize| {
            if (10..50).contains(&(x % 60)) {
                scene(y, x)
            } else {
                [0; 3]
            }
        };
        assert_eq!(margin(120, bars), 0);
        assert_eq!(margin(120, |_, _| [0; 3]), 0);
        // A wall in the middle, and a thing at its left.
        let wall = |y: usize, x: usize| {
            if x < 55 && y < 9 {
                [20; 3]
            } else {
                [(100 + x / 4) as u8; 3]
            }
        };
        assert_eq!(margin(120, wall), 0);
    }
}
