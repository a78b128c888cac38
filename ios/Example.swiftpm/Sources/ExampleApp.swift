import Phasefront
import SwiftUI

@main
struct ExampleApp: App {
    @StateObject private var show = Show()

    var body: some Scene {
        WindowGroup {
            ContentView(show: show)
                .task { await show.run() }
        }
    }
}

struct ContentView: View {
    @ObservedObject var show: Show

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
            Text(show.statistics)
                .font(.caption.monospacedDigit())
        }
        .padding()
        .alert("Phasefront", isPresented: $show.hasError) {
            Button("OK") {}
        } message: {
            Text(show.message)
        }
    }
}
