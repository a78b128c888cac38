import ARKit
import Foundation
import Phasefront
import UIKit
import os

/// Plays a day in the example app's life on the stand-ins. docs/ios.md has it as a table.
@main
@MainActor
struct Day {
    static func main() async {
        let plays: [(String, @MainActor () async throws -> Void)] = [
            ("events lead from state to state", states),
            ("the first launch asks, and the camera starts after yes", firstLaunch),
            ("a denied camera is said, and works once it is allowed", denied),
            ("permission that is taken away is said", revoked),
            ("home releases the camera, and back takes it again", { try await home(lidar: true) }),
            ("the same with two cameras", { try await home(lidar: false) }),
            ("a call interrupts, and the app goes on by itself", { try await call(lidar: true) }),
            ("the same with two cameras", { try await call(lidar: false) }),
            ("a device that is too hot for its camera is said", hot),
            ("the media services are reset", { try await fails(.mediaServicesWereReset, "Dual camera with depth") }),
            ("a camera that fails is said", { try await fails(.unknown, "Failed: ") }),
            ("a device without depth shows the sample scene", noCamera),
            ("an external screen comes and goes", screen),
            ("heat changes the session's quality", heat),
            ("a warning of low memory releases the hologram", memory),
            ("a photo with depth is shown", photo),
            ("buffers say what their colours mean", colours),
        ]
        for (name, play) in plays {
            StandInDevice.shared.change { $0 = .init() }
            do {
                try await play()
            } catch {
                fail("\(name): \(error)")
            }
            print("passed: \(name)")
        }
    }
}

/// The attachments of buffers of cameras, photos and HDR video, and what each means.
@MainActor
private func colours() async throws {
    let (p3, wide) = (kCVImageBufferColorPrimaries_P3_D65, kCVImageBufferColorPrimaries_ITU_R_2020)
    let (hlg, pq) = (
        kCVImageBufferTransferFunction_ITU_R_2100_HLG, kCVImageBufferTransferFunction_SMPTE_ST_2084_PQ
    )
    let said: [(String?, String?, RgbEncoding)] = [
        (nil, nil, .srgb), ("ITU_R_709_2", "ITU_R_709_2", .srgb), (p3, "ITU_R_709_2", .displayP3), (wide, hlg, .bt2020Hlg),
        (wide, pq, .bt2020Pq), (wide, "ITU_R_709_2", .bt2020),
    ]
    for (primaries, transfer, right) in said {
        let buffer = CVBuffer(kCVPixelFormatType_420YpCbCr8BiPlanarFullRange, width: 64, height: 48)
        buffer.attachments[kCVImageBufferColorPrimariesKey] = primaries
        buffer.attachments[kCVImageBufferTransferFunctionKey] = transfer
        let found = try withColourImage(buffer) { $0.encoding }
        if found != right { fail("\(primaries ?? "none"), \(transfer ?? "none"): \(found)") }
    }
    for (name, right) in [(nil, .bt601), ("ITU_R_601_4", .bt601), ("ITU_R_709_2", .bt709), ("ITU_R_2020", .bt2020)]
        as [(String?, YuvMatrix)]
    {
        let buffer = CVBuffer(kCVPixelFormatType_420YpCbCr8BiPlanarFullRange, width: 64, height: 48)
        buffer.attachments[kCVImageBufferYCbCrMatrixKey] = name
        let found = try withColourImage(buffer) { $0.matrix }
        if found != right { fail("matrix \(name ?? "none"): \(found)") }
    }
}

private func fail(_ why: String) -> Never {
    print("FAILED: \(why)")
    exit(1)
}

/// Waits until `done`, or fails after a minute.
@MainActor
private func wait(_ what: @autoclosure () -> String, _ done: () -> Bool) async throws {
    let end = Date() + 60
    while !done() {
        if Date() > end { fail("\(what()) did not come") }
        try await Task.sleep(nanoseconds: 5_000_000)
    }
}

