# Shortcuts. `just` lists them; see https://just.systems

export CARGO_TARGET_DIR := env("CARGO_TARGET_DIR", cache_directory() / "phasefront/target")

_default:
    @just --list

# Check formatting, documents, spelling and lints, and run the unit tests
check:
    tests/run skips formatting documents spelling lints
    cargo test --release --workspace --lib

# Run the quick tests, or the Rust tests whose names contain FILTER
test FILTER="":
    {{ if FILTER == "" { "tests/run" } else { "cargo test --release --workspace " + quote(FILTER) } }}

# Run all tests: other languages, browsers, phones, fuzzing, training
test-all:
    tests/run --all

# Make the sample's hologram and views in out/
sample:
    samples/run

# Time each stage of a frame on this machine
bench *FLAGS:
    cargo build --release --workspace --bin phasefront
    "$CARGO_TARGET_DIR/release/phasefront" bench {{ FLAGS }}

# Regenerate the levels of the conformance suite, the C header, and the Swift and Python bindings
bless:
    PHASEFRONT_BLESS=1 cargo test --release --workspace --test conformance
    bindings/c/header
    cargo build --release --workspace
    bindings/generate "$CARGO_TARGET_DIR/release/libphasefront_ffi.so"
    PHASEFRONT_BLESS=1 tests/surface/run

# Build and open the documentation of all crates
docs:
    cargo doc --release --workspace --no-deps --open
