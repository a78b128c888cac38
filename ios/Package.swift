// swift-tools-version: 6.0
// The package for work on Phasefront and for apps that depend on a checkout by path. `build-xcframework.sh` builds the
// library. Apps that depend on the git URL use the Package.swift at the root.
import Foundation
import PackageDescription

#if os(Linux)
    // The tests use the library of a Rust build, in the folder that PHASEFRONT_LIBRARY names.
    let library = ProcessInfo.processInfo.environment["PHASEFRONT_LIBRARY"] ?? "../target/release"
    let ffi = Target.systemLibrary(name: "PhasefrontFFI", path: "Generated")
    let link: [LinkerSetting] = [.unsafeFlags(["-L", library]), .linkedLibrary("phasefront_ffi")]
    // The part of the example app that needs no Apple framework.
    let more: [Target] = [
        .target(name: "Benchmark", dependencies: ["PhasefrontCore"], path: "Example.swiftpm/Sources/Benchmark"),
        .testTarget(name: "BenchmarkTests", dependencies: ["Benchmark", "PhasefrontCore"]),
    ]
    let product = Product.library(name: "Phasefront", targets: ["PhasefrontCore"])
#else
    let ffi = Target.binaryTarget(name: "PhasefrontFFI", path: "PhasefrontFFI.xcframework")
    let link: [LinkerSetting] = []
    let more = [Target.target(name: "Phasefront", dependencies: ["PhasefrontCore"])]
    let product = Product.library(name: "Phasefront", targets: ["Phasefront"])
#endif

let package = Package(
    name: "Phasefront",
    platforms: [.iOS(.v16)],
    products: [product],
    targets: [
        ffi,
        .target(
            name: "PhasefrontCore", dependencies: ["PhasefrontFFI"],
            resources: [.copy("PrivacyInfo.xcprivacy"), .copy("THIRD-PARTY.md")], linkerSettings: link),
        .testTarget(name: "PhasefrontCoreTests", dependencies: ["PhasefrontCore"]),
    ] + more
)
