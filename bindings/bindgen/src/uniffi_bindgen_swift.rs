//! Generates the Swift bindings, their C header and its module map from a built `phasefront-ffi` library.

fn main() {
    uniffi::uniffi_bindgen_swift();
}
