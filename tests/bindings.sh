# Sourced by tests in shell: where they build, how they install, and the library as it ships.
# shellcheck shell=bash

cache="${XDG_CACHE_HOME:-$HOME/.cache}/phasefront"
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$cache/target}"
mkdir -p "$cache"
. "$(dirname "${BASH_SOURCE[0]}")/skip.sh"

# Copies the tree to folder $1, with a history and what is not committed yet, or fails.
copy_tree() {
    git clone --quiet . "$1" && git ls-files -z -m -o --exclude-standard | xargs -0 -r cp --parents -Pt "$1"
}

# Runs a command as root, or fails.
as_root() {
    if [ "$(id -u)" = 0 ]; then "$@"; else sudo -n "$@"; fi
}

# Installs Debian packages, or fails.
install() {
    need apt-get || return 1
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null 2>&1 && return
    as_root apt-get update -qq >/dev/null 2>&1
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null 2>&1
}

# Builds the whole workspace, for a part of it alone has other features and builds tract anew (never use -p).
# Runs the conformance suite from Rust, whose levels the other languages compare with. Sets `library` and `generator`.
build_library() {
    [ -e tests/conformance/cases.json ] && [ -e ios/Generated/PhasefrontFFI.h ] ||
        cannot 'the conformance suite and the generated Swift are not written yet: CONTRIBUTING.md has the two commands'
    need cargo || PATH="$HOME/.cargo/bin:$PATH"
    need cargo || cannot 'cargo is missing; see https://rustup.rs'
    export PHASEFRONT_CONFORMANCE="$CARGO_TARGET_DIR/conformance"
    cargo build --release --quiet --workspace || exit 1
    cargo test --release --quiet --workspace --test conformance >/dev/null || exit 1
    library="$CARGO_TARGET_DIR/release/libphasefront_ffi.so"
    generator="$CARGO_TARGET_DIR/release/uniffi-bindgen"
}
