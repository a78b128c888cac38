//! Threads and locks of a live session, collected here so that `fuzz/handover` can replace them with a model checker's,
//! which tries all thread orders.

pub(super) use std::sync::{Arc, Condvar, Mutex, MutexGuard};
pub(super) use std::thread::{Builder, JoinHandle};
pub(super) use std::thread_local;
