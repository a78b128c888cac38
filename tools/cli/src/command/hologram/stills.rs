//! Folders of pictures for `phasefront hologram`. Each picture is processed by itself and keeps its name. If a picture
//! fails, the command reports it and continues with the others.

use crate::flags::frame::Picture;
use crate::make::{HologramRequest, infos};
use crate::record::{Before, Claim, RunRecord};
use phasefront_command::interrupt;
use phasefront_command::terminal::{self, progress_bar};
use phasefront_io::display::DisplayFile;
use phasefront_io::{Error, Result, hologram, input, output};
use serde_json::json;
use std::collections::BTreeSet;
use std::path::Path;
use std::time::Instant;

/// Makes the holograms of `pictures` in the folder `output`.
///
/// # Errors
/// Returns an error if there are no pictures, if the folder cannot be used, or if pictures failed.
pub(super) fn run(
    mut request: HologramRequest,
    pictures: Vec<Picture>,
    output: &Path,
    before: Before,
    mut record: RunRecord,
    json: bool,
) -> Result<()> {
    if output::has_extension(output, "png") {
        return Err(Error::file(output, "folders of pictures need the name of a folder"));
    }
    for folder in request.image.frame.folders() {
        output::reading(folder)?;
        if pictures.is_empty() {
            return Err(Error::file(folder, "holds no pictures"));
        }
    }
    output::folder(output, before.holding())?;
    let display = request.display()?;
    record.display(request.hologram.display.name(), &display.target.display)?;
    let names: BTreeSet<_> = pictures.iter().map(|picture| format!("{}.png", picture.name)).collect();
    let claim = Claim::new(output, &record, before, |name| names.contains(name))?;
    interrupt::advise(format!(
        "{} keeps the holograms that are made; the same command with --resume makes the others",
        output.display()
    ));
    let start = Instant::now();
    let (mut made, mut kept, mut failed) = (0, 0, Vec::new());
    let bar = progress_bar(pictures.len() as u64, "pictures");
    for picture in &pictures {
        let path = output.join(format!("{}.png", picture.name));
        match still(&mut request, picture, &path, &display, &record, claim.resumes) {
            Ok(true) => made += 1,
            Ok(false) => kept += 1,
            Err(e) => {
                bar.suspend(|| log::error!("{e}"));
                failed.push(json!({"picture": picture.name, "error": e.to_string()}));
            }
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    let seconds = start.elapsed().as_secs_f64();
    let count = failed.len();
    terminal::print(
        json,
        &json!({
            "output": output.display().to_string(), "made": made, "kept": kept, "failed": failed, "seconds": seconds,
        }),
        format!(
            "{}: {made} made, {kept} kept, {count} failed in {seconds:.1} s",
            output.display()
        ),
    );
    if count > 0 {
        return Err(Error::Input(format!("{count} of {} pictures failed", pictures.len())));
    }
    Ok(())
}

/// Makes the hologram of one picture and returns whether it did. If `resumes` is set, an existing hologram of the same
/// files is kept.
fn still(
    request: &mut HologramRequest,
    picture: &Picture,
    path: &Path,
    display: &DisplayFile,
    record: &RunRecord,
    resumes: bool,
) -> Result<bool> {
    if !picture.is_whole {
        let alone = &picture.files[0];
        return Err(Error::file(
            alone,
            "has no partner of the same name in the other folder",
        ));
    }
    let mut made_of = record.fingerprint();
    for file in &picture.files {
        made_of.bytes(&input::read_file(file)?);
    }
    let made_of = made_of.to_string();
    if resumes && path.exists() {
        match hologram::read_made_of(path)? {
            Some((earlier, _)) if earlier == made_of => return Ok(false),
            Some(_) => {}
            None => {
                return Err(Error::file(path, "is of no earlier run; --overwrite replaces it"));
            }
        }
    }
    request.image.frame.take(picture);
    let named = |e: Error| match e {
        Error::File { ref path, .. } if picture.files.contains(path) => e,
        other => Error::file(&picture.files[0], other),
    };
    let (image, _) = request.image(display).map_err(named)?;
    let made = request.make(display, &image).map_err(named)?;
    let (info, _) = infos(display, &made);
    hologram::write_made_of(path, &made.hologram(info), &made_of)?;
    Ok(true)
}
