//! Curves as an SVG picture: panels side by side, one curve each.

use crate::error::{Error, Result};
use crate::files;
use plotters::prelude::*;
use std::io::Write;
use std::path::Path;

/// Width of a panel and height of the picture, pixels.
const PANEL: (u32, u32) = (460, 360);
/// Most numbers along x, so that they have room.
const MOST_LABELS: usize = 12;
const COLOUR: RGBColor = RGBColor(31, 95, 160);

/// One curve and the words around it.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel<'a> {
    /// Over the curve.
    pub title: &'a str,
    /// Along x.
    pub x: &'a str,
    /// Along y.
    pub y: &'a str,
    /// At least one point, by growing x.
    pub points: Vec<(i32, f64)>,
}

/// Writes `panels` to `path`, an SVG.
///
/// # Errors
/// A point that is not finite, no point at all, or a file that cannot be written.
pub fn write_svg(path: &Path, panels: &[Panel<'_>]) -> Result<()> {
    let bad = panels.is_empty()
        || panels.iter().any(|panel| {
            panel.points.is_empty() || panel.points.iter().any(|(_, y)| !y.is_finite())
        });
    if bad {
        return Err(Error::Input(
            "a plot needs at least one point a curve, all of them finite".into(),
        ));
    }
    let mut text = String::new();
    draw(&mut text, panels).map_err(|e| Error::file(path, e))?;
    files::write_atomically(path, |file| file.write_all(text.as_bytes()))
}

fn draw(
    text: &mut String,
    panels: &[Panel<'_>],
) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let size = (PANEL.0 * panels.len() as u32, PANEL.1);
    let root = SVGBackend::with_string(text, size).into_drawing_area();
    root.fill(&WHITE)?;
    for (area, panel) in root.split_evenly((1, panels.len())).iter().zip(panels) {
        let (first, last) = (panel.points[0].0, panel.points[panel.points.len() - 1].0);
        let values = panel.points.iter().map(|(_, y)| *y);
        let low = values.clone().fold(f64::INFINITY, f64::min);
        let high = values.fold(f64::NEG_INFINITY, f64::max);
        let room = ((high - low) * 0.08).max(1e-3 * high.abs()).max(1e-9);
        let mut chart = ChartBuilder::on(area)
            .caption(panel.title, ("sans-serif", 18))
            .margin(12)
            .x_label_area_size(42)
            .y_label_area_size(62)
            .build_cartesian_2d(first - 1..last + 1, low - room..high + room)?;
        chart
            .configure_mesh()
            .x_desc(panel.x)
            .y_desc(panel.y)
            .x_labels(((last - first + 3) as usize).min(MOST_LABELS))
            .label_style(("sans-serif", 14))
            .axis_desc_style(("sans-serif", 15))
            .light_line_style(TRANSPARENT)
            .draw()?;
        chart.draw_series(LineSeries::new(
            panel.points.iter().copied(),
            COLOUR.stroke_width(2),
        ))?;
        chart.draw_series(
            panel
                .points
                .iter()
                .map(|point| Circle::new(*point, 4, COLOUR.filled())),
        )?;
    }
    root.present()?;
    Ok(())
}
