// Calls: func hologram(rgba: Data, metres: Data) async
import Foundation
import Phasefront

@MainActor
final class Model {
    private var latest: Hologram?
    private var highest: UInt8 = 0

    func choose(_ photo: Data, _ depth: Data) async throws {
        let made = try await hologram(rgba: photo, metres: depth)
        (latest, highest) = (made, try brightest(made))
    }
}
