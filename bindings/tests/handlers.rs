//! Tests a log handler that closes the session whose frame is being computed, on the thread that computes it.
#![allow(clippy::unwrap_used)]

mod small_frame;

use phasefront_ffi::{
    ListenerError, LogLevel, LogListener, Method, PhasefrontError, RawSession, RunningMode, Target, display_from_toml,
    session_options, set_log_listener,
};
use small_frame::{H, W, process};
use std::sync::{Arc, OnceLock, mpsc};
use std::time::Duration;
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Metadata, Subscriber};

/// Logs in the middle of a frame, as wgpu and tract do.
struct Logging;

impl Subscriber for Logging {
    fn enabled(&self, _: &Metadata<'_>) -> bool {
        true
    }

    fn new_span(&self, span: &Attributes<'_>) -> Id {
        if span.metadata().name() == "method" {
            log::warn!("in the midst");
        }
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}
    fn record_follows_from(&self, _: &Id, _: &Id) {}
    fn event(&self, _: &Event<'_>) {}
    fn enter(&self, _: &Id) {}
    fn exit(&self, _: &Id) {}
}

/// Calls the session at each message, and closes it.
struct Closing(
    Arc<OnceLock<Arc<RawSession>>>,
    mpsc::Sender<Result<(), PhasefrontError>>,
);

impl LogListener for Closing {
    fn on_log(&self, _: LogLevel, message: String) -> Result<(), ListenerError> {
        if let (Some(session), "in the midst") = (self.0.get(), message.as_str()) {
            self.1.send(session.warm_up()).unwrap();
            session.shut_down();
        }
        Ok(())
    }
}

/// This is one test, because a process has only one listener.
#[test]
fn a_log_handler_may_close_the_session_that_computes() {
    tracing::subscriber::set_global_default(Logging).unwrap();
    let display = display_from_toml(format!("width = {W}\nheight = {H}")).unwrap();
    let options = session_options(Target::of_display(display).unwrap(), Some(Method::Sweep)).unwrap();
    let session = RawSession::new(options, RunningMode::Video, None).unwrap();
    let slot = Arc::new(OnceLock::new());
    let (sender, told) = mpsc::channel();
    set_log_listener(LogLevel::Warning, Some(Arc::new(Closing(slot.clone(), sender)))).unwrap();
    assert!(slot.set(session.clone()).is_ok());
    let (sender, done) = mpsc::channel();
    let processing = session.clone();
    std::thread::spawn(move || sender.send(process(&processing).map(|_| ())));
    let given_up = done.recv_timeout(Duration::from_secs(60)).unwrap().unwrap_err();
    assert!(given_up.to_string().contains("given up"), "{given_up}");
    let refused = told.recv().unwrap().unwrap_err();
    assert!(refused.to_string().contains("handler of logs"), "{refused}");
    let closed = process(&session).unwrap_err();
    assert!(closed.to_string().contains("closed"), "{closed}");
}
