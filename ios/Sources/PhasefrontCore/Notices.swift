import Foundation

/// The notices of what the library carries of others, Markdown: an app shows them where it shows its own.
///
/// - Throws: where the package's resources are not bundled with the app.
public func thirdPartyNotices() throws -> String {
    guard let file = Bundle.module.url(forResource: "THIRD-PARTY", withExtension: "md") else {
        throw CocoaError(.fileReadNoSuchFile)
    }
    return try String(contentsOf: file, encoding: .utf8)
}
