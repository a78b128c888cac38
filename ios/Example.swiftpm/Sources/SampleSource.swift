import Phasefront
import UIKit

/// A source for devices without depth: a window that moves over the project's sample scene, 30 times per second.
final class SampleSource: FrameSource, @unchecked Sendable {
    /// Why it is not the camera.
    private let why: String
    /// Written before it runs.
    private var task: Task<Void, Never>?

    init(why: String) { self.why = why }

    func start(_ feed: Feed) {
        task = Task.detached { [why] in
            guard let scene = SampleScene() else { return feed.tell(.failed("the app lacks its sample scene")) }
            var step = 0
            while !Task.isCancelled {
                feed.frame("Sample scene: \(why)") { try $0.submit(scene.frame(step)) }
                step += 1
                try? await Task.sleep(nanoseconds: 33_000_000)
            }
        }
    }

    func stop() { task?.cancel() }
}

/// Seven eighths of the project's sample scene.
struct SampleScene: Sendable {
    private let colour, depth: Pixels

    /// Reads the app's images. Fails if they cannot be read.
    init?() {
        guard let colour = pixels("scene_rgb", "jpg", channels: 4),
            let depth = pixels("scene_depth", "png", channels: 1)
        else { return nil }
        (self.colour, self.depth) = (colour, depth)
    }

    /// Returns a frame with the current time, of a window that has moved `step` pixels to and fro.
    func frame(_ step: Int) -> CameraFrame {
        let most = colour.width / 8
        let x = step / most % 2 == 0 ? step % most : most - 1 - step % most
        return CameraFrame(
            timestampNs: Int64(DispatchTime.now().uptimeNanoseconds),
            colour: window(colour, x: x, channels: 4) { width, height, plane in
                ColourImage(format: .rgba, width: width, height: height, planes: [plane])
            },
            depth: window(depth, x: x * depth.width / colour.width, channels: 1) { width, height, plane in
                DepthImage(format: .normalizedU8, width: width, height: height, plane: plane)
            })
    }
}

private struct Pixels: Sendable {
    let bytes: Data
    let width, height: Int
}

/// Returns seven eighths of `pixels`, starting at column `x`.
private func window<Image>(
    _ pixels: Pixels, x: Int, channels: Int, _ make: (Int, Int, ImagePlane) -> Image
) -> Image {
    let bytes = pixels.bytes.dropFirst(channels * x)
    let plane = ImagePlane(bytes: bytes, rowStride: channels * pixels.width, pixelStride: channels)
    return make(pixels.width - pixels.width / 8, pixels.height - pixels.height / 8, plane)
}

/// Returns the pixels of an image of the app: RGBA or grey.
private func pixels(_ name: String, _ type: String, channels: Int) -> Pixels? {
    guard let path = Bundle.module.path(forResource: name, ofType: type),
        let image = UIImage(contentsOfFile: path)?.cgImage
    else { return nil }
    var bytes = Data(count: channels * image.width * image.height)
    bytes.withUnsafeMutableBytes { memory in
        let context = CGContext(
            data: memory.baseAddress, width: image.width, height: image.height, bitsPerComponent: 8,
            bytesPerRow: channels * image.width,
            space: channels == 1 ? CGColorSpaceCreateDeviceGray() : CGColorSpaceCreateDeviceRGB(),
            bitmapInfo: (channels == 1 ? CGImageAlphaInfo.none : .noneSkipLast).rawValue)
        context?.draw(image, in: CGRect(x: 0, y: 0, width: image.width, height: image.height))
    }
    return Pixels(bytes: bytes, width: image.width, height: image.height)
}
