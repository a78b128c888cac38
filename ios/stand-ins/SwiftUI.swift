@_exported import Combine
@_exported import UIKit

// The isolation is that of the SDK of Xcode 16: App, Scene and View belong to the main actor.

@MainActor @preconcurrency public protocol App {
    associatedtype Body: Scene
    @SceneBuilder @MainActor @preconcurrency var body: Body { get }
    @MainActor @preconcurrency init()
}
extension App { public static func main() {} }
@MainActor @preconcurrency public protocol Scene {}
@resultBuilder public enum SceneBuilder { public static func buildBlock<S: Scene>(_ scene: S) -> S { scene } }
public struct WindowGroup<Content: View>: Scene { public init(@ViewBuilder content: () -> Content) {} }
public enum ScenePhase: Sendable { case background, inactive, active }

@MainActor @preconcurrency public protocol View {
    associatedtype Body: View
    @ViewBuilder @MainActor @preconcurrency var body: Body { get }
}
extension Never: View { public var body: Never { fatalError() } }
/// A view that is only declared.
public protocol Leaf: View where Body == Never {}
extension Leaf { public var body: Never { fatalError() } }
public struct EmptyView: Leaf { nonisolated public init() {} }
public struct TupleView<T>: Leaf { nonisolated init(_: T) {} }
extension Optional: View where Wrapped: View { public var body: Never { fatalError() } }
@resultBuilder public enum ViewBuilder {
    public static func buildBlock() -> EmptyView { EmptyView() }
    public static func buildBlock<V: View>(_ view: V) -> V { view }
    public static func buildBlock<each V: View>(_ views: repeat each V) -> TupleView<(repeat each V)> {
        TupleView((repeat each views))
    }
    public static func buildExpression<V: View>(_ view: V) -> V { view }
    public static func buildIf<V: View>(_ view: V?) -> V? { view }
}

@propertyWrapper @dynamicMemberLookup public struct Binding<Value> {
    private let get: () -> Value
    private let set: (Value) -> Void
    public init(get: @escaping () -> Value, set: @escaping (Value) -> Void) { (self.get, self.set) = (get, set) }
    public var wrappedValue: Value {
        get { get() }
        nonmutating set { set(newValue) }
    }
    public var projectedValue: Binding<Value> { self }
    public subscript<Subject>(dynamicMember path: WritableKeyPath<Value, Subject>) -> Binding<Subject> {
        Binding<Subject>(get: { get()[keyPath: path] }, set: { _ in })
    }
}
@propertyWrapper public struct State<Value> {
    public init(wrappedValue: Value) { self.wrappedValue = wrappedValue }
    public var wrappedValue: Value { get { fatalError() } nonmutating set {} }
    public var projectedValue: Binding<Value> { fatalError() }
    private let kept: Value? = nil
}
@propertyWrapper public struct SceneStorage<Value> {
    public init(wrappedValue: Double, _ key: String) where Value == Double {}
    public var wrappedValue: Value { get { fatalError() } nonmutating set {} }
    public var projectedValue: Binding<Value> { fatalError() }
}
@MainActor @preconcurrency @propertyWrapper public struct ObservedObject<Object: ObservableObject> {
    @MainActor @preconcurrency @dynamicMemberLookup public struct Wrapper {
        public subscript<Subject>(dynamicMember path: ReferenceWritableKeyPath<Object, Subject>) -> Binding<Subject> { fatalError() }
    }
    public init(wrappedValue: Object) { self.wrappedValue = wrappedValue }
    public var wrappedValue: Object
    public var projectedValue: Wrapper { fatalError() }
}
@MainActor @preconcurrency @propertyWrapper public struct StateObject<Object: ObservableObject> {
    public init(wrappedValue thunk: @autoclosure @escaping () -> Object) {}
    public var wrappedValue: Object { fatalError() }
    public var projectedValue: ObservedObject<Object>.Wrapper { fatalError() }
}
public struct DismissAction { @MainActor public func callAsFunction() {} }
public struct EnvironmentValues {
    public var dismiss: DismissAction { DismissAction() }
    public var scenePhase: ScenePhase { .active }
}
@propertyWrapper public struct Environment<Value> {
    public init(_ path: KeyPath<EnvironmentValues, Value>) {}
    public var wrappedValue: Value { fatalError() }
}

