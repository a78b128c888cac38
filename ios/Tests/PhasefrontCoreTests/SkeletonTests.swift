import Foundation
import XCTest

@testable import PhasefrontCore

final class SkeletonTests: XCTestCase {
    func testVersion() throws {
        XCTAssertEqual(version(), "0.1.0")
        XCTAssertEqual(try sum(bytes: Data([1, 2, 250]), fail: false), 253)
        XCTAssertThrowsError(try sum(bytes: Data(), fail: true)) { print($0) }
    }
}
