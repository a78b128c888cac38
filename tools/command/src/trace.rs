//! Traces: when each stage of each frame began and ended, on which thread, as files that Perfetto and Chrome show.

use phasefront_io::Result;
use phasefront_io::output::{self, write_atomically};
use std::io::Write;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use tracing_chrome::ChromeLayerBuilder;
use tracing_subscriber::Layer;
use tracing_subscriber::filter::filter_fn;
use tracing_subscriber::layer::SubscriberExt;

/// Memory that the thread which writes a trace shares with us.
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

/// Does `work`, and writes to `path` the trace of its stages in Chrome's format: about 3 kB a frame, which stay in
/// memory till the end. Spans are those of the core; each has its name, its thread and microseconds since the start.
/// Work that fails leaves no trace.
///
/// # Errors
/// Those of `work`, or a place that cannot be written.
pub(crate) fn traced<T>(path: &Path, work: impl FnOnce() -> Result<T>) -> Result<T> {
    output::file(path, &["json"])?;
    let kept = Kept::default();
    let builder = ChromeLayerBuilder::new().writer(kept.clone());
    let (layer, written) = builder.include_args(true).include_locations(false).build();
    let layer = layer.with_filter(filter_fn(|span| span.target() == "phasefront"));
    // Of all threads: stages run on those of sessions and pools. One process traces once.
    let _ = tracing::subscriber::set_global_default(tracing_subscriber::registry().with(layer));
    let result = work()?;
    drop(written);
    let trace = std::mem::take(&mut *kept.0.lock().unwrap_or_else(PoisonError::into_inner));
    write_atomically(path, |out| out.write_all(&trace))?;
    Ok(result)
}
