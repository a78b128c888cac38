// swift-tools-version: 6.0
// The example app. Run ../build-xcframework.sh, then open this folder in Xcode.
import AppleProductTypes
import PackageDescription

let package = Package(
    name: "PhasefrontExample",
    platforms: [.iOS(.v16)],
    products: [
        .iOSApplication(
            name: "PhasefrontExample",
            targets: ["Example"],
            bundleIdentifier: "org.phasefront.example",
            displayVersion: "1",
            bundleVersion: "1",
            supportedDeviceFamilies: [.phone, .pad],
            supportedInterfaceOrientations: [.landscapeRight],
            capabilities: [.camera(purposeString: "Holograms are made of what the camera sees.")]
        )
    ],
    dependencies: [.package(name: "Phasefront", path: "..")],
    targets: [
        .executableTarget(
            name: "Example",
            dependencies: [.product(name: "Phasefront", package: "Phasefront")],
            path: "Sources",
            resources: [.process("Resources")]
        )
    ]
)
