//! Conversion of panics to values.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Runs `work` and returns its result, or the message of its panic in one line. Also handles a panic in the drop of the
/// payload.
pub fn caught<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(work)).map_err(|payload| {
        let message = (payload.downcast_ref::<&str>().map(|s| (*s).to_owned()))
            .or_else(|| payload.downcast_ref::<String>().cloned())
            .unwrap_or_else(|| "a panic".into())
            .replace('\n', " ");
        discard(payload);
        message
    })
}

/// Drops `payload`. If the drop panics, the second payload is leaked, because its drop could panic as well.
fn discard(payload: Box<dyn Any + Send>) {
    if let Err(second) = catch_unwind(AssertUnwindSafe(|| drop(payload))) {
        std::mem::forget(second);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::panic::{panic_any, resume_unwind};

    struct Bomb;

    impl Drop for Bomb {
        fn drop(&mut self) {
            // The payload of this panic is another bomb.
            if !std::thread::panicking() {
                resume_unwind(Box::new(Bomb));
            }
        }
    }

    #[test]
    fn a_panic_is_one_line_and_its_payload_ends_quietly() {
        assert_eq!(caught(|| 1), Ok(1));
        assert_eq!(
            caught(|| resume_unwind(Box::new("no\nway"))),
            Err::<(), _>("no way".into())
        );
        let text = || resume_unwind(Box::new(String::from("text")));
        assert_eq!(caught(text), Err::<(), _>("text".into()));
        assert_eq!(caught(|| resume_unwind(Box::new(Bomb))), Err::<(), _>("a panic".into()));
        assert_eq!(caught(|| panic_any(Bomb)), Err::<(), _>("a panic".into()));
    }
}
