#!/usr/bin/env bash
# Builds PhasefrontFFI.xcframework for Package.swift, on Linux or a Mac: for devices, the simulator and macOS. A static
# library of Rust needs neither a linker nor an SDK; on Linux zig assembles what dependencies bring, and LLVM joins the
# processors. `ios/build-xcframework.sh [--kernels-only] [--release] [PLATFORM…]` takes the platforms ios, simulator and
# macos, by default all. --kernels-only leaves out tract and the GPU (docs/ios.md). --release also zips the framework and
# prints the checksum for the Package.swift at the root. PHASEFRONT_PROFILE names another cargo profile than `mobile`.
set -euo pipefail
cd "$(dirname "$0")/.."

features=(--features gpu)
zip=
platforms=()
for argument; do
    case $argument in
    --kernels-only) features=(--no-default-features --features built-in-network) ;;
    --release) zip=1 ;;
    ios | simulator | macos) platforms+=("$argument") ;;
    *)
        echo 'usage: ios/build-xcframework.sh [--kernels-only] [--release] [ios] [simulator] [macos]' >&2
        exit 2
        ;;
    esac
done
profile=${PHASEFRONT_PROFILE:-mobile}
[ ${#platforms[@]} -gt 0 ] || platforms=(ios simulator macos)
targets_of() {
    case $1 in
    ios) echo aarch64-apple-ios ;;
    simulator) echo aarch64-apple-ios-sim x86_64-apple-ios ;;
    macos) echo aarch64-apple-darwin x86_64-apple-darwin ;;
    esac
}
targets=()
for platform in "${platforms[@]}"; do
    # shellcheck disable=SC2207 # Names without spaces.
    targets+=($(targets_of "$platform"))
done
export IPHONEOS_DEPLOYMENT_TARGET=16.0 MACOSX_DEPLOYMENT_TARGET=13.0
built="${CARGO_TARGET_DIR:-target}"
build="$built/xcframework"
framework=ios/PhasefrontFFI.xcframework
rm -rf "$build" "$framework"
mkdir -p "$build" "$framework"

if [ "$(uname)" = Darwin ]; then
    lipo=lipo
    export NM=nm
else
    llvm=$(dirname "$(command -v llvm-lipo || ls /usr/lib/llvm-*/bin/llvm-lipo | tail -n 1)")
    lipo="$llvm/llvm-lipo"
    export NM="$llvm/llvm-nm"
    . release/zig
    # cc asks for an SDK, whose headers assembly does not include.
    SDKROOT=$(realpath "$build")
    export SDKROOT
    for target in "${targets[@]}"; do
        export "CC_${target//-/_}=$zig_clang" "AR_${target//-/_}=$zig_ar"
    done
fi

sysroot=$(rustc --print sysroot)
for target in "${targets[@]}"; do
    standard=()
    [ -d "$sysroot/lib/rustlib/$target/lib" ] || rustup target add "$target" || {
        # Some mirrors of Rust have no standard library for the simulator. It can be built, which is unstable.
        rustup component add rust-src
        standard=(-Z build-std=std,panic_unwind)
    }
    ${standard:+env RUSTC_BOOTSTRAP=1} cargo rustc "${standard[@]}" --profile "$profile" --package phasefront-ffi "${features[@]}" --target "$target" --crate-type staticlib
    library="$built/$target/${profile/#dev/debug}/libphasefront_ffi.a"
    mkdir -p "$build/$target"
    cp "$library" "$build/$target/"
    release/without-bitcode "$build/$target/libphasefront_ffi.a"
done
ios/required-reasons "$build/${targets[0]}/libphasefront_ffi.a"

# Adds a folder of the framework: `slice PLATFORM VARIANT TARGET…` joins the processors of the targets.
slice() {
    local platform=$1 variant=$2 libraries=() processors=() target name
    shift 2
    for target; do
        libraries+=("$build/$target/libphasefront_ffi.a")
        processors+=("$([[ $target = aarch64* ]] && echo arm64 || echo x86_64)")
    done
    name="$platform-$(IFS=_ && echo "${processors[*]}")${variant:+-$variant}"
    # The headers have a folder of their own, because the module maps of several frameworks would collide in one.
    mkdir -p "$framework/$name/Headers/PhasefrontFFI"
    cp ios/Generated/PhasefrontFFI.h ios/Generated/module.modulemap "$framework/$name/Headers/PhasefrontFFI/"
    "$lipo" -create "${libraries[@]}" -output "$framework/$name/libphasefront_ffi.a"
    {
        printf '    <dict>\n'
        printf '      <key>%s</key>\n      <string>%s</string>\n' BinaryPath libphasefront_ffi.a HeadersPath Headers \
            LibraryIdentifier "$name" LibraryPath libphasefront_ffi.a
        printf '      <key>SupportedArchitectures</key>\n      <array>\n'
        printf '        <string>%s</string>\n' "${processors[@]}"
        printf '      </array>\n      <key>SupportedPlatform</key>\n      <string>%s</string>\n' "$platform"
        [ -z "$variant" ] || printf '      <key>SupportedPlatformVariant</key>\n      <string>%s</string>\n' "$variant"
        printf '    </dict>\n'
    } >>"$build/slices"
}
for platform in "${platforms[@]}"; do
    # shellcheck disable=SC2046 # Names without spaces.
    case $platform in
    simulator) slice ios simulator $(targets_of simulator) ;;
    *) slice "$platform" '' $(targets_of "$platform") ;;
    esac
done
cat >"$framework/Info.plist" <<END
<?xml version="1.0" encoding="UTF-8"?>
<!DOCTYPE plist PUBLIC "-//Apple//DTD PLIST 1.0//EN" "http://www.apple.com/DTDs/PropertyList-1.0.dtd">
<plist version="1.0">
<dict>
  <key>AvailableLibraries</key>
  <array>
$(cat "$build/slices")
  </array>
  <key>CFBundlePackageType</key>
  <string>XFWK</string>
  <key>XCFrameworkFormatVersion</key>
  <string>1.0</string>
</dict>
</plist>
END
# For users of the framework without the Swift package, which has the manifest and the notices as resources.
cp LICENSE-MIT LICENSE-APACHE THIRD-PARTY.md ios/Sources/PhasefrontCore/PrivacyInfo.xcprivacy "$framework/"

if [ -n "$zip" ]; then
    file="$build/PhasefrontFFI.xcframework.zip"
    # The same files give the same checksum, which is SHA-256, as from `swift package compute-checksum`.
    python3 - "$framework" "$file" <<'END'
import hashlib
import sys
import zipfile
from pathlib import Path

framework, file = map(Path, sys.argv[1:])
with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
    for of in sorted(path for path in framework.rglob("*") if path.is_file()):
        entry = zipfile.ZipInfo(of.relative_to(framework.parent).as_posix())
        entry.external_attr = 0o100644 << 16
        entry.compress_type = zipfile.ZIP_DEFLATED
        archive.writestr(entry, of.read_bytes())
print(file)
print(hashlib.sha256(file.read_bytes()).hexdigest())
END
fi
