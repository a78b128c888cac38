//! The threads on which a session computes.

#[cfg(not(target_family = "wasm"))]
use super::computing::Computing;
use super::guarded::lock;
#[cfg(not(target_family = "wasm"))]
use super::options::SessionOptions;
use super::process_id::ProcessId;
use phasefront_core::runtime::error::{Error, Result};
pub(super) use pollster::block_on;
#[cfg(not(target_family = "wasm"))]
use rayon::ThreadPool;
use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex};

/// A pool of threads. WebAssembly cannot start any: there the caller's thread computes, with those that a page started.
pub(super) struct Threads(#[cfg(not(target_family = "wasm"))] ThreadPool);

impl Threads {
    /// Starts `threads` threads, or as many as the device has.
    ///
    /// # Errors
    /// Returns an error if threads cannot be started.
    #[cfg(target_family = "wasm")]
    pub(super) fn start(threads: Option<NonZeroUsize>) -> Result<Self> {
        match threads.map_or(1, NonZeroUsize::get) {
            1 => Ok(Threads()),
            many => Err(Error::Session(format!(
                "{many} threads are asked for, and WebAssembly has one; give 1, or none"
            ))),
        }
    }

    /// Starts `threads` threads, or as many as the device has.
    ///
    /// # Errors
    /// Returns an error if threads cannot be started.
    #[cfg(not(target_family = "wasm"))]
    pub(super) fn start(threads: Option<NonZeroUsize>) -> Result<Self> {
        let pool = rayon::ThreadPoolBuilder::new()
            .thread_name(|i| format!("phasefront {i}"))
            // These threads do nothing but compute.
            .start_handler(|_| std::mem::forget(Computing::begin()));
        let device = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
        let pool = match threads {
            Some(threads) => pool.num_threads(threads.get()),
            None if device > SessionOptions::MOST_THREADS => pool.num_threads(SessionOptions::MOST_THREADS),
            None => pool,
        };
        let started = pool.build().map_err(|e| Error::Threads(Arc::new(e)))?;
        Ok(Threads(started))
    }

    /// Returns the threads of holograms without a session, which this process starts once.
    ///
    /// # Errors
    /// Returns an error if threads cannot be started.
    pub(super) fn shared() -> Result<Arc<Self>> {
        static SHARED: Mutex<Option<(ProcessId, Arc<Threads>)>> = Mutex::new(None);
        let mut shared = lock(&SHARED);
        match &*shared {
            Some((process, threads)) if process.is_current() => Ok(threads.clone()),
            _ => {
                let threads = Arc::new(Self::start(None)?);
                // Those of a process that was forked are not there to be ended.
                std::mem::forget(shared.replace((ProcessId::current(), threads.clone())));
                Ok(threads)
            }
        }
    }

    /// Runs `work` on these threads and returns its result.
    pub(super) fn install<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        #[cfg(target_family = "wasm")]
        return work();
        #[cfg(not(target_family = "wasm"))]
        self.0.install(work)
    }

    /// Runs the future of `work` on these threads and blocks until it is done. On platforms without threads the caller
    /// awaits it, because a browser's GPU answers only while nothing blocks.
    pub(super) async fn run<R: Send>(&self, work: impl AsyncFnOnce() -> R + Send) -> R {
        #[cfg(target_family = "wasm")]
        return work().await;
        #[cfg(not(target_family = "wasm"))]
        self.0.install(|| block_on(work()))
    }
}
