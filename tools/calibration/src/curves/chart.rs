//! SVG charts of a calibration: curves with the measured points, and maps over the modulator.

use ndarray::{Array2, ArrayView2};
use phasefront_io::{Error, Result, output};
use plotters::coord::Shift;
use plotters::prelude::*;
use std::io::Write;
use std::path::Path;

/// The width and height of a panel, in pixels.
const PANEL: (u32, u32) = (430, 330);
/// The colours of the curves in a panel, in order.
const COLOURS: [RGBColor; 4] = [
    RGBColor(31, 95, 160),
    RGBColor(196, 78, 22),
    RGBColor(60, 140, 60),
    RGBColor(120, 70, 150),
];
/// The maximum number of rectangles along a side of a map.
const CELLS: usize = 96;

type Drawn = std::result::Result<(), Box<dyn std::error::Error>>;

/// A curve, drawn as a line or as dots.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// The name in the legend, or an empty string for no entry.
    pub name: String,
    /// The points in ascending order of x.
    pub points: Vec<(f64, f64)>,
    /// Whether the points are drawn as dots instead of a line.
    pub dots: bool,
}

/// Curves with common axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// The title above the panel.
    pub title: String,
    /// The label of the x axis.
    pub x: &'static str,
    /// The label of the y axis.
    pub y: &'static str,
    /// The curves, which need at least one point in total.
    pub curves: Vec<Curve>,
}

/// A map with one value per pixel of the modulator. NaN marks pixels without a value.
#[derive(Debug, Clone, PartialEq)]
pub struct Map {
    /// The title above the map.
    pub title: String,
    /// The values, (H, W).
    pub values: Array2<f32>,
}

/// Writes `panels` as SVG to `path`, with `across` panels in each row.
///
/// # Errors
/// Returns an error if a panel has no finite point or the file cannot be written.
pub fn write_curves(path: &Path, panels: &[Panel], across: usize) -> Result<()> {
    write(path, panels.len(), across, |area, i| curves(area, &panels[i]))
}

