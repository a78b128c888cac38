@_exported import CoreMedia

open class AVDepthData: NSObject { public var depthDataMap: CVPixelBuffer { fatalError() } }
