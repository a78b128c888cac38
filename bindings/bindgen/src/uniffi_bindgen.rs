//! Generates the Kotlin and the Python bindings from a built `phasefront-ffi` library.

fn main() {
    uniffi::uniffi_bindgen_main();
}
