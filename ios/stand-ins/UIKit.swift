@_exported import CoreGraphics

public final class UIImage: NSObject {
    public let cgImage: CGImage?
    public init?(contentsOfFile path: String) {
        guard FileManager.default.fileExists(atPath: path) else { return nil }
        cgImage = CGImage(ofFileWith: 640, 480)
    }
}
@MainActor open class UIColor: NSObject, @unchecked Sendable { public static let black = UIColor() }
@MainActor public final class UIDevice: NSObject {
    public enum BatteryState: Int, Sendable { case unknown, unplugged, charging, full }
    public static let current = UIDevice()
    public var isBatteryMonitoringEnabled = false
    public var batteryState = BatteryState.unknown
    public var batteryLevel: Float = -1
    public var systemName = "iOS"
    public var systemVersion = "18.0"
}
@MainActor public final class UIApplication: NSObject {
    public static let shared = UIApplication()
    nonisolated public static let openSettingsURLString = "app-settings:"
    nonisolated public static let didReceiveMemoryWarningNotification = Notification.Name("UIApplicationDidReceiveMemoryWarning")
    public var isIdleTimerDisabled = false
    public var connectedScenes: Set<UIScene> = []
}
@MainActor public final class UISceneSession: NSObject {
    public struct Role: Equatable, Sendable {
        let name: String
        public static let windowApplication = Role(name: "application")
        public static let windowExternalDisplayNonInteractive = Role(name: "external")
    }
    public let role: Role
    init(role: Role) { self.role = role }
}
@MainActor open class UIScene: NSObject {
    public let session: UISceneSession
    init(role: UISceneSession.Role) { session = UISceneSession(role: role) }
}
/// For an external screen the system offers a scene of the role windowExternalDisplayNonInteractive to every app, and mirrors
/// the app into it unless the app adds a window: the reply in https://developer.apple.com/forums/thread/745553
@MainActor public final class UIWindowScene: UIScene {
    public let screen: UIScreen
    public fileprivate(set) var windows: [UIWindow] = []
    /// Plugs in an external screen with these modes.
    public init(externalScreen modes: [CGSize]) {
        screen = UIScreen(modes)
        super.init(role: .windowExternalDisplayNonInteractive)
    }
}
@MainActor public final class UIScreenMode: NSObject {
    public let size: CGSize
    init(_ size: CGSize) { self.size = size }
}
@MainActor public final class UIScreen: NSObject {
    public enum OverscanCompensation: Int, Sendable { case scale, insetBounds, none }
    public var overscanCompensation = OverscanCompensation.scale
    public let availableModes: [UIScreenMode]
    public var currentMode: UIScreenMode?
    public var preferredMode: UIScreenMode? { availableModes.first }
    public var nativeScale: CGFloat { 1 }
    init(_ modes: [CGSize]) {
        availableModes = modes.map { UIScreenMode($0) }
        currentMode = availableModes.first
    }
}
@MainActor open class CALayer {
    public struct ContentsFilter: Sendable {
        public static let nearest = ContentsFilter()
        public static let linear = ContentsFilter()
    }
    public init() {}
    public var contents: Any?
    public var bounds = CGRect.zero
    public var position = CGPoint.zero
    public var magnificationFilter = ContentsFilter.linear
    public var minificationFilter = ContentsFilter.linear
    public private(set) var sublayers: [CALayer]? = []
    public func addSublayer(_ layer: CALayer) { sublayers?.append(layer) }
}
public enum CATransaction {
    public static func begin() {}
    public static func commit() {}
    public static func setDisableActions(_: Bool) {}
}
@MainActor open class UIView: NSObject {
    public let layer = CALayer()
    public var backgroundColor: UIColor?
}
@MainActor open class UIViewController: NSObject {
    public var view: UIView! = UIView()
}
@MainActor public final class UIWindow: UIView {
    public weak var windowScene: UIWindowScene?
    public var rootViewController: UIViewController?
    public var isHidden = true
    public init(windowScene: UIWindowScene) {
        self.windowScene = windowScene
        super.init()
        windowScene.windows.append(self)
    }
    public var screen: UIScreen { windowScene?.screen ?? UIScreen([]) }
    public var bounds: CGRect { CGRect(origin: .zero, size: screen.currentMode?.size ?? .zero) }
}
