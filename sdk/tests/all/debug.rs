//! Every public type can be printed for debugging.

use phasefront::input::{
    Alignment, CameraFrame, Cameras, ColourFormat, ColourImage, ConfidenceFormat, DepthFormat, DepthImage,
    DepthOptions, DepthRange, Intrinsics, Orientation, Plane, Rotation, YuvEncoding, YuvMatrix,
};
use phasefront::output::{BitPlanes, Cells, Layout, Levels, ModulatorSpec, Output, Packing, Placement};
use phasefront::session::{
    AnsweringSession, Backend, BackendReport, DropReason, Drops, Event, FrameTimes, GpuOptions, Quality, QualityLevel,
    QualityReason, SessionHandle, Statistics, Thermal,
};
use phasefront::target::{Aberration, Illumination, Response};
use phasefront::{
    Brightness, Display, EncoderOptions, Encoding, Error, FrameReport, Hologram, ImageSession, LiveSession, Method,
    Network, Pipeline, PipelineScratch, RgbdFrame, SessionOptions, Sweep, Target, VideoSession,
};
use std::fmt::Debug;

/// Compiles only for types that implement `Debug`.
fn prints<T: Debug>() -> usize {
    usize::from(!std::any::type_name::<T>().is_empty())
}

macro_rules! count {
    ($($type:ty),+ $(,)?) => { 0 $(+ prints::<$type>())+ };
}

#[test]
fn every_public_type_implements_debug() {
    let input = count!(
        Alignment,
        CameraFrame<'_>,
        Cameras,
        ColourFormat,
        ColourImage<'_>,
        ConfidenceFormat,
        DepthFormat,
        DepthImage<'_>,
        DepthOptions,
        DepthRange,
        Intrinsics,
        Orientation,
        Plane<'_>,
        Rotation,
        YuvEncoding,
        YuvMatrix,
    );
    let output = count!(
        BitPlanes,
        Cells,
        Layout,
        Levels<'_>,
        ModulatorSpec,
        Output,
        Packing,
        Placement
    );
    let session = count!(
        AnsweringSession,
        Backend,
        BackendReport,
        DropReason,
        Drops,
        Event,
        FrameTimes,
        GpuOptions,
        Quality,
        QualityLevel,
        QualityReason,
        SessionHandle,
        Statistics,
        Thermal,
    );
    let target = count!(Aberration, Illumination, Response, Target, Display);
    let root = count!(
        Brightness,
        EncoderOptions,
        Encoding,
        Error,
        FrameReport,
        Hologram,
        ImageSession,
        LiveSession,
        Method,
        Network,
        Pipeline,
        PipelineScratch,
        RgbdFrame,
        SessionOptions,
        Sweep,
        VideoSession,
    );
    assert_eq!(input + output + session + target + root, 59);
}
