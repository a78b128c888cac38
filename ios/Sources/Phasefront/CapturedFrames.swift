#if canImport(AVFoundation) && canImport(UIKit)
    import AVFoundation
    import PhasefrontCore

    extension HologramSession {
        /// Returns the hologram of a camera image and its depth, in an image or a video session. ``Frame`` lists the
        /// errors.
        ///
        /// - Parameters:
        ///   - depth: Depth of the same moment and field of view; `AVCaptureDataOutputSynchronizer` pairs the two.
        ///   - orientation: The rotation that brings both images upright.
        public func process(
            _ image: CMSampleBuffer, depth: AVDepthData, orientation: Orientation = .upright
        ) throws -> Hologram {
            try withFrame(image, depth: depth, orientation: orientation) { try process($0) }
        }

        /// Submits a camera image and its depth to a live stream; see ``submit(_:)``. The session does not retain the
        /// buffers.
        @discardableResult
        public func submit(
            _ image: CMSampleBuffer, depth: AVDepthData, orientation: Orientation = .upright
        ) throws -> DropReason? {
            try withFrame(image, depth: depth, orientation: orientation) { try submit($0) }
        }
    }

    private func withFrame<R>(
        _ image: CMSampleBuffer, depth: AVDepthData, orientation: Orientation, _ body: (CameraFrame) throws -> R
    ) throws -> R {
        guard let buffer = CMSampleBufferGetImageBuffer(image) else {
            throw PhasefrontError.frame(message: "frame: the sample buffer holds no image")
        }
        let timestampNs = CMSampleBufferGetPresentationTimeStamp(image).phasefrontTimestampNs
        return try withColourImage(buffer) { colour in
            try withDepthImage(depth.depthDataMap) { depth in
                try body(CameraFrame(timestampNs: timestampNs, colour: colour, depth: depth, orientation: orientation))
            }
        }
    }
#endif
