//! The flags for photographs by a program of the user.

use clap::Args;
use phasefront_calibration::camera::program::CaptureProgram;
use phasefront_io::{Error, Result};
use std::time::Duration;

/// A program that shows patterns and photographs them.
#[derive(Args, Default)]
pub(super) struct CaptureFlags {
    /// Program that shows each pattern and photographs it, with its arguments; comes last (docs/calibration.md)
    #[arg(long, value_name = "COMMAND", num_args = 1.., allow_hyphen_values = true)]
    capture: Option<Vec<String>>,
    /// How often --capture is asked for a photograph until it is good
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u8).range(1..))]
    capture_tries: u8,
    /// Seconds that --capture has for a photograph
    #[arg(long, value_name = "S", default_value_t = 60.0)]
    capture_timeout_s: f64,
}

impl CaptureFlags {
    pub(super) fn is_given(&self) -> bool {
        self.capture.is_some()
    }

    /// Returns the program, which starts with the first photograph that is missing.
    pub(super) fn later(&self) -> Result<Capture<'_>> {
        let timeout = Duration::try_from_secs_f64(self.capture_timeout_s)
            .map_err(|e| Error::Usage(format!("--capture-timeout-s {}: {e}", self.capture_timeout_s)))?;
        Ok(Capture {
            flags: self,
            timeout,
            running: None,
        })
    }
}

/// The program of --capture, if it is given.
pub(super) struct Capture<'a> {
    flags: &'a CaptureFlags,
    timeout: Duration,
    running: Option<CaptureProgram>,
}

impl Capture<'_> {
    /// Checks whether there is a program.
    pub(super) fn is_given(&self) -> bool {
        self.flags.is_given()
    }

    /// Returns the running program, or `None` if none is given.
    pub(super) fn program(&mut self) -> Result<Option<&mut CaptureProgram>> {
        if let (None, Some(command)) = (&self.running, &self.flags.capture) {
            let tries = self.flags.capture_tries.into();
            self.running = Some(CaptureProgram::start(command, tries, self.timeout)?);
        }
        Ok(self.running.as_mut())
    }
}
