@_exported import SwiftUI

public struct PhotosPickerItem: Hashable, Sendable {
    public func loadTransferable<T>(type: T.Type) async throws -> T? { nil }
}
public struct PHPickerFilter: Sendable { public static let depthEffectPhotos = PHPickerFilter() }
public struct PhotosPicker: View {
    public init(_ title: String, selection: Binding<PhotosPickerItem?>, matching: PHPickerFilter?) {}
    public var body: Never { fatalError() }
}
