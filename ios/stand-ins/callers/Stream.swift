// Calls: final class Stream
import Phasefront

@MainActor
final class Model {
    private var latest: Hologram?
    private var stream: Stream?

    func appear() async throws {
        let made = try Stream()
        stream = made
        await made.show { [weak self] hologram in self?.latest = hologram }
    }
}
