# Common functions: the build folders, installation and the released library. Shell tests source this file.
# shellcheck shell=bash

cache="${XDG_CACHE_HOME:-$HOME/.cache}/phasefront"
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$cache/target}"
mkdir -p "$cache"
. "$(dirname "${BASH_SOURCE[0]}")/skip.sh"

# Copies the tree to folder $1, with history and uncommitted changes, or fails.
copy_tree() {
    git clone --quiet . "$1" && git ls-files -z -m -o --exclude-standard | xargs -0 -r cp --parents -Pt "$1"
}

# Runs a command as root, or fails.
as_root() {
    if [ "$(id -u)" = 0 ]; then "$@"; else sudo -n "$@"; fi
}

# Names Debian packages and installs them, or fails. Uses a lock, because steps run in parallel and apt-get cannot.
install() {
    need apt-get || return 1
    echo "installing from Debian: $*" >&2
    (
        flock 9
        get() { as_root env DEBIAN_FRONTEND=noninteractive apt-get -qq -o DPkg::Lock::Timeout=600 "$@" >/dev/null 2>&1; }
        get install -y --no-install-recommends "$@" || { get update && get install -y --no-install-recommends "$@"; }
    ) 9>"$cache/install.lock"
}

# Builds the whole workspace. A part of it has other features, which would build tract again, so never use -p. Runs the
# conformance suite from Rust, whose levels the other languages compare with. Sets `library` and `generator`. In
# tests/run all this exists already.
build_library() {
    library="$CARGO_TARGET_DIR/release/libphasefront_ffi.so"
    generator="$CARGO_TARGET_DIR/release/uniffi-bindgen"
    export PHASEFRONT_CONFORMANCE="$CARGO_TARGET_DIR/conformance"
    [ -z "${PHASEFRONT_BUILT:-}" ] || return 0
    [ -e tests/conformance/cases.json ] && [ -e ios/Generated/PhasefrontFFI.h ] ||
        cannot 'the conformance suite and the generated Swift are not written yet: CONTRIBUTING.md has the two commands'
    need cargo || PATH="$HOME/.cargo/bin:$PATH"
    need cargo || cannot 'cargo is missing; see https://rustup.rs'
    cargo build --release --quiet --workspace || exit 1
    cargo test --release --quiet --workspace --test conformance >"$cache/conformance.log" 2>&1 || {
        cat "$cache/conformance.log"
        exit 1
    }
}

# Installs the packages that bindings/web/package.json names, or fails.
npm_packages() {
    need npm || install nodejs npm || cannot 'npm is missing, and apt-get could not install it'
    (
        flock 9
        [ bindings/web/node_modules/.package-lock.json -nt bindings/web/package.json ] ||
            { echo 'installing from npm: what bindings/web/package.json names' >&2 &&
                npm install --silent --no-fund --no-audit --no-package-lock --prefix bindings/web; }
    ) 9<bindings/web/package.json || cannot 'npm could not install what bindings/web/package.json names'
}

# Builds tests/counting.c for LD_PRELOAD and sets `counter` to its path.
build_counter() {
    need cc || install gcc libc6-dev || cannot 'cc is missing, and apt-get to install it'
    counter="$cache/counting.so"
    cc -std=c11 -O1 -Wall -Wextra -Werror -pedantic -fno-builtin -shared -fPIC tests/counting.c -o "$counter.$$" &&
        mv "$counter.$$" "$counter" || cannot 'tests/counting.c could not be built'
}
