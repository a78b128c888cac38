//! Checks that calibration files that can be read are unchanged after they are written and read again.
#![no_main]

use libfuzzer_sys::fuzz_target;
use phasefront::Target;

fuzz_target!(|file: &[u8]| {
    match Target::from_bytes(file) {
        Err(why) => {
            let why = why.to_string();
            assert!(why.chars().count() < 700 && !why.contains(char::is_control), "{why}");
        }
        Ok(target) => {
            let bytes = target.to_bytes().expect("what was read can be written");
            let again = Target::from_bytes(&bytes).expect("what was written can be read");
            assert_eq!(again.display, target.display);
            assert_eq!(again.response, target.response);
        }
    }
});
