//! Runs driver calls that may never return (opening and compiling) on a thread that can be abandoned. A browser watches
//! over its drivers itself.

use super::Result;
use std::time::Duration;

/// Runs `work`. Returns the error [`super::GpuError::Lost`] if it takes longer than `patience` or panics.
#[cfg(target_arch = "wasm32")]
pub(super) async fn watched<T>(_what: &str, _patience: Duration, work: impl AsyncFnOnce() -> Result<T>) -> Result<T> {
    work().await
}

/// Runs `work` on a thread of its own and blocks until it is done. Returns the error [`super::GpuError::Lost`] if it
/// takes longer than `patience` or panics.
#[cfg(not(target_arch = "wasm32"))]
pub(super) async fn watched<T: Send + 'static>(
    what: &str,
    patience: Duration,
    work: impl AsyncFnOnce() -> Result<T> + Send + 'static,
) -> Result<T> {
    use super::GpuError;
    use super::device::one_line;
    use phasefront_core::runtime::caught::caught;
    use std::sync::mpsc::{RecvTimeoutError, channel};

    // A pool of one thread, so that the CPU stages run for comparison do not wake all cores.
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .thread_name(|_| "phasefront gpu".into())
        .build()
        .map_err(|why| GpuError::Lost(format!("no thread to open it on: {}", one_line(why))))?;
    let (send, receive) = channel();
    pool.spawn(move || {
        let done = caught(|| pollster::block_on(work()));
        let done = done.unwrap_or_else(|_| Err(GpuError::Lost("its driver's interface panicked".into())));
        // If the work took too long, nobody receives the result.
        let _ = send.send(done);
    });
    match receive.recv_timeout(patience) {
        Ok(done) => done,
        Err(RecvTimeoutError::Timeout) => Err(GpuError::Lost(format!("no answer for {patience:?} {what}"))),
        Err(RecvTimeoutError::Disconnected) => Err(GpuError::Lost(format!("its thread died {what}"))),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::GpuError;
    use super::*;
    use pollster::block_on;
    use std::sync::{Arc, Barrier};

    #[test]
    fn work_that_never_ends_is_left_behind() {
        let long = Duration::from_secs(60);
        assert_eq!(block_on(watched("adding", long, async || Ok(1 + 1))).unwrap(), 2);
        let given = block_on(watched("adding", long, async || {
            Err::<(), _>(GpuError::Wrong("by far".into()))
        }));
        assert!(
            matches!(&given, Err(GpuError::Wrong(why)) if why == "by far"),
            "{given:?}"
        );
        let panicked = block_on(watched("adding", long, async || -> Result<()> {
            std::panic::resume_unwind(Box::new("no"))
        }));
        assert!(matches!(panicked, Err(GpuError::Lost(_))), "{panicked:?}");
        let end = Arc::new(Barrier::new(2));
        let stuck = end.clone();
        let left = watched("while it was tried out", Duration::from_millis(1), async move || {
            stuck.wait();
            Ok(())
        });
        let message = block_on(left).unwrap_err().to_string();
        assert!(message.contains("no answer for 1ms while"), "{message}");
        end.wait();
    }
}
