import CoreVideo
import Phasefront

/// Buffers of one size, which are used again once nothing shows them.
final class PixelBuffers: @unchecked Sendable {
    private let pool: CVPixelBufferPool?

    init(width: Int, height: Int) {
        let attributes: [CFString: Any] = [
            kCVPixelBufferPixelFormatTypeKey: kCVPixelFormatType_32BGRA,
            kCVPixelBufferWidthKey: width, kCVPixelBufferHeightKey: height,
        ]
        var pool: CVPixelBufferPool?
        CVPixelBufferPoolCreate(nil, nil, attributes as CFDictionary, &pool)
        self.pool = pool
    }

    /// Releases the buffers that nothing shows.
    func flush() {
        if let pool { CVPixelBufferPoolFlush(pool, .excessBuffers) }
    }

    func next() throws -> CVPixelBuffer {
        var buffer: CVPixelBuffer?
        if let pool { CVPixelBufferPoolCreatePixelBuffer(nil, pool, &buffer) }
        guard let buffer else { throw PhasefrontError.setting(message: "there is no memory for a pixel buffer") }
        return buffer
    }
}
