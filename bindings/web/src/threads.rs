//! Threads of the browser, each a worker with an instance of this module in the same memory. They help the worker that
//! starts them. Only the package's build with threads has them.

use crate::error::{Answer, setting};
use js_sys::Array;
use rayon::{ThreadBuilder, ThreadPoolBuilder};
use std::sync::{Condvar, Mutex, PoisonError};
use wasm_bindgen::prelude::*;

/// The threads that no worker runs yet.
static WAITING: Mutex<Vec<ThreadBuilder>> = Mutex::new(Vec::new());
static ADDED: Condvar = Condvar::new();

/// Returns the module and its memory, for helpers.
#[wasm_bindgen(js_name = ofThisModule)]
pub fn of_this_module() -> Array {
    Array::of2(&wasm_bindgen::module(), &wasm_bindgen::memory())
}

/// Makes this thread and `count − 1` helpers, each of which calls [`help`], the threads of every session. Waits until
/// they run.
///
/// # Errors
/// Throws an error of kind `setting` if this module has computed or started threads before.
#[wasm_bindgen(js_name = startThreads)]
pub fn start_threads(count: u32) -> Answer<()> {
    let wait_for_worker = |thread| {
        WAITING.lock().unwrap_or_else(PoisonError::into_inner).push(thread);
        ADDED.notify_one();
        Ok(())
    };
    ThreadPoolBuilder::new()
        .num_threads(count as usize)
        .use_current_thread()
        .spawn_handler(wait_for_worker)
        .build_global()
        .map_err(|error| setting(&format!("the threads cannot be started: {error}")))
}

/// Runs a thread of [`start_threads`] on the calling worker, which does nothing else from then on.
#[wasm_bindgen]
pub fn help() {
    let mut waiting = WAITING.lock().unwrap_or_else(PoisonError::into_inner);
    let thread = loop {
        match waiting.pop() {
            Some(thread) => break thread,
            None => waiting = ADDED.wait(waiting).unwrap_or_else(PoisonError::into_inner),
        }
    };
    drop(waiting);
    thread.run();
}
