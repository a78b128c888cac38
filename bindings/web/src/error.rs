//! Converts errors to JavaScript's, and creates plain objects.

use js_sys::{Object, Reflect};
use wasm_bindgen::prelude::*;

/// The result of a call, or an `Error` with a `kind`.
pub(crate) type Answer<T> = Result<T, JsValue>;

/// Creates an `Error` of `kind` with `message`.
pub(crate) fn error(kind: &str, message: &str) -> JsValue {
    let error = js_sys::Error::new(message);
    // Setting a property of our own object cannot fail.
    let _ = Reflect::set(&error, &"kind".into(), &kind.into());
    error.into()
}

/// Creates the error for an invalid setting or argument.
pub(crate) fn setting(message: &str) -> JsValue {
    error("setting", message)
}

/// Converts an error of the core.
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

/// Creates a plain object.
pub(crate) fn object<'a>(fields: impl IntoIterator<Item = (&'a str, JsValue)>) -> Object {
    let object = Object::new();
    for (name, value) in fields {
        let _ = Reflect::set(&object, &name.into(), &value);
    }
    object
}

/// Converts panics to errors that are thrown, and sends warnings to the console. Called once when the module is loaded.
#[wasm_bindgen(start)]
pub fn start() {
    crate::log::to_console();
    std::panic::set_hook(Box::new(|info| {
        let said = info.payload_as_str().unwrap_or("a panic").replace('\n', " ");
        let place = info.location().map(|at| format!(" at {}:{}", at.file(), at.line()));
        wasm_bindgen::throw_val(error("panic", &format!("{said}{}", place.unwrap_or_default())));
    }));
}

/// Returns the version of the library.
#[wasm_bindgen]
pub fn version() -> String {
    env!("CARGO_PKG_VERSION").to_owned()
}
