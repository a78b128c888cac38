//! Errors as JavaScript has them, and plain objects of numbers.

use js_sys::{Object, Reflect};
use wasm_bindgen::prelude::*;

/// What a call gives, or an `Error` with a `kind`.
pub(crate) type Answer<T> = Result<T, JsValue>;

/// An `Error` of `kind` that says `message`.
pub(crate) fn error(kind: &str, message: &str) -> JsValue {
    let error = js_sys::Error::new(message);
    // A property of an object of our own can always be set.
    let _ = Reflect::set(&error, &"kind".into(), &kind.into());
    error.into()
}

/// A refused setting or argument.
pub(crate) fn setting(message: &str) -> JsValue {
    error("setting", message)
}

/// The core's error.
pub(crate) fn of_core(core: phasefront::Error) -> JsValue {
    use phasefront::Error;
    let kind = match &core {
        Error::Display(_) => "display",
        Error::Frame(_) => "frame",
        Error::Timestamp { .. } => "timestamp",
        Error::Setting(_) => "setting",
        Error::Network(_) => "network",
        Error::Session(_) | Error::Threads(_) | Error::Lost(_) => "session",
        _ => "internal",
    };
    error(kind, &core.to_string())
}

/// A plain object.
pub(crate) fn object<const N: usize>(fields: [(&str, JsValue); N]) -> Object {
    let object = Object::new();
    for (name, value) in fields {
        let _ = Reflect::set(&object, &name.into(), &value);
    }
    object
}

/// Makes panics errors that are thrown; called once, when the module is loaded.
#[wasm_bindgen(start)]
pub fn start() {
    std::panic::set_hook(Box::new(|info| {
        let said = info.payload_as_str().unwrap_or("a panic").replace('\n', " ");
        let place = info.location().map(|at| format!(" at {}:{}", at.file(), at.line()));
        wasm_bindgen::throw_val(error("panic", &format!("{said}{}", place.unwrap_or_default())));
    }));
}

/// The version of the library.
#[wasm_bindgen]
pub fn version() -> String {
    env!("CARGO_PKG_VERSION").to_owned()
}
