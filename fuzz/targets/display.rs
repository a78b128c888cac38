//! Parses the TOML of displays and plans a small hologram for each.
#![no_main]

use phasefront::Size;
use libfuzzer_sys::fuzz_target;
use phasefront::{Display, ImageSession, Method, SessionOptions, Sweep};

fuzz_target!(|text: &str| {
    match Display::from_toml(text) {
        Err(why) => {
            let why = why.to_string();
            assert!(why.chars().count() < 700 && !why.contains(char::is_control), "{why}");
        }
        Ok(display) => {
            let Ok(display) = display.with_size(Size { width: 8, height: 6 }) else { return };
            // Deep volumes take long to plan and exercise the same code as shallow ones.
            if display.volume_depth_m() / display.pitch_m() > 300.0 {
                return;
            }
            let method = Method::Sweep(Sweep::for_display(&display));
            let mut options = SessionOptions::new(display, method);
            options.threads = std::num::NonZeroUsize::new(1);
            let _ = ImageSession::new(options);
        }
    }
});
