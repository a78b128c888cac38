//! The study of flicker: of random scenes with several settings, or of a data set's scenes with simulated sensors.

use super::Study;
use crate::command::sensors::{self, Sensors};
use phasefront::{Method, Sweep};
use phasefront_command::networks;
use phasefront_command::terminal::{self, progress_bar};
use phasefront_io::{Error, Result};
use phasefront_lab::dataset::{self, Manifest};
use phasefront_lab::study::flicker::{self, ALONE, BOTH, Row, SETTINGS, Standing};
use serde_json::json;
use std::path::Path;

/// The number of frames of each scene.
const FRAMES: usize = 30;

impl Study {
    /// Studies every setting on random scenes, by the network of 8 layers.
    pub(super) fn flicker(&self, json: bool) -> Result<()> {
        let display = self.display.read_of_three()?.target.display.with_size(flicker::SIZE)?;
        let method = Method::Network(networks::network("8", None)?);
        let bar = progress_bar((usize::from(self.scenes) * FRAMES * SETTINGS.len()) as u64, "frames");
        let of_scenes = (0..u64::from(self.scenes))
            .map(|scene| {
                let standing = Standing::random(self.seed + scene, FRAMES)?;
                flicker::study(&standing, &SETTINGS, &display, &method, &|| bar.inc(1))
            })
            .collect::<Result<Vec<_>>>()?;
        bar.finish_and_clear();
        let rows = means(&of_scenes);
        let result = json!({
            "study": "flicker", "frames": FRAMES, "scenes": self.scenes, "seed": self.seed, "display": display,
            "rows": rows,
        });
        self.write_json("flicker", &result)?;
        let mut text = "change from frame to frame  brightness   a pixel's amplitude".to_owned();
        for row in &rows {
            text += &format!("\n{:26}  {}", row.setting, changes(row));
        }
        terminal::print(json, &result, text);
        Ok(())
    }

    /// Studies frames by themselves and in a video session, on the data set's scenes as each sensor reads them, by the
    /// automatic choice.
    pub(super) fn flicker_of_sensors(&self, data: &Path, json: bool) -> Result<()> {
        let manifest = Manifest::read(data)?;
        let scenes = usize::from(self.scenes);
        if scenes > manifest.scenes {
            return Err(Error::file(
                data,
                format!("holds {} scenes; --scenes {scenes} needs as many", manifest.scenes),
            ));
        }
        let sweep = Sweep::for_display(&manifest.display);
        let method = Method::Auto(sweep, networks::network("8", None)?);
        let sensors = Sensors::all(&self.sensor);
        let settings = [ALONE, BOTH];
        let bar = progress_bar((sensors.len() * scenes * FRAMES * settings.len()) as u64, "frames");
        let mut results = Vec::new();
        let mut text =
            "sensor           alone: brightness   a pixel's amplitude  video: brightness   a pixel's amplitude"
                .to_owned();
        for sensor in sensors {
            let of_scenes = (0..scenes)
                .map(|index| {
                    let pair = dataset::read_pair(&manifest, data, index)?;
                    let seed = self.seed + (index * FRAMES) as u64;
                    let standing = Standing::read_by(sensor, &pair.ldi, seed, FRAMES);
                    flicker::study(&standing, &settings, &manifest.display, &method, &|| bar.inc(1))
                })
                .collect::<Result<Vec<_>>>()?;
            let rows = means(&of_scenes);
            text += &format!("\n{:15}", sensors::name_of(sensor));
            rows.iter().for_each(|row| text += &format!("  {:>17}", changes(row)));
            results.push(json!({ "sensor": sensor, "rows": rows, "scenes": of_scenes }));
        }
        bar.finish_and_clear();
        let result = json!({
            "study": "flicker", "frames": FRAMES, "data": data, "scenes": scenes, "seed": self.seed,
            "sensors": results,
        });
        self.write_json("flicker", &result)?;
        terminal::print(json, &result, text);
        Ok(())
    }
}

/// Returns the mean of each setting's changes over the scenes.
fn means(of_scenes: &[Vec<Row>]) -> Vec<Row> {
    let mean = |at: usize, change: fn(&Row) -> f64| {
        of_scenes.iter().map(|rows| change(&rows[at])).sum::<f64>() / of_scenes.len() as f64
    };
    let settings = of_scenes.first().into_iter().flatten().enumerate();
    settings
        .map(|(at, row)| Row {
            setting: row.setting,
            brightness: mean(at, |row| row.brightness),
            pixel: mean(at, |row| row.pixel),
        })
        .collect()
}

fn changes(row: &Row) -> String {
    format!("{:8.3} %   {:.5}", 100.0 * row.brightness, row.pixel)
}
