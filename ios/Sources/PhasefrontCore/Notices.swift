import Foundation

/// Returns the third-party notices of the library as Markdown. An app must show them with its own notices.
///
/// - Throws: An error if the package's resources are not bundled with the app.
public func thirdPartyNotices() throws -> String {
    guard let file = Bundle.module.url(forResource: "THIRD-PARTY", withExtension: "md") else {
        throw CocoaError(.fileReadNoSuchFile)
    }
    return try String(contentsOf: file, encoding: .utf8)
}
