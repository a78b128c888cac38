import Foundation

@testable import PhasefrontCore

let network = Result { try HologramNetwork.builtIn() }
let smallDisplay = HologramDisplay(width: 64, height: 48)

func options() throws -> SessionOptions { try SessionOptions(display: smallDisplay, network: network.get()) }

/// Returns an RGBA image of 64×48 pixels that is not uniform.
func colourBytes() -> Data {
    var bytes = Data()
    for y in 0..<48 {
        for x in 0..<64 { bytes.append(contentsOf: [UInt8(x * 4), UInt8(y * 5), UInt8(255 - x * 3), 0]) }
    }
    return bytes
}

/// Returns 32×24 depths in metres: an object in front of a wall.
func depthBytes(metres: Float = 0.5) -> Data {
    var bytes = Data()
    for y in 0..<24 {
        for x in 0..<32 {
            let isNear = (6...17).contains(y) && (8...23).contains(x)
            withUnsafeBytes(of: isNear ? metres / 2 : metres) { bytes.append(contentsOf: $0) }
        }
    }
    return bytes
}

func still(timestampNs: Int64 = 0, colour: Data = colourBytes(), depth: Data = depthBytes()) -> CameraFrame {
    CameraFrame(
        timestampNs: timestampNs,
        colour: ColourImage(format: .rgba, width: 64, height: 48, bytes: colour),
        depth: DepthImage(format: .metresF32, width: 32, height: 24, bytes: depth))
}

extension Hologram {
    /// The levels of all colours.
    func levels() throws -> Data {
        try Colour.allCases.prefix(info.colours).reduce(into: Data()) { all, colour in
            try withPlane(colour) { all.append(contentsOf: $0) }
        }
    }
}

extension Planes {
    /// The numbers of all planes, in memory order.
    func bytes() throws -> Data {
        try Colour.allCases.prefix(colours).reduce(into: Data()) { all, colour in
            try withPlane(colour) { all.append(Data(buffer: $0)) }
        }
    }
}
