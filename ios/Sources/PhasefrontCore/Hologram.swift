import Foundation

/// A colour of a hologram.
public enum Colour: UInt32, CaseIterable, Sendable {
    /// The red laser's.
    case red
    /// The green laser's.
    case green
    /// The blue laser's.
    case blue

    /// The one of a display of one laser.
    public static let laser = Colour.red
}

/// The hologram of one frame: modulator levels of three colours, or of one laser, and what is known of them. Its memory
/// goes back to the session when the last reference to it is gone.
public final class Hologram: Sendable {
    /// What is known of it.
    public let info: HologramInfo
    let raw: RawHologram

    init(_ raw: RawHologram) throws {
        self.raw = raw
        info = try raw.info()
    }

    /// Reads the levels of `colour` in place: `info.width` × `info.height` bytes, row by row without gaps. The pointer
    /// is valid in `body` only.
    public func withPlane<R>(_ colour: Colour, _ body: (UnsafeRawBufferPointer) throws -> R) throws -> R {
        let (address, count) = try (raw.planeAddress(colour: colour.rawValue), raw.planeLen())
        return try withExtendedLifetime(self) {
            try body(UnsafeRawBufferPointer(start: UnsafeRawPointer(bitPattern: UInt(address)), count: Int(count)))
        }
    }

    /// z of what is seen at (`x`, `y`) of the picture, each 0 to 1 from its upper left corner, in mm: where to focus
    /// when it is tapped on.
    public func z(atX x: Double, y: Double) throws -> Double {
        try raw.zAt(x: x, y: y)
    }

    /// What an eye focused at `zMm` sees: red, green, blue, alpha. Takes some milliseconds; not for the main thread.
    public func preview(zMm: Double, width: Int, height: Int) throws -> PixelImage {
        try PixelImage(
            raw.preview(zMm: zMm, width: UInt32(clamping: width), height: UInt32(clamping: height)))
    }

    /// What an eye focused at `zMm` sees of the whole hologram: amplitudes, of which 1 is white. Transforms all
    /// of it; not for the main thread.
    ///
    /// - Throws: ``PhasefrontError/Setting(message:)`` for a z too far away.
    public func refocus(zMm: Double) throws -> Planes {
        try Planes(raw.refocus(zMm: zMm))
    }

    /// The complex field that the levels make behind the aperture at `zMm`, 0 the midpoint, without the carrier: real
    /// and imaginary part of each pixel. Transforms all of the hologram; not for the main thread.
    ///
    /// - Throws: ``PhasefrontError/Setting(message:)`` for a z too far away.
    public func field(zMm: Double = 0) throws -> Planes {
        try Planes(raw.field(zMm: zMm))
    }

    /// Image `index` of those that the modulator's driver takes, of the modulator's resolution, levels as they are; all
    /// layouts but grey have one.
    public func output(_ placement: Placement = Placement(layout: .rgba), image index: Int = 0) throws -> PixelImage {
        try PixelImage(raw.output(placement: placement, image: UInt32(clamping: index)))
    }
}

/// Numbers at each pixel of each colour of a hologram: amplitudes, or a field.
public final class Planes: Sendable {
    /// Pixels along x.
    public let width: Int
    /// Pixels along y.
    public let height: Int
    /// How many planes there are: 3, or 1 of a display of one laser.
    public let colours: Int
    /// Numbers of a pixel: 1, an amplitude, or 2, a real and an imaginary part.
    public let numbers: Int
    let raw: RawPlanes

    init(_ raw: RawPlanes) throws {
        self.raw = raw
        width = try Int(raw.width())
        height = try Int(raw.height())
        colours = try Int(raw.colours())
        numbers = try Int(raw.pixelBytes()) / MemoryLayout<Float>.size
    }

    /// Reads the plane of `colour` in place: `height` rows of `width` pixels without gaps. The pointer is valid in
    /// `body` only.
    ///
    /// - Throws: ``PhasefrontError/Setting(message:)`` for a colour that it has not.
    public func withPlane<R>(_ colour: Colour, _ body: (UnsafeBufferPointer<Float>) throws -> R) throws -> R {
        let address = try raw.planeAddress(colour: colour.rawValue)
        return try withExtendedLifetime(self) {
            let first = UnsafePointer<Float>(bitPattern: UInt(address))
            return try body(UnsafeBufferPointer(start: first, count: numbers * width * height))
        }
    }
}

/// An image, row by row without gaps.
public final class PixelImage: Sendable {
    /// Pixels along x.
    public let width: Int
    /// Pixels along y.
    public let height: Int
    /// Bytes of a pixel.
    public let pixelBytes: Int
    let raw: RawImage

    init(_ raw: RawImage) throws {
        self.raw = raw
        width = try Int(raw.width())
        height = try Int(raw.height())
        pixelBytes = try Int(raw.pixelBytes())
    }

    /// Reads the image in place. The pointer is valid in `body` only.
    public func withBytes<R>(_ body: (UnsafeRawBufferPointer) throws -> R) throws -> R {
        let (address, count) = try (raw.address(), raw.byteLen())
        return try withExtendedLifetime(self) {
            try body(UnsafeRawBufferPointer(start: UnsafeRawPointer(bitPattern: UInt(address)), count: Int(count)))
        }
    }
}
