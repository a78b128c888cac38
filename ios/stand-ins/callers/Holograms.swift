// Calls: class Holograms
import Combine
import Phasefront

@MainActor
final class Model: ObservableObject {
    private var holograms: Holograms?

    func appear(_ network: HologramNetwork) async throws {
        let made = try Holograms(network: network)
        holograms = made
        try await made.run { throw PhasefrontError.setting(message: "no buffer") }
        if made.seen != nil { holograms = nil }
    }
}
