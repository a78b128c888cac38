#!/usr/bin/env bash
# Builds PhasefrontFFI.xcframework for Package.swift, on a Mac with Xcode and Rust, for devices and for the simulator on
# both processors. With --release it also zips the framework and prints the checksum for the Package.swift at the root.
set -euo pipefail
cd "$(dirname "$0")/.."

targets=(aarch64-apple-ios aarch64-apple-ios-sim x86_64-apple-ios)
export IPHONEOS_DEPLOYMENT_TARGET=16.0
build="${CARGO_TARGET_DIR:-target}/xcframework"
rm -rf "$build" ios/PhasefrontFFI.xcframework
mkdir -p "$build/Headers/PhasefrontFFI" "$build/simulator"

rustup target add "${targets[@]}"
for target in "${targets[@]}"; do
    cargo rustc --profile mobile --package phasefront-ffi --features gpu --target "$target" --crate-type staticlib
done
library() { echo "${CARGO_TARGET_DIR:-target}/$1/mobile/libphasefront_ffi.a"; }

# Puts the headers in a folder of their own, because the module maps of several frameworks would collide in one folder.
cp ios/Generated/PhasefrontFFI.h ios/Generated/module.modulemap "$build/Headers/PhasefrontFFI/"
for target in "${targets[@]}"; do strip -S "$(library "$target")"; done
ios/required-reasons "$(library aarch64-apple-ios)"
lipo -create "$(library aarch64-apple-ios-sim)" "$(library x86_64-apple-ios)" -output "$build/simulator/libphasefront_ffi.a"
xcodebuild -create-xcframework \
    -library "$(library aarch64-apple-ios)" -headers "$build/Headers" \
    -library "$build/simulator/libphasefront_ffi.a" -headers "$build/Headers" \
    -output ios/PhasefrontFFI.xcframework
# For users of the framework without the Swift package, which has the notices as a resource.
cp LICENSE-MIT LICENSE-APACHE THIRD-PARTY.md ios/PhasefrontFFI.xcframework/

if [ "${1:-}" = --release ]; then
    (cd ios && zip --quiet --recurse-paths --symlinks - PhasefrontFFI.xcframework) >"$build/PhasefrontFFI.xcframework.zip"
    echo "$build/PhasefrontFFI.xcframework.zip"
    swift package compute-checksum "$build/PhasefrontFFI.xcframework.zip"
fi
