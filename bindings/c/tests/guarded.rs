//! No panic leaves a call: each that C sees is inside `call`, or goes through what is.
#![allow(clippy::unwrap_used)]

use std::path::Path;

#[test]
fn every_call_is_guarded() {
    let mut calls = 0;
    for entry in std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("src")).unwrap() {
        let source = std::fs::read_to_string(entry.unwrap().path()).unwrap();
        for function in source.split("#[unsafe(no_mangle)]").skip(1) {
            calls += 1;
            let (signature, body) = function.split_once("{\n").unwrap();
            let body = &body[..body.find("\n}").unwrap()];
            let guarded = [
                "call(|| ",
                "free(",
                "set(options, ",
                "encode(",
                "brighten(options, ",
                "with(session, ",
            ];
            // These read what is there.
            let reads = ["pf_last_error", "pf_version", "pf_third_party_notices"]
                .iter()
                .any(|name| signature.contains(&format!("fn {name}(")));
            assert!(reads || guarded.iter().any(|by| body.contains(by)), "{signature}");
        }
    }
    assert!(calls > 50, "{calls} calls were found");
}
