import UIKit

/// The modulator's levels on an external screen, pixel for pixel: the screen is the modulator's driver.
@MainActor
final class ExternalScreen {
    private var window: UIWindow?
    private let layer = CALayer()

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

    /// The window on the external screen, made when the screen comes.
    private func connect() -> UIWindow? {
        let scenes = UIApplication.shared.connectedScenes.compactMap { $0 as? UIWindowScene }
        guard let scene = scenes.first(where: { $0.session.role == .windowExternalDisplayNonInteractive }) else {
            window = nil
            return nil
        }
        if window?.windowScene != scene {
            let window = UIWindow(windowScene: scene)
            let controller = UIViewController()
            controller.view.backgroundColor = .black
            // Neither filtered nor scaled: a level between two levels is another phase.
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
