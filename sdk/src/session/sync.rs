//! Threads and locks of a live session, in one place: `fuzz/handover` puts a checker's here, which tries their orders.

pub(super) use std::sync::{Arc, Condvar, Mutex, MutexGuard};
pub(super) use std::thread::{Builder, JoinHandle};
pub(super) use std::thread_local;
