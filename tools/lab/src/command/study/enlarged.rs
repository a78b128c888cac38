//! The study of enlarged depth.

use super::Study;
use phasefront::{EncoderOptions, Sweep};
use phasefront_command::networks;
use phasefront_command::terminal::{self, progress_bar};
use phasefront_io::{Error, Result};
use phasefront_lab::dataset::Manifest;
use phasefront_lab::evaluate::{Method, Shown};
use phasefront_lab::study::enlarged::{self, FACTORS, Spoiled};
use serde_json::json;

impl Study {
    /// Studies the data set's scenes by the automatic choice, displayed by the default encoder.
    pub(super) fn enlarged(&self, json: bool) -> Result<()> {
        let Some(data) = &self.data else {
            return Err(Error::Usage("the study of enlarged depth needs --data".into()));
        };
        let manifest = Manifest::read(data)?;
        let scenes = usize::from(self.scenes).min(manifest.scenes);
        let display = &manifest.display;
        let network = networks::network("8", None)?;
        let method = Method::auto(manifest.size, display, Sweep::for_display(display), network)?;
        let shown = Shown::encoded("default", display.clone().into(), EncoderOptions::default());
        let depths = scenes * (1 + 3 * FACTORS.len()) * Spoiled::ALL.len();
        let bar = progress_bar(depths as u64, "depths");
        let rows = enlarged::study((&manifest, data.as_path()), scenes, &method, &shown, &|| bar.inc(1))?;
        bar.finish_and_clear();
        let result = json!({"study": "enlarged", "data": data, "scenes": scenes, "size": manifest.size, "rows": rows});
        self.write_json("enlarged", &result)?;
        let mut text = format!(
            "factor  way         spoiled  found  right   wrong, as given and on its grid   field dB / SSIM as given    on its grid   displayed as given    on its grid   (mean of {scenes} scenes)"
        );
        for row in &rows {
            let pair = |(psnr, ssim): (f64, f64)| format!("{psnr:5.2} / {ssim:.3}");
            text += &format!(
                "\n{:6}  {:10}  {:7}  {:5}  {:5}  {:5.1} %  {:5.1} %  {}  {}  {}  {}",
                row.factor,
                row.by,
                format!("{:?}", row.spoiled).to_lowercase(),
                row.found,
                row.right,
                100.0 * row.given.wrong,
                100.0 * row.on_grid.wrong,
                pair(row.given.field),
                pair(row.on_grid.field),
                pair(row.given.displayed),
                pair(row.on_grid.displayed),
            );
        }
        terminal::print(json, &result, text);
        Ok(())
    }
}
