import AVFoundation
import ImageIO
import Phasefront

extension HologramSession {
    /// Returns the hologram of a photo whose file has depth, as portraits do.
    func process(photo: Data) throws -> Hologram {
        guard let source = CGImageSourceCreateWithData(photo as CFData, nil),
            let image = CGImageSourceCreateImageAtIndex(source, 0, nil),
            let depth = depthData(source)
        else { throw PhasefrontError.frame(message: "frame: the photo has no depth; choose a portrait") }
        let colour = rgba(image)
        let properties = CGImageSourceCopyPropertiesAtIndex(source, 0, nil) as? [CFString: Any]
        let orientation = orientation(properties?[kCGImagePropertyOrientation] as? UInt32 ?? 1)
        return try withDepthImage(depth.depthDataMap) { depth in
            try process(CameraFrame(timestampNs: 0, colour: colour, depth: depth, orientation: orientation))
        }
    }
}

/// Returns the depth or disparity in a photo.
private func depthData(_ source: CGImageSource) -> AVDepthData? {
    for type in [kCGImageAuxiliaryDataTypeDisparity, kCGImageAuxiliaryDataTypeDepth] {
        if let information = CGImageSourceCopyAuxiliaryDataInfoAtIndex(source, 0, type) as? [AnyHashable: Any],
            let depth = try? AVDepthData(fromDictionaryRepresentation: information)
        {
            return depth
        }
    }
    return nil
}

private func rgba(_ image: CGImage) -> ColourImage {
    var bytes = Data(count: 4 * image.width * image.height)
    bytes.withUnsafeMutableBytes { memory in
        let context = CGContext(
            data: memory.baseAddress, width: image.width, height: image.height, bitsPerComponent: 8,
            bytesPerRow: 4 * image.width, space: CGColorSpaceCreateDeviceRGB(),
            bitmapInfo: CGImageAlphaInfo.noneSkipLast.rawValue)
        context?.draw(image, in: CGRect(x: 0, y: 0, width: image.width, height: image.height))
    }
    return ColourImage(format: .rgba, width: image.width, height: image.height, bytes: bytes)
}

/// Returns the rotation that brings a photo with this EXIF orientation upright. Cameras write no mirrored ones.
private func orientation(_ exif: UInt32) -> Orientation {
    switch exif {
    case 3: Orientation(rotation: .half, mirrored: false)
    case 6: Orientation(rotation: .clockwise90, mirrored: false)
    case 8: Orientation(rotation: .clockwise270, mirrored: false)
    default: .upright
    }
}
