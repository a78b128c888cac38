import Phasefront
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

struct ContentView: View {
    @ObservedObject var show: Show
    @State private var isMeasuring = false

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
                Button("Benchmark") { isMeasuring = true }
            }
        }
        .padding()
        // The session is closed while the benchmark is shown, so that nothing else computes.
        .task(id: isMeasuring) {
            if !isMeasuring { await show.run() }
        }
        .sheet(isPresented: $isMeasuring) { BenchmarkView() }
        .alert("Phasefront", isPresented: $show.hasError) {
            Button("OK") {}
        } message: {
            Text(show.message)
        }
    }
}
