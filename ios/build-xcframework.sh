#!/usr/bin/env bash
# Builds PhasefrontFFI.xcframework for Package.swift, on Linux or a Mac: for devices, the simulator and macOS. A static
# library of Rust needs neither a linker nor an SDK; on Linux zig assembles what dependencies bring, and LLVM joins the
# processors. `ios/build-xcframework.sh [--full] [--c] [--release] [PLATFORM…]` takes the platforms ios, simulator and
# macos, by default all. --full adds tract and the GPU (docs/ios.md). --c builds PhasefrontC.xcframework instead, for C, C++
# and Unity. --release also zips the framework and prints the checksum for the Package.swift at the root.
# PHASEFRONT_PROFILE names another cargo profile than `mobile`.
set -euo pipefail
cd "$(dirname "$0")/.."

features=(--no-default-features --features built-in-network)
name=PhasefrontFFI
crate=phasefront-ffi
headers=(ios/Generated/{PhasefrontFFI.h,module.modulemap})
full=
zip=
platforms=()
for argument; do
    case $argument in
    --full)
        features=(--no-default-features --features built-in-network,tract,gpu)
        full=-full
        ;;
    --c)
        name=PhasefrontC
        crate=phasefront-c
        headers=(bindings/c/include/phasefront.h{,pp})
        ;;
    --release) zip=1 ;;
    ios | simulator | macos) platforms+=("$argument") ;;
    *)
        echo 'usage: ios/build-xcframework.sh [--full] [--c] [--release] [ios] [simulator] [macos]' >&2
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
build="$built/$name$full"
framework=ios/$name.xcframework
binary=lib${crate//-/_}.a
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
    # cargo also links the shared libraries of dependencies, which no static library needs.
    # shellcheck disable=SC2016 # The script's own variables.
    printf '#!/bin/sh\nwhile [ "$1" != -o ]; do shift; done\n: >"$2"\n' >"$build/no-linker"
    chmod +x "$build/no-linker"
    for target in "${targets[@]}"; do
        upper=${target^^}
        export "CC_${target//-/_}=$zig_clang" "AR_${target//-/_}=$zig_ar" \
            "CARGO_TARGET_${upper//-/_}_LINKER=$(realpath "$build/no-linker")"
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
    ${standard:+env RUSTC_BOOTSTRAP=1} cargo rustc "${standard[@]}" --profile "$profile" --package $crate "${features[@]}" --target "$target" --crate-type staticlib
    library="$built/$target/${profile/#dev/debug}/$binary"
    mkdir -p "$build/$target"
    cp "$library" "$build/$target/"
    release/without-bitcode "$build/$target/$binary"
done
ios/required-reasons "$build/${targets[0]}/$binary"

# Adds a folder of the framework: `slice PLATFORM VARIANT TARGET…` joins the processors of the targets.
slice() {
    local platform=$1 variant=$2 libraries=() processors=() target slice
    shift 2
    for target; do
        libraries+=("$build/$target/$binary")
        processors+=("$([[ $target = aarch64* ]] && echo arm64 || echo x86_64)")
    done
    slice="$platform-$(IFS=_ && echo "${processors[*]}")${variant:+-$variant}"
    # The headers have a folder of their own, because the module maps of several frameworks would collide in one.
    mkdir -p "$framework/$slice/Headers/$name"
    cp "${headers[@]}" "$framework/$slice/Headers/$name/"
    [ $name != PhasefrontC ] || printf 'module PhasefrontC {\n    header "phasefront.h"\n    export *\n}\n' >"$framework/$slice/Headers/$name/module.modulemap"
    "$lipo" -create "${libraries[@]}" -output "$framework/$slice/$binary"
    {
        printf '    <dict>\n'
        printf '      <key>%s</key>\n      <string>%s</string>\n' BinaryPath "$binary" HeadersPath Headers \
            LibraryIdentifier "$slice" LibraryPath "$binary"
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
    file="$build/$name$full.xcframework.zip"
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
