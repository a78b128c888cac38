//! The name of a browser's adapter, which wgpu does not pass on.

use js_sys::{Function, Promise, Reflect, global};
use wasm_bindgen::{JsCast, JsValue};
use wasm_bindgen_futures::JsFuture;

/// Returns the maker, the architecture and the description of the adapter that the browser gives, as far as it tells
/// them, or an empty text if it gives none.
pub(super) async fn adapter_name() -> String {
    let info = info().await.unwrap_or(JsValue::UNDEFINED);
    let part = |name: &str| Reflect::get(&info, &name.into()).ok()?.as_string();
    let parts = ["vendor", "architecture", "description"].map(|name| part(name).unwrap_or_default());
    let parts: Vec<_> = parts.into_iter().filter(|part| !part.is_empty()).collect();
    parts.join(" ")
}

async fn info() -> Result<JsValue, JsValue> {
    let navigator = Reflect::get(&global(), &"navigator".into())?;
    let gpu = Reflect::get(&navigator, &"gpu".into())?;
    let request: Function = Reflect::get(&gpu, &"requestAdapter".into())?.dyn_into()?;
    let promise: Promise = request.call0(&gpu)?.dyn_into()?;
    Reflect::get(&JsFuture::from(promise).await?, &"info".into())
}
