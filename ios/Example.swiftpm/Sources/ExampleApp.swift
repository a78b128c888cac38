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

/// What the app shows: the benchmark, a photo, or the camera.
private struct Shown: Equatable {
    let isMeasuring: Bool
    let photo: PhotosPickerItem?
}

struct ContentView: View {
    @ObservedObject var show: Show
    @State private var isMeasuring = false
    @State private var photo: PhotosPickerItem?

    var body: some View {
        VStack {
            GeometryReader { place in
                if let preview = show.preview {
                    Image(decorative: preview, scale: 1)
                        .resizable()
                        .aspectRatio(contentMode: .fit)
                        .onTapGesture { at in show.focus(atX: at.x / place.size.width, y: at.y / place.size.height) }
                }
            }
            HStack {
                Text("near")
                Slider(value: $show.zMm, in: -3...3)
                    .rotationEffect(.degrees(180))
                Text("far")
            }
            HStack {
                Text(show.statistics)
                    .font(.caption.monospacedDigit())
                // The picker runs outside the app, so it needs no permission.
                PhotosPicker("Portrait", selection: $photo, matching: .depthEffectPhotos)
                if photo != nil { Button("Camera") { photo = nil } }
                Button("Benchmark") { isMeasuring = true }
            }
        }
        .padding()
        // The session is closed while the benchmark is shown, so that nothing else computes.
        .task(id: Shown(isMeasuring: isMeasuring, photo: photo)) {
            if isMeasuring { return }
            if let photo {
                if let data = try? await photo.loadTransferable(type: Data.self) { await show.show(photo: data) }
            } else {
                await show.run()
            }
        }
        .sheet(isPresented: $isMeasuring) { BenchmarkView() }
        .alert("Phasefront", isPresented: $show.hasError) {
            Button("OK") {}
        } message: {
            Text(show.message)
        }
    }
}