/// Writes `maps` as SVG to `path`, with `across` maps in each row.
///
/// # Errors
/// Returns an error if a map has no finite value or the file cannot be written.
pub fn write_maps(path: &Path, maps: &[Map], across: usize) -> Result<()> {
    write(path, maps.len(), across, |area, i| map(area, &maps[i]))
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

fn write(path: &Path, count: usize, across: usize, draw: impl Fn(&Area<'_>, usize) -> Drawn) -> Result<()> {
    let mut text = String::new();
    let rows = count.div_ceil(across);
    let mut all = || -> Drawn {
        let size = (PANEL.0 * across as u32, PANEL.1 * rows as u32);
        let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
        root.fill(&WHITE)?;
        for (i, area) in root.split_evenly((rows, across)).iter().take(count).enumerate() {
            draw(area, i)?;
        }
        root.present()?;
        Ok(())
    };
    all().map_err(|e| Error::file(path, format!("cannot be drawn: {e}")))?;
    output::write_atomically(path, |file| file.write_all(text.as_bytes()))
}

/// Returns the least and the largest finite value, at least a little apart.
fn span(values: impl Iterator<Item = f64>) -> std::result::Result<(f64, f64), &'static str> {
    let (low, high) = values
        .filter(|v| v.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    if low <= high {
        Ok((low, high.max(low + 1e-9 + 1e-6 * low.abs())))
    } else {
        Err("nothing to draw")
    }
}

fn curves(area: &Area<'_>, panel: &Panel) -> Drawn {
    let points = || panel.curves.iter().flat_map(|c| &c.points);
    let (left, right) = span(points().map(|p| p.0))?;
    let (low, high) = span(points().map(|p| p.1))?;
    let room = (high - low) * 0.06;
    let mut chart = ChartBuilder::on(area)
        .caption(&panel.title, ("sans-serif", 17))
        .margin(10)
        .x_label_area_size(38)
        .y_label_area_size(56)
        .build_cartesian_2d(left..right, low - room..high + room)?;
    chart
        .configure_mesh()
        .x_desc(panel.x)
        .y_desc(panel.y)
        .label_style(("sans-serif", 13))
        .axis_desc_style(("sans-serif", 14))
        .light_line_style(TRANSPARENT)
        .draw()?;
    for (i, curve) in panel.curves.iter().enumerate() {
        let colour = COLOURS[i % COLOURS.len()];
        let points = curve.points.iter().copied();
        let drawn = if curve.dots {
            chart.draw_series(points.map(|p| Circle::new(p, 1, colour.filled())))?
        } else {
            chart.draw_series(LineSeries::new(points, colour.stroke_width(2)))?
        };
        if !curve.name.is_empty() {
            drawn
                .label(&curve.name)
                .legend(move |(x, y)| Circle::new((x + 8, y), 4, colour.filled()));
        }
    }
    if panel.curves.iter().any(|c| !c.name.is_empty()) {
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::LowerRight)
            .background_style(WHITE.mix(0.8))
            .label_font(("sans-serif", 13))
            .draw()?;
    }
    Ok(())
}

fn map(area: &Area<'_>, map: &Map) -> Drawn {
    let small = shrunk(map.values.view());
    let (low, high) = span(small.iter().map(|v| f64::from(*v)))?;
    let (height, width) = map.values.dim();
    let title = format!("{}: {} to {}", map.title, short(low), short(high));
    // The chart has the modulator's aspect ratio.
    let inner = f64::from(PANEL.0 - 40);
    let tall = (inner * height as f64 / width as f64).min(f64::from(PANEL.1 - 60));
    let wide = tall * width as f64 / height as f64;
    area.titled(&title, ("sans-serif", 16))?;
    let (x0, y0) = ((f64::from(PANEL.0) - wide) / 2.0, 36.0);
    let (rows, columns) = small.dim();
    for ((i, j), value) in small.indexed_iter() {
        if !value.is_finite() {
            continue;
        }
        let corner = |i: usize, j: usize| {
            (
                (x0 + wide * j as f64 / columns as f64).round() as i32,
                (y0 + tall * i as f64 / rows as f64).round() as i32,
            )
        };
        let t = (f64::from(*value) - low) / (high - low);
        let colour = shade(t);
        area.draw(&Rectangle::new([corner(i, j), corner(i + 1, j + 1)], colour.filled()))?;
    }
    Ok(())
}

/// Returns a colour from dark blue through a light centre to dark red.
fn shade(t: f64) -> RGBColor {
    const STOPS: [[f64; 3]; 5] = [
        [20.0, 40.0, 110.0],
        [70.0, 140.0, 190.0],
        [240.0, 236.0, 220.0],
        [224.0, 130.0, 60.0],
        [130.0, 20.0, 25.0],
    ];
    let at = t.clamp(0.0, 1.0) * 4.0;
    let i = (at as usize).min(3);
    let mix = |c: usize| STOPS[i][c] + (STOPS[i + 1][c] - STOPS[i][c]) * (at - i as f64);
    RGBColor(mix(0) as u8, mix(1) as u8, mix(2) as u8)
}

/// Formats a number with three digits.
fn short(v: f64) -> String {
    let digits = (2.0 - v.abs().max(1e-9).log10().floor()).clamp(0.0, 6.0);
    format!("{v:.0$}", digits as usize)
}

/// Averages the finite values in each of at most [`CELLS`] cells along a side.
fn shrunk(values: ArrayView2<'_, f32>) -> Array2<f32> {
    let (height, width) = values.dim();
    let step = height.max(width).div_ceil(CELLS);
    Array2::from_shape_fn((height.div_ceil(step), width.div_ceil(step)), |(i, j)| {
        let (mut sum, mut count) = (0.0, 0);
        for y in i * step..((i + 1) * step).min(height) {
            for x in j * step..((j + 1) * step).min(width) {
                if values[(y, x)].is_finite() {
                    sum += values[(y, x)];
                    count += 1;
                }
            }
        }
        if count > 0 { sum / count as f32 } else { f32::NAN }
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn drawings_hold_what_is_drawn_and_nothing_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("p.svg");
        let curve = |dots| Curve {
            name: "measured".into(),
            points: (0..20).map(|i| (f64::from(i), f64::from(i * i))).collect(),
            dots,
        };
        let panel = |curves| Panel {
            title: "phase of a pixel".into(),
            x: "level",
            y: "rad",
            curves,
        };
        write_curves(&path, &[panel(vec![curve(true), curve(false)])], 1).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains("phase of a pixel") && text.matches("<circle").count() >= 20);
        let mut values = Array2::from_shape_fn((30, 300), |(y, x)| (y + x) as f32);
        values[(0, 0)] = f32::NAN;
        let maps = |values| {
            [Map {
                title: "range".into(),
                values,
            }]
        };
        write_maps(&path, &maps(values), 1).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.matches("<rect").count() > 600, "{}", text.len());
        let empty = Array2::from_elem((3, 3), f32::NAN);
        assert!(write_maps(&path, &maps(empty), 1).is_err());
        assert!(write_curves(&path, &[panel(vec![])], 1).is_err());
    }
}
