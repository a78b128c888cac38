import UIKit

/// Shows the modulator's levels on an external screen, pixel for pixel. The screen drives the modulator.
@MainActor
final class ExternalScreen {
    private var window: UIWindow?
    private let layer = CALayer()
    /// The modulator's size in pixels, which the screen shows if it can.
    private let size: CGSize

    init(size: CGSize) { self.size = size }

    var isConnected: Bool { connect() != nil }

    func show(_ levels: CGImage) {
        guard let window = connect() else { return }
        let pixel = window.screen.nativeScale
        let size = CGSize(width: CGFloat(levels.width) / pixel, height: CGFloat(levels.height) / pixel)
        CATransaction.begin()
        CATransaction.setDisableActions(true)
        layer.contents = levels
        layer.bounds = CGRect(origin: .zero, size: size)
        layer.position = CGPoint(x: window.bounds.midX, y: window.bounds.midY)
        CATransaction.commit()
    }

    /// Returns the window on the external screen, created when the screen is connected.
    private func connect() -> UIWindow? {
        let scenes = UIApplication.shared.connectedScenes.compactMap { $0 as? UIWindowScene }
        guard let scene = scenes.first(where: { $0.session.role == .windowExternalDisplayNonInteractive }) else {
            window = nil
            return nil
        }
        if window?.windowScene != scene {
            // A television's mode that is scaled or cut at its edges would change the levels.
            let screen = scene.screen
            screen.overscanCompensation = .none
            screen.currentMode = screen.availableModes.first { $0.size == size } ?? screen.preferredMode
            let window = UIWindow(windowScene: scene)
            let controller = UIViewController()
            controller.view.backgroundColor = .black
            // Levels must not be filtered or scaled: a value between two levels is a different phase.
            layer.magnificationFilter = .nearest
            layer.minificationFilter = .nearest
            controller.view.layer.addSublayer(layer)
            window.rootViewController = controller
            window.isHidden = false
            self.window = window
        }
        return window
    }
}
