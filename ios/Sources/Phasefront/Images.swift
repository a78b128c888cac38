#if canImport(CoreGraphics)
    import CoreGraphics
    import PhasefrontCore

    extension PixelImage {
        /// Returns the image for Core Graphics and UIKit without a copy; the result retains this image. `colourSpace`
        /// is sRGB for previews, or nil for device values that must reach a modulator unchanged.
        ///
        /// - Throws: ``PhasefrontError/setting(message:)`` if the image does not have 4 bytes per pixel.
        public func cgImage(colourSpace: CGColorSpace? = CGColorSpace(name: CGColorSpace.sRGB)) throws -> CGImage {
            guard pixelBytes == 4 else {
                throw PhasefrontError.setting(
                    message: "an image of \(pixelBytes) bytes a pixel; the layout RGBA is needed for Core Graphics")
            }
            let provider = withBytes { bytes in
                CGDataProvider(
                    dataInfo: Unmanaged.passRetained(self).toOpaque(), data: bytes.baseAddress!, size: bytes.count,
                    releaseData: { owner, _, _ in
                        if let owner { Unmanaged<PixelImage>.fromOpaque(owner).release() }
                    })
            }
            let image = provider.flatMap {
                CGImage(
                    width: width, height: height, bitsPerComponent: 8, bitsPerPixel: 32, bytesPerRow: 4 * width,
                    space: colourSpace ?? CGColorSpaceCreateDeviceRGB(),
                    bitmapInfo: CGBitmapInfo(rawValue: CGImageAlphaInfo.noneSkipLast.rawValue), provider: $0,
                    decode: nil, shouldInterpolate: colourSpace != nil, intent: .defaultIntent)
            }
            guard let image else {
                throw PhasefrontError.setting(message: "Core Graphics makes no image of \(width)×\(height) pixels")
            }
            return image
        }
    }
#endif
