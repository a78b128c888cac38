//! Conversion of panics in other crates, caused by broken files, to errors.

use std::cell::Cell;
use std::sync::Once;

thread_local! {
    static IS_QUIET: Cell<bool> = const { Cell::new(false) };
}

/// Runs `work` and returns its result, or its panic message as an error. The panic is not printed. `work` must not
/// modify state that a panic would leave inconsistent.
pub fn caught<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let printing = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |about| {
            if !IS_QUIET.get() {
                printing(about);
            }
        }));
    });
    let before = IS_QUIET.replace(true);
    let done = phasefront_core::runtime::caught::caught(work);
    IS_QUIET.set(before);
    done
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_its_message() {
        assert_eq!(caught(|| 7), Ok(7));
        let nothing: [u8; 0] = [];
        let why = caught(|| nothing[std::hint::black_box(3)]);
        assert!(why.is_err_and(|why| why.contains("out of bounds")));
        assert!(caught(|| std::panic::panic_any(7)).is_err());
    }
}
