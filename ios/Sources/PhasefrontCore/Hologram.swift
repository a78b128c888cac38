import Foundation

/// A colour of a hologram.
public enum Colour: Int, CaseIterable, Sendable {
    /// The red laser.
    case red
    /// The green laser.
    case green
    /// The blue laser.
    case blue

    /// The colour of a display with a single laser.
    public static let laser = Colour.red
}

/// The hologram of one frame: modulator levels of three colours or of a single laser, with metadata. The session reuses
/// its memory when the last reference to it is gone.
public final class Hologram: Sendable {
    /// The metadata of the hologram.
    public let info: HologramInfo
    let raw: RawHologram

    init(_ raw: RawHologram) {
        self.raw = raw
        info = raw.info()
    }

    /// Reads the levels of `colour` in place: `info.width` × `info.height` bytes, row by row without gaps. The pointer
    /// is valid only in `body`.
    public func withPlane<R>(_ colour: Colour, _ body: (UnsafeRawBufferPointer) throws -> R) throws -> R {
        let (address, count) = (try raw.planeAddress(colour: colour.rawValue), raw.planeLen())
        return try withExtendedLifetime(self) {
            try body(UnsafeRawBufferPointer(start: UnsafeRawPointer(bitPattern: UInt(address)), count: Int(count)))
        }
    }

    /// Returns the z in mm of the scene point at (`x`, `y`) of the image, each 0 to 1 from the upper left corner. Use
    /// it to focus on a tapped point.
    public func z(atX x: Double, y: Double) -> Double {
        raw.zAt(x: x, y: y)
    }

    /// Returns the displayed image for an eye focused at `zMm`: red, green, blue, alpha. It takes some milliseconds, so
    /// do not call it on the main thread.
    public func preview(zMm: Double, width: Int, height: Int) throws -> PixelImage {
        try PixelImage(raw.preview(zMm: zMm, width: width, height: height))
    }

    /// Returns the displayed image of the whole hologram for an eye focused at `zMm`, as amplitudes; 1 is white. It
    /// transforms the whole hologram, so do not call it on the main thread.
    ///
    /// - Throws: ``PhasefrontError/setting(message:)`` if z is too far away.
    public func refocus(zMm: Double) throws -> Planes {
        try Planes(raw.refocus(zMm: zMm))
    }

    /// Returns the complex field of the levels behind the aperture at `zMm` (0 is the midpoint), without the carrier:
    /// the real and imaginary part of each pixel. It transforms the whole hologram, so do not call it on the main
    /// thread.
    ///
    /// - Throws: ``PhasefrontError/setting(message:)`` if z is too far away.
    public func field(zMm: Double = 0) throws -> Planes {
        try Planes(raw.field(zMm: zMm))
    }

    /// Returns image `index` of the images for the modulator's driver, at the modulator's resolution, with unchanged
    /// levels. All layouts except grey have one image.
    public func output(_ placement: Placement = Placement(layout: .rgba), image index: Int = 0) throws -> PixelImage {
        try PixelImage(raw.output(placement: placement, image: index))
    }
}

/// The amplitudes or the complex field of a hologram, for each pixel and colour.
public final class Planes: Sendable {
    /// The width in pixels.
    public let width: Int
    /// The height in pixels.
    public let height: Int
    /// The number of planes: 3, or 1 for a display with a single laser.
    public let colours: Int
    /// The numbers per pixel: 1 for an amplitude, 2 for a real and an imaginary part.
    public let numbers: Int
    let raw: RawPlanes

    init(_ raw: RawPlanes) {
        self.raw = raw
        (width, height, colours) = (raw.width(), raw.height(), raw.colours())
        numbers = raw.pixelBytes() / MemoryLayout<Float>.size
    }

    /// Reads the plane of `colour` in place: `height` rows of `width` pixels without gaps. The pointer is valid only in
    /// `body`.
    ///
    /// - Throws: ``PhasefrontError/setting(message:)`` if there is no plane of this colour.
    public func withPlane<R>(_ colour: Colour, _ body: (UnsafeBufferPointer<Float>) throws -> R) throws -> R {
        let address = try raw.planeAddress(colour: colour.rawValue)
        return try withExtendedLifetime(self) {
            let first = UnsafePointer<Float>(bitPattern: UInt(address))
            return try body(UnsafeBufferPointer(start: first, count: numbers * width * height))
        }
    }
}

/// An image whose rows have no gaps.
public final class PixelImage: Sendable {
    /// The width in pixels.
    public let width: Int
    /// The height in pixels.
    public let height: Int
    /// The number of bytes per pixel.
    public let pixelBytes: Int
    let raw: RawImage

    init(_ raw: RawImage) {
        self.raw = raw
        (width, height, pixelBytes) = (raw.width(), raw.height(), raw.pixelBytes())
    }

    /// Reads the image in place. The pointer is valid only in `body`.
    public func withBytes<R>(_ body: (UnsafeRawBufferPointer) throws -> R) rethrows -> R {
        let (address, count) = (raw.address(), raw.byteLen())
        return try withExtendedLifetime(self) {
            try body(UnsafeRawBufferPointer(start: UnsafeRawPointer(bitPattern: UInt(address)), count: Int(count)))
        }
    }
}
