//! SVG plots: curves in panels side by side, and stacked bars.

use crate::{Error, Result, output};
use plotters::prelude::*;
use std::io::Write;
use std::path::Path;

/// The width of a panel and the height of the picture, in pixels.
const PANEL: (u32, u32) = (460, 360);
/// The maximum number of labels along x, so that they do not overlap.
const MOST_LABELS: usize = 12;
const COLOUR: RGBColor = RGBColor(31, 95, 160);

/// One curve with its title and labels.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel<'a> {
    /// The title above the curve.
    pub title: &'a str,
    /// The label of the x axis.
    pub x: &'a str,
    /// The label of the y axis.
    pub y: &'a str,
    /// The points, at least one, in ascending order of x.
    pub points: Vec<(i32, f64)>,
}

/// Writes `panels` to `path` as SVG.
///
/// # Errors
/// Returns an error if there is no point, if a point is not finite, or if the file cannot be written.
pub fn write_svg(path: &Path, panels: &[Panel<'_>]) -> Result<()> {
    let bad = panels.is_empty()
        || panels
            .iter()
            .any(|panel| panel.points.is_empty() || panel.points.iter().any(|(_, y)| !y.is_finite()));
    if bad {
        return Err(Error::Input(
            "a plot needs at least one point a curve, all of them finite".into(),
        ));
    }
    let mut text = String::new();
    draw(&mut text, panels).map_err(|e| Error::file(path, e))?;
    output::write_atomically(path, |file| file.write_all(text.as_bytes()))
}

/// A bar of consecutive parts.
#[derive(Debug, Clone, PartialEq)]
pub struct Bar {
    /// The label beside the bar.
    pub label: String,
    /// The name and length of each part. All bars of a picture have the same names.
    pub parts: Vec<(&'static str, f64)>,
}

/// Writes `bars`, one below the other, to `path` as SVG.
///
/// # Errors
/// Returns an error if there is no bar, if a length is negative or not finite, or if the file cannot be written.
pub fn write_bars(path: &Path, title: &str, bars: &[Bar]) -> Result<()> {
    let mut lengths = bars.iter().flat_map(|bar| &bar.parts);
    if bars.is_empty() || !lengths.all(|(_, length)| length.is_finite() && *length >= 0.0) {
        return Err(Error::Input(
            "a plot needs at least one bar, and finite lengths from 0".into(),
        ));
    }
    let mut text = String::new();
    draw_bars(&mut text, title, bars).map_err(|e| Error::file(path, e))?;
    output::write_atomically(path, |file| file.write_all(text.as_bytes()))
}

fn draw_bars(text: &mut String, title: &str, bars: &[Bar]) -> std::result::Result<(), Box<dyn std::error::Error>> {
    const COLOURS: [RGBColor; 4] = [
        COLOUR,
        RGBColor(231, 138, 50),
        RGBColor(90, 158, 90),
        RGBColor(150, 90, 160),
    ];
    const ROW: i32 = 24;
    const LEFT: i32 = 290;
    const LENGTH: f64 = 560.0;
    const TOP: i32 = 64;
    let size = (960, (TOP + ROW * bars.len() as i32 + 16) as u32);
    let root = SVGBackend::with_string(text, size).into_drawing_area();
    root.fill(&WHITE)?;
    let words = |size: i32| ("sans-serif", size).into_text_style(&root);
    root.draw(&Text::new(title, (12, 12), words(17)))?;
    let total = |bar: &Bar| bar.parts.iter().map(|(_, length)| length).sum::<f64>();
    let longest = bars.iter().map(total).fold(f64::MIN_POSITIVE, f64::max);
    for (k, (name, _)) in bars[0].parts.iter().enumerate() {
        let x = LEFT + 130 * k as i32;
        let colour = COLOURS[k % COLOURS.len()].filled();
        root.draw(&Rectangle::new([(x, 42), (x + 12, 54)], colour))?;
        root.draw(&Text::new(*name, (x + 18, 41), words(14)))?;
    }
    for (i, bar) in bars.iter().enumerate() {
        let y = TOP + ROW * i as i32;
        root.draw(&Text::new(bar.label.as_str(), (12, y + 2), words(14)))?;
        let mut end = 0.0;
        for (k, (_, length)) in bar.parts.iter().enumerate() {
            let at = |length: f64| LEFT + (length / longest * LENGTH).round() as i32;
            let corners = [(at(end), y), (at(end + length), y + ROW - 7)];
            root.draw(&Rectangle::new(corners, COLOURS[k % COLOURS.len()].filled()))?;
            end += length;
        }
        let x = LEFT + 6 + (end / longest * LENGTH).round() as i32;
        root.draw(&Text::new(format!("{end:.1}"), (x, y + 2), words(14)))?;
    }
    root.present()?;
    Ok(())
}

fn draw(text: &mut String, panels: &[Panel<'_>]) -> std::result::Result<(), Box<dyn std::error::Error>> {
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
        chart.draw_series(LineSeries::new(panel.points.iter().copied(), COLOUR.stroke_width(2)))?;
        chart.draw_series(panel.points.iter().map(|point| Circle::new(*point, 4, COLOUR.filled())))?;
    }
    root.present()?;
    Ok(())
}
