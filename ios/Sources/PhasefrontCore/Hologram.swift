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

    /// Writes the displayed image in sRGB for an eye focused at `zMm` into `memory`: `width` × `height` pixels in
    /// `layout`, RGB, RGBA or BGRA, whose rows are `rowStride` bytes apart, by default without gaps. Allocates no image.
    /// It takes some milliseconds, so do not call it on the main thread.
    ///
    /// - Throws: ``PhasefrontError/setting(message:)`` if the image is empty or does not fit, or if z is too far away.
    public func writePreview(
        zMm: Double, width: Int, height: Int, layout: ModulatorLayout = .rgba,
        to memory: UnsafeMutableRawBufferPointer, rowStride: Int? = nil
    ) throws {
        let rowStride = rowStride ?? width * (layout == .rgb ? 3 : 4)
        try raw.writePreview(
            zMm: zMm, width: width, height: height, layout: layout, to: RawMemory(memory, rowStride: rowStride))
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

    /// Returns the size of the images of `layout` for the modulator. All layouts except grey have one image.
    public func outputSize(_ layout: ModulatorLayout) -> OutputSize { raw.outputSize(layout: layout) }

    /// Writes image `index` of the images for the modulator's driver, with unchanged levels, into `memory`:
    /// ``outputSize(_:)`` has its size. Its rows are `rowStride` bytes apart, by default without gaps. Allocates no image.
    ///
    /// - Throws: ``PhasefrontError/setting(message:)`` if the layout has no such image or the image does not fit.
    public func writeOutput(
        _ placement: Placement, image index: Int = 0, to memory: UnsafeMutableRawBufferPointer, rowStride: Int? = nil
    ) throws {
        let rowStride = rowStride ?? outputSize(placement.layout).rowBytes
        try raw.writeOutput(placement: placement, image: index, to: RawMemory(memory, rowStride: rowStride))
    }
}

/// A modulator: its display, the phases of its levels, and the images that its input takes. ``modulatorNames()`` lists
/// those that the library knows.
public final class Modulator: Sendable {
    /// The target of holograms for the modulator.
    public let target: HologramTarget
    /// The size of the images that its input takes.
    public let outputSize: OutputSize
    private let raw: RawModulator

    private init(_ raw: RawModulator) {
        self.raw = raw
        (target, outputSize) = (raw.target(), raw.outputSize())
    }

    /// Creates the modulator called `name`, for example "holoeye-pluto".
    ///
    /// - Throws: ``PhasefrontError/display(message:)`` for a name that ``modulatorNames()`` does not have.
    public convenience init(named name: String) throws { try self.init(.named(name: name)) }

    /// Reads the text of a modulator's file, with keys such as packing and levels_turns.
    ///
    /// - Throws: ``PhasefrontError/display(message:)`` if it is not such a text.
    public convenience init(toml text: String) throws { try self.init(.fromToml(text: text)) }

    /// Writes image `index` of the images that its input takes of `hologram` into `memory`, whose rows are `rowStride`
    /// bytes apart, by default without gaps.
    ///
    /// - Throws: ``PhasefrontError/setting(message:)`` if the hologram does not fit the modulator or the image does not
    ///   fit.
    public func writeOutput(
        _ hologram: Hologram, image index: Int = 0, to memory: UnsafeMutableRawBufferPointer, rowStride: Int? = nil
    ) throws {
        let memory = RawMemory(memory, rowStride: rowStride ?? outputSize.rowBytes)
        try raw.writeOutput(hologram: hologram.raw, image: index, to: memory)
    }

    /// Writes the same image in the pixels of a screen that drives the modulator, in `layout` RGBA or BGRA, into
    /// `memory`. The red, green and blue of a grey image are its level. Rows are `rowStride` bytes apart, by default
    /// without gaps.
    ///
    /// - Throws: ``PhasefrontError/setting(message:)`` in the cases of ``writeOutput(_:image:to:rowStride:)``, for another
    ///   layout, and for a modulator whose images have 16 bits.
    public func writePixels(
        _ hologram: Hologram, image index: Int = 0, layout: ModulatorLayout = .rgba,
        to memory: UnsafeMutableRawBufferPointer, rowStride: Int? = nil
    ) throws {
        let memory = RawMemory(memory, rowStride: rowStride ?? 4 * outputSize.width)
        try raw.writePixels(hologram: hologram.raw, image: index, layout: layout, to: memory)
    }
}

extension OutputSize {
    /// The number of bytes of a row without gaps.
    public var rowBytes: Int { width * pixelBytes }
}

extension RawMemory {
    init(_ memory: UnsafeMutableRawBufferPointer, rowStride: Int) {
        self.init(
            address: UInt64(UInt(bitPattern: memory.baseAddress)), length: UInt64(memory.count), rowStride: rowStride)
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
