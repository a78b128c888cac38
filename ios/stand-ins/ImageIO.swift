@_exported import CoreGraphics

public final class CGImageSource {}
public let kCGImageAuxiliaryDataTypeDisparity: CFString = "disparity"
public let kCGImageAuxiliaryDataTypeDepth: CFString = "depth"
public let kCGImagePropertyOrientation: CFString = "orientation"
public func CGImageSourceCreateWithData(_: CFData, _: CFDictionary?) -> CGImageSource? { CGImageSource() }
public func CGImageSourceCreateImageAtIndex(_: CGImageSource, _: Int, _: CFDictionary?) -> CGImage? { CGImage(ofFileWith: 64, 48) }
public func CGImageSourceCopyPropertiesAtIndex(_: CGImageSource, _: Int, _: CFDictionary?) -> CFDictionary? { [:] }
// A CFDictionary is a class on Apple's systems, so casts to dictionaries do something.
public func CGImageSourceCopyAuxiliaryDataInfoAtIndex(_: CGImageSource, _: Int, _: CFString) -> Any? { [AnyHashable: Any]() }
