// swift-tools-version: 6.0
// For apps that depend on the git URL, which SwiftPM takes only with a Package.swift at the root. A release writes its
// version, address and checksums here before it is tagged; work on Phasefront itself is done with ios/Package.swift.
// With PHASEFRONT_FULL=1 in the environment of Xcode or `swift build` the library has tract and the GPU (docs/ios.md).
import PackageDescription

let version = "0.1.0"
let checksum = "0000000000000000000000000000000000000000000000000000000000000000"
let fullChecksum = "0000000000000000000000000000000000000000000000000000000000000000"
let isFull = Context.environment["PHASEFRONT_FULL"] == "1"
let framework = isFull ? "PhasefrontFFI-full.xcframework.zip" : "PhasefrontFFI.xcframework.zip"

let package = Package(
    name: "Phasefront",
    platforms: [.iOS(.v16)],
    products: [.library(name: "Phasefront", targets: ["Phasefront"])],
    targets: [
        .binaryTarget(
            name: "PhasefrontFFI",
            url: "https://example.org/phasefront/releases/download/v\(version)/\(framework)",
            checksum: isFull ? fullChecksum : checksum),
        .target(
            name: "PhasefrontCore", dependencies: ["PhasefrontFFI"], path: "ios/Sources/PhasefrontCore",
            resources: [.copy("PrivacyInfo.xcprivacy"), .copy("THIRD-PARTY.md")]),
        .target(name: "Phasefront", dependencies: ["PhasefrontCore"], path: "ios/Sources/Phasefront"),
    ]
)
