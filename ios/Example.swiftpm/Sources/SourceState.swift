/// What a source of frames is doing. Android's sample has the same states.
enum SourceState: Equatable, Sendable {
    case stopped
    /// The system asks the user whether the app may do this.
    case waitingForPermission(to: String)
    case starting
    /// Frames come from this source.
    case running(String)
    /// No frames come now. They will by themselves once the reason is gone.
    case interrupted(String)
    /// No frames come before somebody tries again.
    case failed(String)

    /// The state in words for the screen.
    var text: String {
        switch self {
        case .stopped: "Stopped"
        case .waitingForPermission(let what): "Waiting for your permission to \(what)"
        case .starting: "Starting…"
        case .running(let source): source
        case .interrupted(let why): "Interrupted: \(why)"
        case .failed(let why): "Failed: \(why)"
        }
    }

    /// Returns the state behind `event`. What a source says after it was stopped or has failed changes nothing.
    func after(_ event: SourceEvent) -> SourceState {
        let isActive =
            switch self {
            case .starting, .running, .interrupted: true
            case .stopped, .waitingForPermission, .failed: false
            }
        return switch event {
        case .asked(let what): .waitingForPermission(to: what)
        case .started: .starting
        case .stopped: .stopped
        case .frame(let source): isActive ? .running(source) : self
        case .interrupted(let why): isActive ? .interrupted(why) : self
        case .failed(let why): isActive ? .failed(why) : self
        }
    }
}

/// What happens to a source of frames.
enum SourceEvent: Equatable, Sendable {
    /// The user is asked whether the app may do this.
    case asked(to: String)
    case started
    /// A frame came from this source.
    case frame(String)
    case interrupted(String)
    case failed(String)
    case stopped
}
