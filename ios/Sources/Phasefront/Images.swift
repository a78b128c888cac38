#if canImport(CoreVideo) && canImport(CoreGraphics)
    import CoreGraphics
    import CoreVideo
    import PhasefrontCore

    extension Hologram {
        /// Writes the displayed image in sRGB for an eye focused at `zMm` into `buffer`, 32BGRA or 32RGBA of any size, in
        /// place.
        ///
        /// - Throws: ``PhasefrontError/setting(message:)`` for any other pixel format, or if z is too far away.
        public func writePreview(zMm: Double, to buffer: CVPixelBuffer) throws {
            try withPixels(of: buffer) { layout, memory, rowStride in
                try writePreview(
                    zMm: zMm, width: CVPixelBufferGetWidth(buffer), height: CVPixelBufferGetHeight(buffer),
                    layout: layout, to: memory, rowStride: rowStride)
            }
        }

        /// Writes the image for the modulator's driver into `buffer`, 32BGRA or 32RGBA of the modulator's size, in place
        /// and with unchanged levels. `shiftX` and `shiftY` move the hologram, before the flips.
        ///
        /// - Throws: ``PhasefrontError/setting(message:)`` for any other pixel format or size.
        public func writeOutput(
            to buffer: CVPixelBuffer, flipX: Bool = false, flipY: Bool = false, shiftX: Int = 0, shiftY: Int = 0
        ) throws {
            try withPixels(of: buffer) { layout, memory, rowStride in
                try check(buffer, has: outputSize(layout))
                let placement = Placement(
                    layout: layout, flipX: flipX, flipY: flipY, shiftX: Int32(clamping: shiftX),
                    shiftY: Int32(clamping: shiftY))
                try writeOutput(placement, to: memory, rowStride: rowStride)
            }
        }
    }

    extension Modulator {
        /// Writes image `index` of the images that the modulator takes of `hologram` into `buffer`, 32BGRA or 32RGBA of
        /// the size ``outputSize``, in place, for a screen that drives the modulator.
        ///
        /// - Throws: ``PhasefrontError/setting(message:)`` for any other pixel format or size, if the hologram does not fit
        ///   the modulator, and for a modulator whose images have 16 bits.
        public func writePixels(_ hologram: Hologram, image index: Int = 0, to buffer: CVPixelBuffer) throws {
            try withPixels(of: buffer) { layout, memory, rowStride in
                try check(buffer, has: outputSize)
                try writePixels(hologram, image: index, layout: layout, to: memory, rowStride: rowStride)
            }
        }
    }

    private func check(_ buffer: CVPixelBuffer, has size: OutputSize) throws {
        let (width, height) = (CVPixelBufferGetWidth(buffer), CVPixelBufferGetHeight(buffer))
        guard (width, height) == (size.width, size.height) else {
            throw PhasefrontError.setting(
                message: "a buffer of \(width)×\(height); the modulator's \(size.width)×\(size.height) are needed")
        }
    }

    /// Returns the pixels of `buffer`, 32BGRA, for Core Graphics and UIKit without a copy. The image retains the buffer
    /// and keeps it locked for reading, so write the next picture into another buffer; a `CVPixelBufferPool` hands them
    /// out. `colourSpace` is sRGB for previews, or nil for device values that must reach a modulator unchanged.
    ///
    /// - Throws: ``PhasefrontError/setting(message:)`` for any other pixel format.
    public func cgImage(
        of buffer: CVPixelBuffer, colourSpace: CGColorSpace? = CGColorSpace(name: CGColorSpace.sRGB)
    ) throws -> CGImage {
        let (width, height) = (CVPixelBufferGetWidth(buffer), CVPixelBufferGetHeight(buffer))
        let rowStride = CVPixelBufferGetBytesPerRow(buffer)
        guard CVPixelBufferGetPixelFormatType(buffer) == kCVPixelFormatType_32BGRA,
            CVPixelBufferLockBaseAddress(buffer, .readOnly) == kCVReturnSuccess,
            let address = CVPixelBufferGetBaseAddress(buffer)
        else { throw PhasefrontError.setting(message: "a pixel buffer of 32BGRA in memory is needed for Core Graphics") }
        let provider = CGDataProvider(
            dataInfo: Unmanaged.passRetained(buffer).toOpaque(), data: address, size: rowStride * height,
            releaseData: { owner, _, _ in
                guard let owner else { return }
                let buffer = Unmanaged<CVPixelBuffer>.fromOpaque(owner).takeRetainedValue()
                CVPixelBufferUnlockBaseAddress(buffer, .readOnly)
            })
        let image = provider.flatMap {
            CGImage(
                width: width, height: height, bitsPerComponent: 8, bitsPerPixel: 32, bytesPerRow: rowStride,
                space: colourSpace ?? CGColorSpaceCreateDeviceRGB(),
                bitmapInfo: [.byteOrder32Little, CGBitmapInfo(rawValue: CGImageAlphaInfo.noneSkipFirst.rawValue)],
                provider: $0, decode: nil, shouldInterpolate: colourSpace != nil, intent: .defaultIntent)
        }
        guard let image else {
            throw PhasefrontError.setting(message: "Core Graphics makes no image of \(width)×\(height) pixels")
        }
        return image
    }

    /// Calls `body` with the layout, the memory and the row stride of `buffer`, which is locked meanwhile.
    private func withPixels(
        of buffer: CVPixelBuffer, _ body: (ModulatorLayout, UnsafeMutableRawBufferPointer, Int) throws -> Void
    ) throws {
        let layout: ModulatorLayout
        switch CVPixelBufferGetPixelFormatType(buffer) {
        case kCVPixelFormatType_32BGRA: layout = .bgra
        case kCVPixelFormatType_32RGBA: layout = .rgba
        default: throw PhasefrontError.setting(message: "a pixel buffer of 32BGRA or 32RGBA is needed")
        }
        let status = CVPixelBufferLockBaseAddress(buffer, [])
        guard status == kCVReturnSuccess else {
            throw PhasefrontError.setting(message: "the pixel buffer cannot be locked (CVReturn \(status))")
        }
        defer { CVPixelBufferUnlockBaseAddress(buffer, []) }
        let rowStride = CVPixelBufferGetBytesPerRow(buffer)
        let memory = UnsafeMutableRawBufferPointer(
            start: CVPixelBufferGetBaseAddress(buffer), count: rowStride * CVPixelBufferGetHeight(buffer))
        try body(layout, memory, rowStride)
    }
#endif