/// The app on its screen: `open` as the view's task does, `close` as it is cancelled.
@MainActor
private final class App {
    let show = Show()
    private var task: Task<Void, Never>?

    func open() { task = Task { await show.run() } }

    func close() async throws {
        task?.cancel()
        await task?.value
        try await wait("the release of the camera") { StandInDevice.shared.now.running == 0 }
        if show.state != .stopped { fail("behind its end the app shows: \(show.state.text)") }
    }

    func shows(_ words: String) async throws {
        try await wait("'\(words)', but '\(show.state.text)',") { show.state.text.hasPrefix(words) }
    }
}

private let lidarCamera = "LiDAR camera"
private let dualCamera = "Dual camera with depth"

@MainActor
private func opened(lidar: Bool) async throws -> App {
    StandInDevice.shared.change {
        $0.hasLidar = lidar
        $0.hasDualCamera = !lidar
        $0.authorization = .authorized
    }
    let app = App()
    app.open()
    try await app.shows(lidar ? lidarCamera : dualCamera)
    return app
}

/// Android's sample has the same table, in SourceStateTest.kt.
@MainActor
private func states() {
    let states: [SourceState] = [
        .stopped, .waitingForPermission(to: "x"), .starting, .running("a"), .interrupted("a"), .failed("a"),
    ]
    func check(_ event: SourceEvent, _ letters: String) {
        let told = states.map { state -> String in
            let next = state.after(event)
            return next == state ? "." : "\(next)".prefix(1).uppercased()
        }
        if told.joined() != letters { fail("\(event) leads to \(told.joined()), not to \(letters)") }
    }
    check(.asked(to: "y"), "WWWWWW")
    check(.started, "SS.SSS")
    check(.stopped, ".SSSSS")
    check(.frame("b"), "..RRR.")
    check(.interrupted("b"), "..III.")
    check(.failed("b"), "..FFF.")
}

@MainActor
private func firstLaunch() async throws {
    StandInDevice.shared.change { $0.hasLidar = true }
    let app = App()
    app.open()
    try await app.shows("Waiting for your permission to use the camera")
    StandInDevice.shared.change { $0.answer = true }
    try await app.shows(lidarCamera)
    try await wait("a picture") { app.show.preview != nil }
    try await app.close()
    app.open()
    try await app.shows(lidarCamera)
    if StandInDevice.shared.now.dialogues != 1 { fail("the user was asked more than once") }
    try await app.close()
}

@MainActor
private func denied() async throws {
    StandInDevice.shared.change { ($0.hasDualCamera, $0.answer) = (true, false) }
    let app = App()
    app.open()
    try await app.shows("Sample scene: the app may not use the camera")
    if !app.show.isForbidden { fail("the way to the settings is not offered") }
    try await app.close()
    StandInDevice.shared.change { $0.authorization = .authorized }
    app.open()
    try await app.shows(dualCamera)
    if app.show.isForbidden { fail("the way to the settings is still offered") }
    try await app.close()
}

@MainActor
private func revoked() async throws {
    let app = try await opened(lidar: true)
    StandInDevice.shared.change { $0.authorization = .denied }
    try await app.shows("Failed: the app may not use the camera")
    try await app.close()
}

@MainActor
private func home(lidar: Bool) async throws {
    let app = try await opened(lidar: lidar)
    // As quickly as a user can.
    for _ in 0..<3 {
        try await app.close()
        app.open()
    }
    try await app.shows(lidar ? lidarCamera : dualCamera)
    if StandInDevice.shared.now.running != 1 { fail("\(StandInDevice.shared.now.running) sessions run") }
    try await app.close()
}

@MainActor
private func call(lidar: Bool) async throws {
    let app = try await opened(lidar: lidar)
    StandInDevice.shared.change { $0.interruption = .videoDeviceInUseByAnotherClient }
    try await app.shows("Interrupted: a call or another app uses the camera")
    StandInDevice.shared.change { $0.interruption = nil }
    try await app.shows(lidar ? lidarCamera : dualCamera)
    try await app.close()
}

