#if canImport(ARKit)
    import ARKit
    import PhasefrontCore

    extension HologramSession {
        /// Returns the hologram of an ARKit frame, in an image or a video session. The configuration needs
        /// `frameSemantics.insert(.sceneDepth)` or `.smoothedSceneDepth`. ``Frame`` lists the errors.
        ///
        /// - Parameter orientation: The rotation that brings ARKit's image, which is in sensor orientation, upright.
        public func process(_ frame: ARFrame, orientation: Orientation = .upright) throws -> Hologram {
            try withFrame(frame, orientation: orientation) { try process($0) }
        }

        /// Submits an ARKit frame to a live stream; see ``submit(_:)``. The session does not retain the `ARFrame`.
        @discardableResult
        public func submit(_ frame: ARFrame, orientation: Orientation = .upright) throws -> DropReason? {
            try withFrame(frame, orientation: orientation) { try submit($0) }
        }
    }

    private func withFrame<R>(
        _ frame: ARFrame, orientation: Orientation, _ body: (CameraFrame) throws -> R
    ) throws -> R {
        guard let depth = frame.smoothedSceneDepth ?? frame.sceneDepth else {
            throw PhasefrontError.frame(
                message:
                    "frame: ARKit gave no depth; run a configuration with the frame semantics sceneDepth, on a device with LiDAR"
            )
        }
        return try withColourImage(frame.capturedImage) { colour in
            try withDepthImage(depth.depthMap, confidence: depth.confidenceMap) { depth in
                try body(
                    CameraFrame(
                        timestampNs: Int64(frame.timestamp * 1e9), colour: colour, depth: depth,
                        orientation: orientation))
            }
        }
    }
#endif
