//! Interrupts, such as Ctrl-C, of runs that take long.

/// Lets an interrupt remove what is half written and print `advice` before it ends the process. On other systems than
/// Unix an interrupt ends the process at once.
pub fn advise(advice: String) {
    #[cfg(unix)]
    unix::advise(advice);
    #[cfg(not(unix))]
    drop(advice);
}

#[cfg(unix)]
mod unix {
    use phasefront_core::runtime::error::Line;
    use phasefront_io::output;
    use signal_hook::consts::{SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;
    use signal_hook::low_level::emulate_default_handler;
    use std::io::{IsTerminal, Write, stderr};

    pub(super) fn advise(advice: String) {
        let mut signals = match Signals::new([SIGINT, SIGTERM]) {
            Ok(signals) => signals,
            Err(e) => return log::warn!("an interrupt may leave a half-written file: {e}"),
        };
        std::thread::spawn(move || {
            for signal in signals.forever() {
                let _none_is_placed = output::give_up();
                // A progress bar may stand in the line.
                let begin = if stderr().is_terminal() { "\n" } else { "" };
                let _ = writeln!(stderr(), "{begin}interrupted: {}", Line(&advice));
                let _ = emulate_default_handler(signal);
            }
        });
    }
}
