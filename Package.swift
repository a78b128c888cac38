// swift-tools-version: 6.0
// For apps that depend on the git URL, which SwiftPM takes only with a Package.swift at the root. A release writes its
// version, address and checksum here before it is tagged; work on Phasefront itself is done with ios/Package.swift.
import PackageDescription

let version = "0.1.0"
let checksum = "0000000000000000000000000000000000000000000000000000000000000000"

let package = Package(
    name: "Phasefront",
    platforms: [.iOS(.v16)],
    products: [.library(name: "Phasefront", targets: ["Phasefront"])],
    targets: [
        .binaryTarget(
            name: "PhasefrontFFI",
            url: "https://example.org/phasefront/releases/download/v\(version)/PhasefrontFFI.xcframework.zip",
            checksum: checksum),
        .target(
            name: "PhasefrontCore", dependencies: ["PhasefrontFFI"], path: "ios/Sources/PhasefrontCore",
            resources: [.copy("PrivacyInfo.xcprivacy"), .copy("THIRD-PARTY.md")]),
        .target(name: "Phasefront", dependencies: ["PhasefrontCore"], path: "ios/Sources/Phasefront"),
    ]
)
