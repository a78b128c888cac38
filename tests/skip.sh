# Functions for a missing dependency. Shell tests source this file.
# shellcheck shell=bash

expected_skips="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)/expected-skips"

need() { command -v "$1" >/dev/null; }

# Fails the test. $1 names the missing dependency and how to get it.
cannot() {
    echo "$1"
    exit 1
}

# Records for tests/run that the test, or a part of it, does not run because $1 is missing. $2 adds details. Fails the
# test if expected-skips does not name $1.
skip_or_fail() {
    grep -q "^$1 |" "$expected_skips" || cannot "$1 is missing ($2), and tests/expected-skips does not name it"
    echo "skipped: $1: $2"
    [ -z "${PHASEFRONT_SKIPS:-}" ] || printf '%s\t%s\n' "$1" "$2" >>"$PHASEFRONT_SKIPS"
}

# Installs the Rust target $1. Ends the test without rustup.
rust_target() {
    local library
    library="$(rustc --print sysroot)/lib/rustlib/$1/lib"
    [ ! -d "$library" ] || return 0
    need rustup || {
        skip_or_fail rustup "this Rust has no target $1"
        exit 0
    }
    flock "$expected_skips" rustup target add "$1" >/dev/null 2>&1
    [ -d "$library" ] || cannot "rustup could not add the target $1"
}

# Installs the nightly toolchain. Ends the test without rustup.
rust_nightly() {
    need rustup || {
        skip_or_fail rustup 'this Rust has no nightly toolchain'
        exit 0
    }
    cargo +nightly --version >/dev/null 2>&1 || flock "$expected_skips" rustup toolchain install nightly --profile minimal >/dev/null 2>&1 ||
        cannot 'rustup could not install the nightly toolchain'
}
