import Phasefront
import PhotosUI
import SwiftUI

@main
struct ExampleApp: App {
    @StateObject private var show = Show()

    var body: some Scene {
        WindowGroup {
            ContentView(show: show)
        }
    }
}

/// What the app shows: nothing in the background, the benchmark, a photo, or the camera, again after each try.
private struct Shown: Equatable {
    let isActive, isMeasuring: Bool
    let photo: PhotosPickerItem?
    let tries: Int
}

struct ContentView: View {
    @ObservedObject var show: Show
    @Environment(\.scenePhase) private var phase
    @State private var isMeasuring = false
    @State private var photo: PhotosPickerItem?
    @State private var tries = 0
    /// The focus, which the system restores after it has ended the app.
    @SceneStorage("zMm") private var storedZMm = 0.0

    var body: some View {
        VStack {
            PreviewView(show: show)
                .frame(maxWidth: .infinity, maxHeight: .infinity)
            Slider(value: $show.zMm, in: -3...3) {
                Text("Focus")
            } minimumValueLabel: {
                Text("far")
            } maximumValueLabel: {
                Text("near")
            }
            .accessibilityValue(String(format: "%.1f millimetres", show.zMm))
            // In one row where the text size allows.
            ViewThatFits {
                HStack { controls }
                VStack(alignment: .leading) { controls }
            }
        }
        .padding()
        // The session is closed while the benchmark is shown, so that nothing else computes.
        .task(id: Shown(isActive: phase != .background, isMeasuring: isMeasuring, photo: photo, tries: tries)) {
            if phase == .background || isMeasuring { return }
            if let photo {
                if let data = try? await photo.loadTransferable(type: Data.self) { await show.show(photo: data) }
            } else {
                await show.run()
            }
        }
        .onAppear { show.zMm = storedZMm }
        .onChange(of: show.zMm) { storedZMm = $0 }
        .onReceive(NotificationCenter.default.publisher(for: UIApplication.didReceiveMemoryWarningNotification)) { _ in
            show.freeMemory()
        }
        .sheet(isPresented: $isMeasuring) { BenchmarkView() }
    }

    @ViewBuilder private var controls: some View {
        VStack(alignment: .leading) {
            Text(show.state.text)
                .font(.callout)
            Text(show.statistics)
                .font(.caption.monospacedDigit())
        }
        Spacer()
        if case .failed = show.state { Button("Try again") { tries += 1 } }
        if show.isForbidden, let settings = URL(string: UIApplication.openSettingsURLString) {
            Link("Allow the camera", destination: settings)
        }
        // The picker runs outside the app, so it needs no permission.
        PhotosPicker("Portrait", selection: $photo, matching: .depthEffectPhotos)
        if photo != nil { Button("Camera") { photo = nil } }
        Button("Benchmark") { isMeasuring = true }
    }
}

/// What an eye sees of the hologram. A tap focuses.
private struct PreviewView: View {
    @ObservedObject var show: Show

    var body: some View {
        if let preview = show.preview {
            Image(preview, scale: 1, label: Text("What an eye sees of the hologram"))
                .resizable()
                .aspectRatio(contentMode: .fit)
                .overlay {
                    GeometryReader { place in
                        Color.clear
                            .contentShape(Rectangle())
                            .onTapGesture { at in
                                show.focus(atX: at.x / place.size.width, y: at.y / place.size.height)
                            }
                    }
                }
                .accessibilityHint("Tap to focus on a point")
        }
    }
}