public struct Text: Leaf, Sendable { public init<S: StringProtocol>(_ text: S) {} }
public struct Color: Leaf, Sendable { public static let clear = Color() }
public struct Spacer: Leaf { public init() {} }
public struct Image: Leaf {
    public init(_ image: CGImage, scale: CGFloat, label: Text) {}
    public init(decorative: CGImage, scale: CGFloat) {}
    public func resizable() -> Image { self }
}
public struct Button<Label: View>: Leaf {
    public init(action: @escaping @MainActor () -> Void, @ViewBuilder label: () -> Label) {}
}
extension Button where Label == Text {
    public init<S: StringProtocol>(_ title: S, action: @escaping @MainActor () -> Void) {}
}
public struct Link<Label: View>: Leaf {}
extension Link where Label == Text { public init<S: StringProtocol>(_ title: S, destination: URL) {} }
public struct ShareLink: Leaf { public init<S: StringProtocol>(_ title: S, item: URL) {} }
public struct Slider<Label: View, ValueLabel: View>: Leaf {
    public init<V: BinaryFloatingPoint>(
        value: Binding<V>, in: ClosedRange<V>, @ViewBuilder label: () -> Label,
        @ViewBuilder minimumValueLabel: () -> ValueLabel, @ViewBuilder maximumValueLabel: () -> ValueLabel
    ) {}
}
public enum HorizontalAlignment: Sendable { case leading, center }
public struct Alignment: Sendable {
    public static let leading = Alignment()
    public static let center = Alignment()
}
public struct VStack<Content: View>: Leaf {
    public init(alignment: HorizontalAlignment = .center, @ViewBuilder content: () -> Content) {}
}
public struct HStack<Content: View>: Leaf { public init(@ViewBuilder content: () -> Content) {} }
public struct ViewThatFits<Content: View>: Leaf { public init(@ViewBuilder content: () -> Content) {} }
public struct ScrollView<Content: View>: Leaf { public init(@ViewBuilder content: () -> Content) {} }
public struct GeometryProxy { public var size: CGSize { .zero } }
public struct GeometryReader<Content: View>: Leaf { public init(@ViewBuilder content: @escaping (GeometryProxy) -> Content) {} }
public struct Rectangle: Leaf, Shape { public init() {} }
public protocol Shape {}
public enum ContentMode: Sendable { case fit, fill }
public struct Font: Sendable {
    public static let caption = Font()
    public static let callout = Font()
    public func monospacedDigit() -> Font { self }
}

extension View {
    public func padding() -> some View { self }
    public func font(_: Font?) -> some View { self }
    public func disabled(_: Bool) -> some View { self }
    public func aspectRatio(contentMode: ContentMode) -> some View { self }
    public func contentShape<S: Shape>(_: S) -> some View { self }
    public func frame(maxWidth: CGFloat? = nil, maxHeight: CGFloat? = nil, alignment: Alignment = .center) -> some View { self }
    public func overlay<V: View>(@ViewBuilder content: () -> V) -> some View { self }
    public func accessibilityValue<S: StringProtocol>(_: S) -> some View { self }
    public func accessibilityHint<S: StringProtocol>(_: S) -> some View { self }
    public func onTapGesture(count: Int = 1, perform: @escaping (CGPoint) -> Void) -> some View { self }
    public func onAppear(perform: (() -> Void)? = nil) -> some View { self }
    public func onDisappear(perform: (() -> Void)? = nil) -> some View { self }
    public func onChange<V: Equatable>(of: V, perform: @escaping (V) -> Void) -> some View { self }
    public func onReceive<P: Publisher>(_: P, perform: @escaping (P.Output) -> Void) -> some View where P.Failure == Never { self }
    public func sheet<V: View>(isPresented: Binding<Bool>, @ViewBuilder content: @escaping () -> V) -> some View { self }
    public func task<T: Equatable>(
        id: T, priority: TaskPriority = .userInitiated, @_inheritActorContext _ action: @escaping @Sendable () async -> Void
    ) -> some View { self }
}
