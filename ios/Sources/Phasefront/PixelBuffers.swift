#if canImport(CoreVideo)
    @_exported import PhasefrontCore

    import CoreMedia
    import CoreVideo

    /// Calls `body` with the image in `buffer`, which stays locked during the call: 32BGRA, 32RGBA, 420f or 420v, the
    /// formats of cameras and ARKit. The meaning of its colours is read from its attachments, and is sRGB without them.
    /// Nothing is copied.
    ///
    /// - Throws: ``PhasefrontError/frame(message:)`` for any other pixel format. The message names it.
    public func withColourImage<R>(_ buffer: CVPixelBuffer, _ body: (ColourImage) throws -> R) throws -> R {
        let format: ColourFormat
        var isVideoRange = false
        switch CVPixelBufferGetPixelFormatType(buffer) {
        case kCVPixelFormatType_32BGRA: format = .bgra
        case kCVPixelFormatType_32RGBA: format = .rgba
        case kCVPixelFormatType_420YpCbCr8BiPlanarFullRange: format = .nv12
        case kCVPixelFormatType_420YpCbCr8BiPlanarVideoRange:
            format = .nv12
            isVideoRange = true
        case let other:
            throw PhasefrontError.frame(
                message: "frame: colour is \(fourCharacters(other)); BGRA, RGBA, 420f or 420v are needed")
        }
        let (matrix, encoding) = (matrix(of: buffer), encoding(of: buffer))
        return try withLocked(buffer) {
            let planes =
                switch format {
                case .nv12: [try plane(0, of: buffer, pixelStride: 1), try plane(1, of: buffer, pixelStride: 2)]
                default: [try plane(0, of: buffer, pixelStride: 4)]
                }
            return try body(
                ColourImage(
                    format: format, width: CVPixelBufferGetWidth(buffer), height: CVPixelBufferGetHeight(buffer),
                    planes: planes,
                    matrix: matrix, videoRange: isVideoRange, encoding: encoding))
        }
    }

    /// Calls `body` with the depth in `buffer`, which stays locked during the call: 16- or 32-bit floats of depth or
    /// disparity. The format is read from the buffer. Nothing is copied.
    ///
    /// - Parameter confidence: ARKit's confidence map of the same size.
    /// - Throws: ``PhasefrontError/frame(message:)`` for any other pixel format. The message names it.
    public func withDepthImage<R>(
        _ buffer: CVPixelBuffer, confidence: CVPixelBuffer? = nil, _ body: (DepthImage) throws -> R
    ) throws -> R {
        let format: DepthFormat
        switch CVPixelBufferGetPixelFormatType(buffer) {
        case kCVPixelFormatType_DepthFloat32: format = .metresF32
        case kCVPixelFormatType_DepthFloat16: format = .metresF16
        case kCVPixelFormatType_DisparityFloat32: format = .disparityF32
        case kCVPixelFormatType_DisparityFloat16: format = .disparityF16
        case let other:
            throw PhasefrontError.frame(
                message: "frame: depth is \(fourCharacters(other)); 16- or 32-bit floats of depth or disparity are needed")
        }
        return try withLocked(buffer) {
            var depth = DepthImage(
                format: format, width: CVPixelBufferGetWidth(buffer), height: CVPixelBufferGetHeight(buffer),
                plane: try plane(0, of: buffer, pixelStride: format.pixelBytes))
            guard let confidence else { return try body(depth) }
            return try withLocked(confidence) {
                depth.confidence = ConfidenceMap(
                    format: .lowMediumHigh, width: CVPixelBufferGetWidth(confidence),
                    height: CVPixelBufferGetHeight(confidence), plane: try plane(0, of: confidence, pixelStride: 1))
                return try body(depth)
            }
        }
    }

    extension CMTime {
        /// The time in nanoseconds, for ``CameraFrame/timestampNs``.
        public var phasefrontTimestampNs: Int64 {
            CMTimeConvertScale(self, timescale: 1_000_000_000, method: .roundTowardZero).value
        }
    }

    /// Returns the matrix of a buffer's luma and chroma by its attachments.
    private func matrix(of buffer: CVPixelBuffer) -> YuvMatrix {
        let matrix = CVBufferCopyAttachment(buffer, kCVImageBufferYCbCrMatrixKey, nil) as? String
        if matrix == kCVImageBufferYCbCrMatrix_ITU_R_709_2 as String { return .bt709 }
        if matrix == kCVImageBufferYCbCrMatrix_ITU_R_2020 as String { return .bt2020 }
        return .bt601
    }

    /// Returns the meaning of a buffer's colours by its attachments.
    private func encoding(of buffer: CVPixelBuffer) -> RgbEncoding {
        let attachment = { (key: CFString) in CVBufferCopyAttachment(buffer, key, nil) as? String }
        let primaries = attachment(kCVImageBufferColorPrimariesKey)
        let transfer = attachment(kCVImageBufferTransferFunctionKey)
        if primaries == kCVImageBufferColorPrimaries_P3_D65 as String { return .displayP3 }
        guard primaries == kCVImageBufferColorPrimaries_ITU_R_2020 as String else { return .srgb }
        if transfer == kCVImageBufferTransferFunction_ITU_R_2100_HLG as String { return .bt2020Hlg }
        if transfer == kCVImageBufferTransferFunction_SMPTE_ST_2084_PQ as String { return .bt2020Pq }
        return .bt2020
    }

    private func withLocked<R>(_ buffer: CVPixelBuffer, _ body: () throws -> R) throws -> R {
        let status = CVPixelBufferLockBaseAddress(buffer, .readOnly)
        guard status == kCVReturnSuccess else {
            throw PhasefrontError.frame(message: "frame: its pixel buffer cannot be locked (CVReturn \(status))")
        }
        defer { CVPixelBufferUnlockBaseAddress(buffer, .readOnly) }
        return try body()
    }

    /// Returns plane `index` of a locked buffer.
    private func plane(_ index: Int, of buffer: CVPixelBuffer, pixelStride: Int) throws -> ImagePlane {
        let isPlanar = CVPixelBufferIsPlanar(buffer)
        let address =
            isPlanar ? CVPixelBufferGetBaseAddressOfPlane(buffer, index) : CVPixelBufferGetBaseAddress(buffer)
        guard let address else {
            throw PhasefrontError.frame(message: "frame: plane \(index) of its pixel buffer is not in memory")
        }
        let rowStride =
            isPlanar ? CVPixelBufferGetBytesPerRowOfPlane(buffer, index) : CVPixelBufferGetBytesPerRow(buffer)
        let height = isPlanar ? CVPixelBufferGetHeightOfPlane(buffer, index) : CVPixelBufferGetHeight(buffer)
        return ImagePlane(unsafeAddress: address, count: rowStride * height, rowStride: rowStride, pixelStride: pixelStride)
    }

    private func fourCharacters(_ code: OSType) -> String {
        let bytes = [24, 16, 8, 0].map { UInt8(truncatingIfNeeded: code >> $0) }
        return String(bytes: bytes, encoding: .ascii) ?? String(code)
    }
#endif
