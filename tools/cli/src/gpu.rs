//! GPUs for the command: selects a device and keeps its compiled programs between runs.

use phasefront::session::{Backend, SessionHandle};
use phasefront_core::runtime::file;
use phasefront_gpu::{Device, DeviceOptions};
use phasefront_io::Result;
use std::io::Write;
use std::path::PathBuf;

/// Returns options for the GPU whose name contains `name`, or for the fastest GPU, with the programs of earlier runs.
pub fn options(name: Option<&str>) -> DeviceOptions {
    DeviceOptions {
        name: name.map(str::to_owned),
        programs: programs().and_then(|path| file::read(&path, file::MOST_TARGET).ok()),
    }
}

/// Saves the compiled programs for the next run. A failure to write this cache only costs time.
pub fn keep_programs(device: &Device) {
    if let Some(why) = device.programs_refused() {
        log::info!("the programs of earlier runs were not taken: {why}");
    }
    if let (Some(path), Some(programs)) = (programs(), device.programs()) {
        let write = || -> std::io::Result<()> {
            let folder = path.parent().unwrap_or(&path);
            std::fs::create_dir_all(folder)?;
            let mut file = tempfile::NamedTempFile::new_in(folder)?;
            file.write_all(&programs)?;
            file.persist(&path)?;
            Ok(())
        };
        if let Err(why) = write() {
            log::info!("{}: {why}", path.display());
        }
    }
}

/// Warms up a session and keeps the compiled programs of its GPU. Warns if `asked` is the GPU and the session runs on
/// the CPU.
///
/// # Errors
/// Returns an error if the session is closed or its computation panics.
pub fn warm_up(session: &SessionHandle, asked: Backend) -> Result<()> {
    session.warm_up()?;
    match session.gpu() {
        Some(device) => keep_programs(&device),
        None if asked == Backend::Gpu => {
            log::warn!("on the CPU: {}", session.statistics().backend.why);
        }
        None => {}
    }
    Ok(())
}

/// Returns the path of the saved programs.
fn programs() -> Option<PathBuf> {
    let of = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    let folder = of("XDG_CACHE_HOME").or_else(|| Some(of("HOME")?.join(".cache")))?;
    Some(folder.join("phasefront/gpu-programs"))
}
