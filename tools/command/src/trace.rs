//! Traces of when each stage of each frame began and ended, and on which thread, as files for Perfetto and Chrome.

use phasefront_io::Result;
use phasefront_io::output::{self, write_atomically};
use std::io::Write;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use tracing_chrome::ChromeLayerBuilder;
use tracing_subscriber::Layer;
use tracing_subscriber::filter::filter_fn;
use tracing_subscriber::layer::SubscriberExt;

/// The memory that the trace writer's thread shares with the caller.
#[derive(Clone, Default)]
struct Kept(Arc<Mutex<Vec<u8>>>);

impl Write for Kept {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// Does `work` and writes a trace of its stages to `path` in Chrome's format. The trace takes about 3 kB per frame and
/// stays in memory until the end. Its spans are those of the core; each has its name, its thread and the microseconds
/// since the start. Work that fails leaves no trace.
///
/// # Errors
/// Returns the error of `work`, or an error if the file cannot be written.
pub(crate) fn traced<T>(path: &Path, work: impl FnOnce() -> Result<T>) -> Result<T> {
    output::file(path, &["json"])?;
    let kept = Kept::default();
    let builder = ChromeLayerBuilder::new().writer(kept.clone());
    let (layer, written) = builder.include_args(true).include_locations(false).build();
    let layer = layer.with_filter(filter_fn(|span| span.target() == "phasefront"));
    // Set for all threads, because stages run on threads of sessions and pools. A process traces only once.
    let _ = tracing::subscriber::set_global_default(tracing_subscriber::registry().with(layer));
    let result = work()?;
    drop(written);
    let trace = std::mem::take(&mut *kept.0.lock().unwrap_or_else(PoisonError::into_inner));
    write_atomically(path, |out| out.write_all(&trace))?;
    Ok(result)
}
