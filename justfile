# What saves typing. `just` lists them; https://just.systems

export CARGO_TARGET_DIR := env("CARGO_TARGET_DIR", cache_directory() / "phasefront/target")

_default:
    @just --list

# All tests, or those of Rust whose names hold FILTER
test FILTER="":
    {{ if FILTER == "" { "tests/run" } else { "cargo test --release --workspace " + quote(FILTER) } }}

# The main job on the sample, into out/
sample:
    samples/run

# How fast a frame is here, stage by stage
bench *FLAGS:
    cargo run --release -- bench {{ FLAGS }}

# Write the conformance suite's levels and the generated Swift anew
bless:
    PHASEFRONT_BLESS=1 cargo test --release --workspace --test conformance
    cargo build --release --workspace
    bindings/generate "$CARGO_TARGET_DIR/release/libphasefront_ffi.so"

# The documentation of all crates
docs:
    cargo doc --release --workspace --no-deps --open