@MainActor
private func hot() async throws {
    let app = try await opened(lidar: false)
    StandInDevice.shared.change { $0.interruption = .videoDeviceNotAvailableDueToSystemPressure }
    try await app.shows("Interrupted: the device is too hot for its camera")
    StandInDevice.shared.change { $0.interruption = nil }
    try await app.shows(dualCamera)
    try await app.close()
}

@MainActor
private func fails(_ code: AVError.Code, _ words: String) async throws {
    let app = try await opened(lidar: false)
    let frames = StandInDevice.shared.now.frames
    StandInDevice.shared.change { $0.failure = code }
    try await wait("the failure") { StandInDevice.shared.now.failure == nil }
    try await app.shows(words)
    if code == .mediaServicesWereReset { try await wait("more frames") { StandInDevice.shared.now.frames > frames + 5 } }
    try await app.close()
}

@MainActor
private func noCamera() async throws {
    let app = App()
    app.open()
    try await app.shows("Sample scene: this device has no camera with depth")
    try await wait("a picture") { app.show.preview != nil }
    if StandInDevice.shared.now.dialogues != 0 { fail("the user was asked for a camera that the app does not use") }
    try await app.close()
}

@MainActor
private func screen() async throws {
    let app = try await opened(lidar: true)
    let modulator = CGSize(width: 960, height: 540)
    let scene = UIWindowScene(externalScreen: [CGSize(width: 1920, height: 1080), modulator])
    UIApplication.shared.connectedScenes.insert(scene)
    try await wait("the levels") {
        scene.windows.first?.rootViewController?.view.layer.sublayers?.first?.contents != nil
    }
    if scene.screen.currentMode?.size != modulator { fail("the screen is not in the modulator's mode") }
    if scene.screen.overscanCompensation != .none { fail("the screen scales the levels") }
    UIApplication.shared.connectedScenes.remove(scene)
    let frames = StandInDevice.shared.now.frames
    try await wait("more frames") { StandInDevice.shared.now.frames > frames + 5 }
    try await app.shows(lidarCamera)
    try await app.close()
}

@MainActor
private func heat() async throws {
    let display = HologramDisplay(width: 64, height: 48)
    let session = try HologramSession(SessionOptions.phone(display: display), mode: .live)
    let heat = session.followThermalState()
    ProcessInfo.thermal = .critical
    NotificationCenter.default.post(name: ProcessInfo.thermalStateDidChangeNotification, object: nil)
    let submitting = Task.detached {
        for i in 1...3 as ClosedRange<Int64> {
            try session.submit(CMSampleBuffer(StandInDevice.colour(), timeNs: i * 40_000_000), depth: AVDepthData(StandInDevice.depth()))
            try await Task.sleep(nanoseconds: 100_000_000)
        }
    }
    for await event in session.events {
        guard case .qualityChanged(_, let change) = event else { continue }
        if change.reason != .thermal { fail("the quality changed because of \(change.reason)") }
        break
    }
    try await submitting.value
    session.close()
    ProcessInfo.thermal = .nominal
    withExtendedLifetime(heat) {}
}

@MainActor
private func memory() async throws {
    let app = try await opened(lidar: true)
    try await wait("a picture") { app.show.preview != nil }
    app.show.freeMemory()
    app.show.zMm = 99
    app.show.focus(atX: 0.5, y: 0.5)
    if app.show.zMm != 99 { fail("the hologram is still there") }
    try await wait("a new hologram") {
        app.show.focus(atX: 0.5, y: 0.5)
        return app.show.zMm != 99
    }
    try await app.close()
}

@MainActor
private func photo() async throws {
    let show = Show()
    await show.show(photo: Data())
    if show.state != .running("Photo") { fail("a photo gives: \(show.state.text)") }
}
