// swift-tools-version: 6.0
// For work on Phasefront itself, and for apps that depend on a checkout by path: the library comes from
// `build-xcframework.sh`. Apps that depend on the git URL take the Package.swift at the root.
import Foundation
import PackageDescription

#if os(Linux)
    // The tests run against the library of a Rust build, in the folder that PHASEFRONT_LIBRARY names.
    let library = ProcessInfo.processInfo.environment["PHASEFRONT_LIBRARY"] ?? "../target/release"
    let ffi = Target.systemLibrary(name: "PhasefrontFFI", path: "Generated")
    let link: [LinkerSetting] = [.unsafeFlags(["-L", library]), .linkedLibrary("phasefront_ffi")]
    // Of the example app, what needs no framework of Apple's.
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
