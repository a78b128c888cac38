//! Compares GPU stages with their CPU counterparts on any device, including software drivers.
#![allow(clippy::unwrap_used)]

#[path = "../../../tests/driver.rs"]
mod driver;
#[path = "../../../tests/network_models.rs"]
mod network_models;
#[path = "../../../tests/skip.rs"]
mod skip;

use ndarray::{Array2, Array3};
use network_models::{Model, frame};
use num_complex::Complex32;
use phasefront_core::Size;
use phasefront_core::depth::condition::Conditioner;
use phasefront_core::display::Display;
use phasefront_core::display::illumination::Illumination;
use phasefront_core::display::response::Response;
use phasefront_core::display::response::per_pixel::PerPixel;
use phasefront_core::encode::brightness::Brightness;
use phasefront_core::encode::{EncoderOptions, Encoding};
use phasefront_core::frame::{
    ColourFormat, ColourImage, Crop, LightConstants, Orientation, Plane, RgbEncoding, RgbdFrame, Rotation, YuvEncoding,
    YuvMatrix,
};
use phasefront_core::method::Method;
use phasefront_core::method::network::Network;
use phasefront_core::method::network::{Isa, reference};
use phasefront_core::method::sweep::Sweep;
use phasefront_core::optics::zernike::Aberration;
use phasefront_core::output::Layout;
use phasefront_core::view::colours::ViewColours;
use phasefront_core::view::preview::Preview;
use phasefront_gpu::{
    self, ChainOptions, Colour, ColourData, Deliver, Depth, DepthData, Device, DeviceOptions, Float, Frame, Fusion,
    GpuLevels, GpuNetworkPlan, GpuPipeline, GpuView, Job,
};
use pollster::block_on;
use std::sync::Arc;
use std::time::Duration;

/// Returns a device that other tests may hold too.
fn device() -> Arc<Device> {
    static DEVICES: driver::Devices<Device> = driver::Devices::new();
    let software = DeviceOptions {
        name: Some(driver::software()),
        ..Default::default()
    };
    DEVICES.device(|| Device::open(&DeviceOptions::default()).or_else(|_| Device::open(&software)))
}

fn largest_difference(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, |worst, d| if d > worst || d.is_nan() { d } else { worst })
}

fn run(network: &Network, options: ChainOptions, Size { width: w, height: h }: Size, input: &[f32]) -> Vec<f32> {
    let device = device();
    let plan = GpuNetworkPlan::new(&device, network, Size { width: w, height: h }, options).unwrap();
    let mut output = vec![f32::NAN; 6 * h * w];
    plan.run(input, &mut output).unwrap();
    output
}

const SIZES: [Size; 3] = [
    Size { width: 1, height: 1 },
    Size { width: 33, height: 7 },
    Size { width: 61, height: 47 },
];

#[test]
fn chains_in_f32_and_f16_agree_with_the_definition() {
    chains_in_f32_and_f16(5);
}

#[test]
#[ignore = "slow: 20 seconds of a core in software"]
fn all_chains_in_f32_and_f16_agree_with_the_definition() {
    chains_in_f32_and_f16(1);
}

/// Tries every `step`-th model. A driver in software takes a second or two to compile one.
fn chains_in_f32_and_f16(step: usize) {
    let device = device();
    let models = [
        Model::new(2, 8),
        Model {
            tanh: true,
            head: "amplitude-phase",
            ..Model::new(5, 24)
        },
        Model {
            inputs: 6,
            input: "field",
            tanh: true,
            head: "amplitude-phase",
            ..Model::new(4, 8)
        },
        Model {
            inputs: 20,
            input: "ldi5",
            ..Model::new(8, 16)
        },
        // Filter counts that are no multiple of eight or four, and a width that fills no group.
        Model::new(7, 12),
        Model::new(6, 5),
        Model::new(4, 16).halved(),
        Model {
            tanh: true,
            head: "amplitude-phase",
            ..Model::new(5, 8).halved()
        },
    ];
    for model in models.into_iter().step_by(step) {
        let network = Network::from_onnx(&model.bytes()).unwrap();
        for size in SIZES {
            let input = frame(model.inputs, size, 7);
            let expected = reference::run(network.chain().unwrap(), &input, size);
            let largest = expected.iter().fold(1.0f32, |most, v| most.max(v.abs()));
            let mut fused = Vec::new();
            for (float, fusion, tolerance) in [
                (Float::F32, Fusion::Layers, 1e-4),
                (Float::F32, Fusion::Pairs, 1e-4),
                (Float::F16, Fusion::Layers, 0.02),
                (Float::F16, Fusion::Pairs, 0.02),
            ] {
                if float == Float::F16 && !device.has_half() {
                    skip::or_fail("16-bit floats", format!("{device:?} has none"));
                    continue;
                }
                let options = ChainOptions { float, fusion };
                let output = run(&network, options, size, &input);
                let worst = largest_difference(&output, &expected) / largest;
                assert!(
                    worst < tolerance,
                    "{} layers, {size:?}, {options:?}: {worst}",
                    model.layers
                );
                fused.push(output);
            }
            // A driver may contract a product and a sum in one program and not in another, so the bits can differ.
            for (both, tolerance) in fused.chunks_exact(2).zip([1e-5, 2e-3]) {
                let worst = largest_difference(&both[0], &both[1]) / largest;
                println!("fusion {} layers {size:?} {worst}", model.layers);
                assert!(worst < tolerance, "{size:?}: fusion changes values by {worst}");
            }
        }
    }
}

/// Compares frames of phone sizes with the CPU kernels.
#[test]
#[ignore = "slow: 6 seconds of a core in software"]
fn chains_of_whole_frames_agree_with_the_cpu() {
    let device = device();
    for (model, float, tolerance) in [
        (Model::new(5, 8), Float::F32, 1e-4),
        (Model::new(5, 8), Float::F16, 0.02),
        (Model::int8(5, 8), Float::F32, 0.0),
        (Model::int8(5, 16).halved(), Float::F32, 0.0),
    ] {
        if float == Float::F16 && !device.has_half() {
            skip::or_fail("16-bit floats", format!("{device:?} has none"));
            continue;
        }
        let network = Network::from_onnx(&model.bytes()).unwrap();
        for size in [
            Size { width: 47, height: 61 },
            Size {
                width: 384,
                height: 384,
            },
            Size {
                width: 960,
                height: 540,
            },
        ] {
            let input = frame(model.inputs, size, 7);
            let plan = network.plan(size).unwrap();
            let mut expected = vec![0.0; 6 * size.height * size.width];
            plan.run(&input, &mut expected, &mut plan.scratch()).unwrap();
            let largest = expected.iter().fold(1.0f32, |most, v| most.max(v.abs()));
            for fusion in [Fusion::Layers, Fusion::Pairs] {
                let output = run(&network, ChainOptions { float, fusion }, size, &input);
                let worst = largest_difference(&output, &expected) / largest;
                assert!(worst <= tolerance, "{size:?} {float:?} {fusion:?}: {worst}");
            }
        }
    }
}

#[test]
fn chains_in_int8_have_the_bits_of_the_cpu() {
    chains_in_int8(3);
}

#[test]
#[ignore = "slow: 12 seconds of a core in software"]
fn all_chains_in_int8_have_the_bits_of_the_cpu() {
    chains_in_int8(1);
}

/// Tries every `step`-th model.
fn chains_in_int8(step: usize) {
    let models = [
        Model::int8(2, 8),
        Model::int8(3, 24),
        Model::int8(4, 16),
        Model {
            tanh: true,
            head: "amplitude-phase",
            ..Model::int8(5, 8)
        },
        Model {
            inner_roundings: false,
            ..Model::int8(5, 8)
        },
        Model {
            inner_roundings: false,
            ..Model::int8(8, 8)
        },
        Model {
            inputs: 6,
            input: "field",
            tanh: true,
            head: "amplitude-phase",
            ..Model::int8(6, 8)
        },
        Model::int8(8, 24),
        Model::int8(4, 48).halved(),
        Model {
            inner_roundings: false,
            ..Model::int8(5, 8).halved()
        },
    ];
    for model in models.into_iter().step_by(step) {
        let network = Network::from_onnx(&model.bytes()).unwrap();
        for size in SIZES {
            let input = frame(model.inputs, size, 7);
            let plan = network.plan_on(Isa::Portable, size).unwrap();
            let mut expected = vec![0.0; 6 * size.height * size.width];
            plan.run(&input, &mut expected, &mut plan.scratch()).unwrap();
            for fusion in [Fusion::Layers, Fusion::Pairs] {
                let options = ChainOptions {
                    float: Float::F32,
                    fusion,
                };
                let output = run(&network, options, size, &input);
                let what = format!("{} layers, {size:?}, {fusion:?}", model.layers);
                if model.tanh {
                    assert!(largest_difference(&output, &expected) < 1e-5, "{what}");
                } else {
                    assert!(output == expected, "{what}");
                }
            }
        }
    }
}

/// Creates a frame with detail everywhere and values that 8 bits and 16 bits represent.
fn rgbd(size: Size) -> RgbdFrame {
    let Size { width, height } = size;
    let byte = |c: usize, y: usize, x: usize| ((c * 70 + x * 3 + y * 5) % 256) as f32 / 255.0;
    RgbdFrame::new(
        Array3::from_shape_fn((3, height, width), |(c, y, x)| byte(c, y, x)),
        Array2::from_shape_fn((height, width), |(y, x)| {
            ((x / 8 * 4099 + y / 8 * 257) % 65536) as f32 / 65535.0
        }),
    )
    .unwrap()
}

fn int8_network() -> Arc<Network> {
    let bytes = include_bytes!("../../../models/rgbd-8-int8.onnx");
    Arc::new(Network::from_onnx(bytes).unwrap())
}

fn f32_network() -> Arc<Network> {
    let bytes = include_bytes!("../../../models/rgbd-8.onnx");
    Arc::new(Network::from_onnx(bytes).unwrap())
}

/// Returns the mean of |exp(iφ) − exp(iφ')| for the levels of two frames.
fn apart(a: &[u8], b: &[u8], response: &Response) -> f32 {
    let shown = |level: u8| Complex32::from_polar(1.0, response.phase(level, 0));
    let sum: f32 = a.iter().zip(b).map(|(&a, &b)| (shown(a) - shown(b)).norm()).sum();
    sum / a.len() as f32
}

fn planned(size: Size, method: Method, display: &Display, encoding: Encoding, brightness: Brightness) -> Job {
    Job {
        encoder: EncoderOptions {
            brightness,
            ..encoding.into()
        },
        ..Job::new(size, method, display)
    }
}

/// Returns the CPU's levels and scale of a job.
fn on_cpu(job: &Job, frame: &RgbdFrame) -> (Vec<u8>, f32) {
    let Size { width: w, height: h } = job.size;
    let plan = job.on_cpu().unwrap();
    let mut levels = vec![0; 3 * h * w];
    let report = plan.process(frame, &mut levels, &mut plan.scratch());
    (levels, report.unwrap().scale)
}

#[test]
#[expect(clippy::too_many_lines, reason = "a table of cases")]
fn whole_frames_are_those_of_the_cpu() {
    let device = device();
    let (int8, f32) = (int8_network(), f32_network());
    let lut = Response::lut(std::array::from_fn(|i| (i / 2) as u8 + 30));
    let linear = Response::linear(8).unwrap();
    let half = if device.has_half() { Float::F16 } else { Float::F32 };
    let cases = [
        (
            &int8,
            (61, 47),
            0.0,
            Encoding::ANTI_ALIAS,
            Brightness::FrameMax,
            &linear,
            Float::F32,
        ),
        (
            &int8,
            (61, 47),
            6e-3,
            Encoding::BAND_LIMIT,
            Brightness::FrameMax,
            &lut,
            Float::F32,
        ),
        (
            &f32,
            (61, 47),
            -3e-3,
            Encoding::DoublePhase,
            Brightness::Fixed(1.0),
            &linear,
            Float::F32,
        ),
        (
            &f32,
            (61, 47),
            2e-3,
            Encoding::ANTI_ALIAS,
            Brightness::Fixed(0.8),
            &lut,
            half,
        ),
        (
            &f32,
            (384, 384),
            4e-3,
            Encoding::ANTI_ALIAS,
            Brightness::FrameMax,
            &linear,
            Float::F32,
        ),
        (
            &int8,
            (540, 960),
            0.0,
            Encoding::ANTI_ALIAS,
            Brightness::Fixed(1.0),
            &linear,
            Float::F32,
        ),
    ];
    for (network, (h, w), offset_m, encoding, scale, response, float) in cases {
        // Away from the midpoint, the display differs from the one that the network was trained for.
        let volume_mm = if offset_m > 0.0 { 4.0 } else { 6.0 };
        let display = Display::from_toml(&format!("volume_depth_mm = {volume_mm:?}")).unwrap();
        let display = display.with_offset_m(offset_m).unwrap();
        let method = Method::Network(network.clone());
        let encoded = format!("{encoding:?} {scale:?}");
        let mut job = planned(Size { width: w, height: h }, method, &display, encoding, scale);
        job.target.response = response.clone();
        job.chain.float = float;
        let frame = rgbd(Size { width: w, height: h });
        let (expected, expected_scale) = on_cpu(&job, &frame);
        let mut plan = GpuPipeline::new(&device, &job).unwrap();
        let mut levels = vec![0; 3 * h * w];
        let report = plan.process(&Frame::of(&frame), &mut levels).unwrap();
        let tolerance = if float == Float::F16 { 0.05 } else { 0.002 };
        let what = format!("{} {h}×{w} {encoded}", plan.describe());
        let apart = apart(&levels, &expected, response);
        println!("{what}: {apart} {report:?}");
        assert!(apart < tolerance, "{what}: {apart}");
        let scales = (report.scale - expected_scale).abs() / expected_scale;
        assert!(scales < tolerance, "{what}: {} {expected_scale}", report.scale);
    }
}

/// Checks sweeps to the midpoint with propagation, sweeps to the modulator, and seeded networks in all number formats.
#[test]
#[ignore = "slow: 20 seconds of a core in software"]
fn sweeps_and_seeded_networks_are_those_of_the_cpu() {
    let device = device();
    let display = Display::from_toml("volume_depth_mm = 5").unwrap();
    let default = Sweep::for_display(&display);
    let plain = Sweep {
        planes: 24,
        taps: 11,
        hidden_layers: 0,
        between_planes: false,
        ..default
    };
    let model = Model {
        inputs: 10,
        input: "seeded",
        ..Model::new(5, 8)
    };
    let (float, int8) = (model.bytes(), Model { int8: true, ..model }.bytes());
    let seeded = |bytes: &[u8]| Method::Seeded(Arc::new(Network::from_onnx(bytes).unwrap()));
    let half = if device.has_half() { Float::F16 } else { Float::F32 };
    let f32 = Float::F32;
    for (method, (h, w), offset_m, encoding, float, tolerance) in [
        (Method::Sweep(default), (61, 47), 0.0, Encoding::ANTI_ALIAS, f32, 0.002),
        (Method::Sweep(default), (47, 61), 3e-3, Encoding::BAND_LIMIT, f32, 0.002),
        (Method::Sweep(plain), (61, 47), 20e-3, Encoding::DoublePhase, f32, 0.002),
        (seeded(&float), (61, 47), 2e-3, Encoding::ANTI_ALIAS, f32, 0.002),
        (seeded(&float), (61, 47), 0.0, Encoding::ANTI_ALIAS, half, 0.05),
        // One 8-bit step outweighs rounding.
        (seeded(&int8), (61, 47), 0.0, Encoding::ANTI_ALIAS, f32, 0.02),
    ] {
        let display = display.clone().with_offset_m(offset_m).unwrap();
        let mut job = planned(
            Size { width: w, height: h },
            method,
            &display,
            encoding,
            Brightness::FrameMax,
        );
        job.chain.float = float;
        let frame = rgbd(Size { width: w, height: h });
        let (expected, expected_scale) = on_cpu(&job, &frame);
        let mut plan = GpuPipeline::new(&device, &job).unwrap();
        let mut levels = vec![0; 3 * h * w];
        let report = plan.process(&Frame::of(&frame), &mut levels).unwrap();
        let what = format!("{} {h}×{w} {offset_m}", plan.describe());
        let apart = apart(&levels, &expected, &job.target.response);
        println!("{what}: {apart} {report:?}");
        assert!(apart < tolerance, "{what}: {apart}");
        let scales = (report.scale - expected_scale).abs() / expected_scale;
        assert!(scales < tolerance, "{what}: {} {expected_scale}", report.scale);
        // Change the depth format. The sweep depends on the last bit of each depth.
        let words: Vec<u16> = (frame.depth().iter()).map(|d| (d * 65535.0).round() as u16).collect();
        let frame = Frame {
            depth: DepthData::U16(&words),
            ..Frame::of(&frame)
        };
        plan.expect(Colour::Planar, Depth::U16).unwrap();
        let mut again = vec![0; levels.len()];
        plan.process(&frame, &mut again).unwrap();
        assert!(again == levels, "{what}");
        phasefront_gpu::probe(&device, &job).unwrap();
    }
}

/// Runs steps of natural focus after networks in both number formats and after the sweep, with two frames in flight.
#[test]
#[ignore = "slow: 20 seconds of a core in software"]
fn natural_focus_is_that_of_the_cpu() {
    let device = device();
    let size = Size { width: 61, height: 47 };
    let int8 = Network::from_onnx(include_bytes!("../../../models/natural-8-int8.onnx")).unwrap();
    let float = Network::from_onnx(include_bytes!("../../../models/natural-8.onnx")).unwrap();
    let half = if device.has_half() { Float::F16 } else { Float::F32 };
    let display = Display::default();
    for (method, offset_m, float, tolerance) in [
        (Method::trained(Arc::new(int8)), 0.0, Float::F32, 0.002),
        (Method::trained(Arc::new(float)), 1e-3, half, 0.05),
        (Method::Sweep(Sweep::for_display(&display)), 0.0, Float::F32, 0.002),
    ] {
        let display = display.clone().with_offset_m(offset_m).unwrap();
        let mut job = planned(size, method, &display, Encoding::ANTI_ALIAS, Brightness::Smoothed);
        job.encoder.focus_steps = 3;
        job.chain.float = float;
        let frame = rgbd(size);
        let dim = RgbdFrame::new(frame.rgb().mapv(|v| 0.5 * v), frame.depth().to_owned()).unwrap();
        let mut plan = GpuPipeline::new(&device, &job).unwrap();
        let submit = |frame| plan.submit(&Frame::of(frame), Deliver::Levels).unwrap();
        let tickets = [&frame, &dim].map(submit);
        for (ticket, frame) in tickets.into_iter().zip([&frame, &dim]) {
            let (expected, scale) = on_cpu(&job, frame);
            let mut levels = vec![0; 3 * size.pixels()];
            let report = plan.collect(ticket, &mut levels).unwrap();
            let apart = apart(&levels, &expected, &job.target.response);
            println!("{}: {apart} {report:?}", plan.describe());
            assert!(apart < tolerance, "{}: {apart}", plan.describe());
            assert!((report.scale - scale).abs() < tolerance * scale, "{report:?} {scale}");
        }
    }
}

/// Bytes of camera planes for a sensor with odd sides and strides as in cameras.
struct Sensor {
    format: ColourFormat,
    planes: Vec<(Vec<u8>, usize, usize)>,
}

impl Sensor {
    fn all(Size { width: w, height: h }: Size) -> Vec<Sensor> {
        let plane = |rows: usize, columns: usize, step: usize, pad: usize, seed: usize| {
            let row = columns * step + pad;
            let smooth = |i: usize| 127.0 + 100.0 * ((i % row) as f32 * 0.13 + seed as f32).sin();
            let bytes = (0..rows * row).map(|i| (smooth(i) + (i / row % 23) as f32) as u8);
            (bytes.collect(), row, step)
        };
        let (half_h, half_w) = (h.div_ceil(2), w.div_ceil(2));
        let video = YuvEncoding {
            matrix: YuvMatrix::Bt2020,
            video_range: true,
        };
        let full = YuvEncoding::default();
        vec![
            Sensor {
                format: ColourFormat::Rgba,
                planes: vec![plane(h, w, 4, 0, 1)],
            },
            Sensor {
                format: ColourFormat::Bgra,
                planes: vec![plane(h, w, 4, 12, 2)],
            },
            Sensor {
                format: ColourFormat::Rgb,
                planes: vec![plane(h, w, 3, 1, 3)],
            },
            Sensor {
                format: ColourFormat::Nv12(video),
                planes: vec![plane(h, w, 1, 7, 4), plane(half_h, half_w, 2, 6, 5)],
            },
            Sensor {
                format: ColourFormat::Yuv420(full),
                planes: vec![
                    plane(h, w, 1, 3, 6),
                    plane(half_h, half_w, 2, 1, 7),
                    // A stride that exceeds the planned capacity.
                    plane(half_h, half_w, 9, 900, 8),
                ],
            },
        ]
    }

    fn image(&self, Size { width: w, height: h }: Size) -> ColourImage<'_> {
        let planes: Vec<Plane<'_>> = self
            .planes
            .iter()
            .map(|(bytes, row, step)| Plane::new(bytes, *row, *step))
            .collect();
        ColourImage::new(self.format, Size { width: w, height: h }, &planes).unwrap()
    }
}

#[test]
fn images_of_cameras_are_read_as_on_the_cpu() {
    let device = device();
    let network = int8_network();
    // Odd, so that rows of 16-bit depth do not begin at words.
    let (h, w) = (33, 45);
    let words: Vec<u16> = (0..h * w).map(|i| (i * 4099 % 65536) as u16).collect();
    let display = Display::default();
    let method = Method::Network(network);
    let (encoding, scale) = (Encoding::ANTI_ALIAS, Brightness::FrameMax);
    let planar = planned(Size { width: w, height: h }, method, &display, encoding, scale);
    let turned = Orientation {
        rotation: Rotation::Clockwise90,
        mirrored: true,
    };
    for (sensor, orientation) in [
        (Size { width: 45, height: 33 }, Orientation::default()),
        (Size { width: 49, height: 75 }, turned),
    ] {
        for camera in Sensor::all(sensor) {
            let image = camera.image(sensor);
            let job = Job {
                colour: Colour::Camera {
                    format: camera.format,
                    size: sensor,
                    orientation,
                    light: LightConstants::new(RgbEncoding::Amplitude, &display),
                },
                depth: Depth::U16,
                ..planar.clone()
            };
            let frame = Frame {
                colour: ColourData::Camera(image),
                depth: DepthData::U16(&words),
            };
            let (expected, _) = on_cpu(&job, &frame.read(orientation, Size { width: w, height: h }).unwrap());
            let mut levels = vec![0; 3 * h * w];
            let mut plan = GpuPipeline::new(&device, &job).unwrap();
            plan.process(&frame, &mut levels).unwrap();
            let apart = apart(&levels, &expected, &planar.target.response);
            assert!(apart < 0.003, "{:?} {sensor:?}: {apart}", camera.format);
            for other in [
                Frame {
                    depth: DepthData::U16(&words[1..]),
                    ..frame
                },
                Frame {
                    depth: DepthData::F32(&[0.0; 33 * 45]),
                    ..frame
                },
                Frame {
                    colour: ColourData::Planar(&[0.0; 3 * 33 * 45]),
                    ..frame
                },
            ] {
                assert!(plan.submit(&other, Deliver::Levels).is_err());
            }
        }
    }
}

#[test]
fn a_pre_filter_network_filters_as_on_the_cpu() {
    let device = device();
    let tanh = Model {
        inputs: 6,
        input: "field",
        tanh: true,
        head: "amplitude-phase",
        ..Model::new(4, 8)
    };
    let models = [
        tanh.clone(),
        Model {
            int8: true,
            ..tanh.clone()
        },
        Model {
            tanh: false,
            head: "real-imaginary",
            ..tanh
        },
        Model {
            inputs: 6,
            input: "field",
            ..Model::int8(5, 8)
        },
        Model {
            inputs: 6,
            input: "blurred-field",
            ..Model::new(4, 8)
        },
        Model {
            inputs: 12,
            input: "split-blurred-field",
            ..Model::int8(4, 8)
        },
    ];
    for model in models {
        let prefilter = Arc::new(Network::from_onnx(&model.bytes()).unwrap());
        let (h, w) = (47, 61);
        let display = Display::default();
        let method = Method::Network(f32_network());
        let encoding = Encoding::Deep(prefilter);
        let mut job = planned(
            Size { width: w, height: h },
            method,
            &display,
            encoding,
            Brightness::FrameMax,
        );
        job.chain.float = Float::F32;
        let frame = rgbd(Size { width: w, height: h });
        let (expected, scale) = on_cpu(&job, &frame);
        let mut levels = vec![0; 3 * h * w];
        let mut plan = GpuPipeline::new(&device, &job).unwrap();
        let report = plan.process(&Frame::of(&frame), &mut levels).unwrap();
        let apart = apart(&levels, &expected, &job.target.response);
        // One 8-bit step outweighs rounding.
        let tolerance = if model.int8 { 0.02 } else { 0.003 };
        assert!(apart < tolerance, "{} {}: {apart}", model.head, model.int8);
        assert!((report.scale - scale).abs() < tolerance * scale, "{report:?} {scale}");
    }
}

#[test]
fn several_frames_fly_and_each_has_its_own_levels() {
    let device = device();
    let network = int8_network();
    let (h, w) = (33, 45);
    let display = Display::default();
    let method = Method::Network(network.clone());
    let (encoding, scale) = (Encoding::ANTI_ALIAS, Brightness::FrameMax);
    let job = planned(Size { width: w, height: h }, method, &display, encoding, scale);
    let frames: Vec<RgbdFrame> = (0..3)
        .map(|i| {
            let frame = rgbd(Size { width: w, height: h });
            let rgb = frame.rgb().mapv(|v| (v * (1.0 - 0.3 * i as f32)).clamp(0.0, 1.0));
            RgbdFrame::new(rgb, frame.depth().to_owned()).unwrap()
        })
        .collect();
    let mut plan = GpuPipeline::new(&device, &job).unwrap();
    let tickets: Vec<_> = frames
        .iter()
        .map(|frame| plan.submit(&Frame::of(frame), Deliver::Levels).unwrap())
        .collect();
    let full = plan.submit(&Frame::of(&frames[0]), Deliver::Levels);
    assert!(full.unwrap_err().to_string().contains("in flight"));
    let mut scales = Vec::new();
    // Collect in another order than submitted.
    for (ticket, frame) in tickets.into_iter().zip(&frames).rev() {
        let (expected, scale) = on_cpu(&job, frame);
        let mut levels = vec![0; 3 * h * w];
        let report = plan.collect(ticket, &mut levels).unwrap();
        let apart = apart(&levels, &expected, &job.target.response);
        assert!(apart < 0.002, "{apart}");
        assert!((report.scale - scale).abs() < 1e-3, "{report:?} {scale}");
        scales.push(report.scale);
    }
    assert!(scales[0] < scales[1] && scales[1] < scales[2]);
    // Check a frame that stays on the GPU, and its texture.
    let ticket = plan.submit(&Frame::of(&frames[0]), Deliver::Shown).unwrap();
    let texture = plan.texture(&ticket);
    assert_eq!((texture.width(), texture.height()), (w as u32, h as u32));
    plan.finish(ticket).unwrap();
    let ticket = plan.submit(&Frame::of(&frames[0]), Deliver::Shown).unwrap();
    let refused = plan.collect(ticket, &mut vec![0; 3 * h * w]).unwrap_err();
    assert!(refused.to_string().contains("shown"), "{refused}");
}

/// Checks that an app can draw the levels from the texture that they were written to, on the same device.
#[test]
#[expect(clippy::too_many_lines, reason = "what an app does, from its shader to its picture")]
fn an_app_shows_the_texture_itself() {
    let device = device();
    let (h, w) = (33, 45);
    let display = Display::default();
    let method = Method::Network(int8_network());
    let (encoding, scale) = (Encoding::ANTI_ALIAS, Brightness::FrameMax);
    let job = planned(Size { width: w, height: h }, method, &display, encoding, scale);
    let mut plan = GpuPipeline::new(&device, &job).unwrap();
    let frame = rgbd(Size { width: w, height: h });
    let mut expected = vec![0; 3 * h * w];
    plan.process(&Frame::of(&frame), &mut expected).unwrap();
    let ticket = plan.submit(&Frame::of(&frame), Deliver::Shown).unwrap();
    let (inner, queue) = device.wgpu();
    let module = inner.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(
            "@group(0) @binding(0) var hologram: texture_2d<f32>;
            @vertex fn corner(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
                return vec4f(f32(i / 2u) * 4.0 - 1.0, f32(i % 2u) * 4.0 - 1.0, 0.0, 1.0);
            }
            @fragment fn show(@builtin(position) at: vec4f) -> @location(0) vec4f {
                return textureLoad(hologram, vec2u(at.xy), 0);
            }"
            .into(),
        ),
    });
    let format = wgpu::TextureFormat::Rgba8Unorm;
    let pipeline = inner.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: None,
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: None,
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: Default::default(),
        depth_stencil: None,
        multisample: Default::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: None,
            compilation_options: Default::default(),
            targets: &[Some(format.into())],
        }),
        multiview_mask: None,
        cache: None,
    });
    let view = plan.texture(&ticket).create_view(&Default::default());
    let bound = inner.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[wgpu::BindGroupEntry {
            binding: 0,
            resource: wgpu::BindingResource::TextureView(&view),
        }],
    });
    // A texture in place of the app's screen.
    let size = plan.texture(&ticket).size();
    let screen = inner.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    });
    let mut encoder = inner.create_command_encoder(&Default::default());
    {
        let view = screen.create_view(&Default::default());
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &view,
                depth_slice: None,
                resolve_target: None,
                ops: Default::default(),
            })],
            ..Default::default()
        });
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &bound, &[]);
        pass.draw(0..3, 0..1);
    }
    let buffer = inner.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: 256 * h as u64,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let to = wgpu::TexelCopyBufferInfo {
        buffer: &buffer,
        layout: wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(256),
            rows_per_image: None,
        },
    };
    encoder.copy_texture_to_buffer(screen.as_image_copy(), to, size);
    queue.submit([encoder.finish()]);
    buffer.map_async(wgpu::MapMode::Read, .., |mapped| mapped.unwrap());
    inner
        .poll(wgpu::PollType::Wait {
            submission_index: None,
            timeout: None,
        })
        .unwrap();
    let shown = buffer.get_mapped_range(..).unwrap();
    for (i, level) in expected.iter().enumerate() {
        let (c, y, x) = (i / (h * w), i / w % h, i % w);
        assert_eq!(shown[256 * y + 4 * x + c], *level, "{c} {x} {y}");
    }
    plan.finish(ticket).unwrap();
}

#[test]
fn networks_that_read_the_place_or_squares_of_pixels_are_those_of_the_cpu() {
    let device = device();
    let of_place = Model {
        inputs: 6,
        input: "rgbdxy",
        ..Model::new(5, 8)
    };
    for model in [of_place, Model::new(5, 8).halved(), Model::int8(4, 8).halved()] {
        let network = Arc::new(Network::from_onnx(&model.bytes()).unwrap());
        let (h, w) = (21, 35);
        let display = Display::default();
        let method = Method::Network(network);
        let (encoding, scale) = (Encoding::ANTI_ALIAS, Brightness::FrameMax);
        let mut job = planned(Size { width: w, height: h }, method, &display, encoding, scale);
        job.chain.float = Float::F32;
        let frame = rgbd(Size { width: w, height: h });
        let (expected, _) = on_cpu(&job, &frame);
        let mut levels = vec![0; 3 * h * w];
        let mut plan = GpuPipeline::new(&device, &job).unwrap();
        plan.process(&Frame::of(&frame), &mut levels).unwrap();
        let apart = apart(&levels, &expected, &job.target.response);
        assert!(apart < 0.003, "{apart}");
    }
}

#[test]
fn a_calibrated_display_gets_the_levels_of_the_cpu() {
    let device = device();
    let (h, w) = (47, 61);
    let network = int8_network();
    let beam = Array3::from_shape_fn((3, 5, 7), |(c, y, x)| {
        1.0 - 0.03 * (c as f32 + 1.0) * ((y as f32 - 2.0).powi(2) + (x as f32 - 3.0).powi(2)) / 4.0
    });
    let beam = Illumination::new(beam.view()).unwrap();
    let bent = Aberration::new([[0.4, -0.3, 0.2, 0.1, -0.2]; 3]).unwrap();
    let frame = rgbd(Size { width: w, height: h });
    for (offset_m, illumination, correction) in [
        (0.0, Some(beam.clone()), None),
        (2e-3, Some(beam), Some(bent.clone())),
        (0.0, None, Some(bent)),
    ] {
        // A modulator that is wider and lower than the frame.
        let display = Display::default()
            .with_size(Size {
                width: w + 9,
                height: h - 3,
            })
            .unwrap();
        let display = display.with_offset_m(offset_m).unwrap();
        let method = Method::Network(network.clone());
        let (encoding, scale) = (Encoding::ANTI_ALIAS, Brightness::FrameMax);
        let mut job = planned(Size { width: w, height: h }, method, &display, encoding, scale);
        job.target.illumination = illumination;
        job.target.correction = correction;
        let (expected, _) = on_cpu(&job, &frame);
        let mut levels = vec![0; 3 * h * w];
        let mut plan = GpuPipeline::new(&device, &job).unwrap();
        plan.process(&Frame::of(&frame), &mut levels).unwrap();
        let apart = apart(&levels, &expected, &job.target.response);
        assert!(apart < 0.002, "{offset_m}: {apart}");
        let plain = Job {
            target: display.into(),
            ..job
        };
        assert!(on_cpu(&plain, &frame).0 != expected);
    }
}

#[test]
fn a_device_is_tried_out_before_it_is_used() {
    let device = device();
    let (int8, f32) = (int8_network(), f32_network());
    for network in [&int8, &f32] {
        let display = Display::default().with_offset_m(5e-3).unwrap();
        let method = Method::Network(network.clone());
        let (encoding, scale) = (Encoding::ANTI_ALIAS, Brightness::FrameMax);
        let job = planned(
            Size {
                width: 1920,
                height: 1080,
            },
            method,
            &display,
            encoding,
            scale,
        );
        phasefront_gpu::probe(&device, &job).unwrap();
    }
}

/// Returns jobs that need every program between them, with the largest mean distance of phases.
fn small_jobs(Size { width: w, height: h }: Size) -> Vec<(Job, f32)> {
    let of = |model: Model| Arc::new(Network::from_onnx(&model.bytes()).unwrap());
    let network = |model| Method::Network(of(model));
    let seeded = Model {
        inputs: 10,
        input: "seeded",
        ..Model::new(5, 8)
    };
    let prefilter = Model {
        inputs: 12,
        input: "split-blurred-field",
        ..Model::int8(3, 8)
    };
    let halved = Model::int8(3, 8).halved();
    let display = Display::from_toml("volume_depth_mm = 1").unwrap();
    let sweep = Method::Sweep(Sweep::for_display(&display));
    let maximal = Brightness::FrameMax;
    let job = |method, offset_m, encoding, brightness| {
        let display = display.clone().with_offset_m(offset_m).unwrap();
        let mut job = planned(Size { width: w, height: h }, method, &display, encoding, brightness);
        job.chain.float = Float::F32;
        job
    };
    let mut corrected = job(network(Model::new(5, 8)), 2e-3, Encoding::BAND_LIMIT, maximal);
    let beam = Array3::from_shape_fn((3, 2, 2), |(c, y, x)| 1.0 / (1.0 + (c + y + x) as f32 / 20.0));
    corrected.target.illumination = Some(Illumination::new(beam.view()).unwrap());
    corrected.target.response = Response::lut(std::array::from_fn(|i| (i * 7 % 256) as u8));
    corrected.encoder.local_steps = 1;
    corrected.chain.fusion = Fusion::Pairs;
    let mut midpoint = job(Method::Seeded(of(seeded)), 0.0, Encoding::DoublePhase, maximal);
    midpoint.encoder.midpoint_steps = 1;
    midpoint.chain.fusion = Fusion::Pairs;
    let mut half = job(network(Model::new(5, 8)), 0.0, Encoding::ANTI_ALIAS, maximal);
    half.chain.float = Float::F16;
    let mut natural = job(network(Model::int8(3, 8)), 1e-3, Encoding::ANTI_ALIAS, maximal);
    natural.encoder.focus_steps = 2;
    vec![
        (
            job(network(Model::int8(3, 8)), 0.0, Encoding::ANTI_ALIAS, maximal),
            0.002,
        ),
        (corrected, 0.002),
        (half, 0.05),
        (job(sweep, 1e-3, Encoding::ANTI_ALIAS, Brightness::Smoothed), 0.002),
        (midpoint, 0.002),
        // One 8-bit step of a pre-filter outweighs rounding.
        (job(network(halved), 0.0, Encoding::Deep(of(prefilter)), maximal), 0.02),
        (natural, 0.002),
    ]
}

/// Runs every program on a small frame of odd sides, for drivers that are too slow for all tests: `tests/swiftshader`
/// runs it on a second driver. `--nocapture` prints what the drivers' table in docs/reliability.md has.
#[test]
fn every_program_agrees_with_the_cpu_on_a_small_frame() {
    let device = device();
    let limits = device.wgpu().0.limits();
    println!(
        "{device:?}: {} bytes of workgroup memory, {} threads a workgroup, {} storage buffers, {} MB a binding, f16 {}",
        limits.max_compute_workgroup_storage_size,
        limits.max_compute_invocations_per_workgroup,
        limits.max_storage_buffers_per_shader_stage,
        limits.max_storage_buffer_binding_size >> 20,
        device.has_half(),
    );
    let (h, w) = (13, 37);
    let frame = rgbd(Size { width: w, height: h });
    for (mut job, tolerance) in small_jobs(Size { width: w, height: h }) {
        if job.chain.fusion == Fusion::Pairs && driver::software() == "SwiftShader" {
            skip::or_fail("pairs of layers", "SwiftShader would compile them for minutes");
            job.chain.fusion = Fusion::Layers;
        }
        if job.chain.float == Float::F16 && !device.has_half() {
            skip::or_fail("16-bit floats", format!("{device:?} has none"));
            continue;
        }
        let (expected, expected_scale) = on_cpu(&job, &frame);
        let mut plan = GpuPipeline::new(&device, &job).unwrap();
        let mut levels = vec![0; 3 * h * w];
        let report = plan.process(&Frame::of(&frame), &mut levels).unwrap();
        let apart = apart(&levels, &expected, &job.target.response);
        let other = levels.iter().zip(&expected).filter(|(a, b)| a != b).count();
        let what = plan.describe();
        println!("{what}: {apart:.6} apart, {other} of {} levels", levels.len());
        assert!(apart < tolerance, "{what}: {apart}");
        let scales = (report.scale - expected_scale).abs() / expected_scale;
        assert!(scales < tolerance, "{what}: {report:?} {expected_scale}");
        assert!(
            report
                .times
                .is_none_or(|times| times.method > Duration::ZERO && times.encode > Duration::ZERO)
        );
    }
}

#[test]
fn every_program_agrees_with_the_cpu_on_a_camera_image() {
    let device = device();
    let (Size { width: w, height: h }, sensor) = (Size { width: 37, height: 13 }, (29, 21));
    let orientation = Orientation {
        rotation: Rotation::Clockwise90,
        mirrored: true,
    };
    let camera = Sensor::all(Size::from_shape(sensor)).remove(3);
    let depth = rgbd(Size { width: w, height: h });
    let frame = Frame {
        colour: ColourData::Camera(camera.image(Size::from_shape(sensor))),
        ..Frame::of(&depth)
    };
    let (mut job, tolerance) = small_jobs(Size { width: w, height: h }).swap_remove(3);
    let (expected, _) = on_cpu(&job, &frame.read(orientation, Size { width: w, height: h }).unwrap());
    job.colour = Colour::Camera {
        format: camera.format,
        size: Size::from_shape(sensor),
        orientation,
        light: LightConstants::new(RgbEncoding::Amplitude, &job.target.display),
    };
    let mut levels = vec![0; 3 * h * w];
    let mut plan = GpuPipeline::new(&device, &job).unwrap();
    plan.process(&frame, &mut levels).unwrap();
    let apart = apart(&levels, &expected, &job.target.response);
    println!("{}: {apart:.6} apart", plan.describe());
    assert!(apart < tolerance, "{apart}");
}

/// Runs videos whose depth comes as readings, for the sweep and for networks, and compares them with those of the depth
/// that the CPU decides from the same readings.
#[test]
fn every_program_agrees_with_the_cpu_on_readings() {
    let device = device();
    let (out, jobs) = (
        Size { width: 37, height: 13 },
        small_jobs(Size { width: 37, height: 13 }),
    );
    for (cells, which) in [
        (Size { width: 11, height: 5 }, 3),
        (Size { width: 37, height: 13 }, 0),
        (Size { width: 11, height: 5 }, 1),
        (Size { width: 9, height: 7 }, 4),
        (Size { width: 11, height: 5 }, 6),
    ] {
        let (mut job, tolerance) = jobs[which].clone();
        job.chain.fusion = Fusion::Layers;
        let display = rgbd(out);
        let rgb = display.values().0;
        let plan = Conditioner::new(cells, Crop::cover(cells, out), out, true).unwrap();
        let mut scratch = plan.scratch();
        let mut gpu = GpuPipeline::new(&device, &job).unwrap();
        let width = cells.width;
        gpu.expect(Colour::Planar, Depth::Readings(cells)).unwrap();
        for time in 0..3 {
            let reading = |i: usize| match (i / width, i % width) {
                (1, 3) => f32::NAN,
                (y, x) if 3 * x + y < width + time => 0.2 + 0.004 * (i * 7 % 5) as f32,
                (_, x) => 0.8 + 0.01 * x as f32,
            };
            let depth: Vec<f32> = (0..cells.pixels()).map(reading).collect();
            plan.find(&depth, rgb, &mut scratch).unwrap();
            let frame = Frame {
                colour: ColourData::Planar(rgb),
                depth: DepthData::Readings(plan.readings(&scratch)),
            };
            let mut levels = vec![0; 3 * out.height * out.width];
            // The second frame is only read, and the third has it as its past.
            match time {
                1 => block_on(gpu.read_async(None, &frame)).unwrap(),
                _ => assert!(gpu.process(&frame, &mut levels).unwrap().scale > 0.0),
            }
            let mut decided = display.clone();
            plan.decide(rgb, decided.planes_mut().1, &mut scratch);
            if time != 1 {
                let (expected, _) = on_cpu(&job, &decided);
                let apart = apart(&levels, &expected, &job.target.response);
                println!("{cells:?} {time}: {apart:.6} apart");
                assert!(apart < tolerance, "{cells:?} {time}: {apart}");
            }
        }
        let flat = Frame::of(&display);
        assert!(gpu.process(&flat, &mut vec![0; 3 * out.height * out.width]).is_err());
    }
}

/// Reads a texture of 8-bit RGBA back.
fn pixels((device, texture): (&Arc<Device>, &wgpu::Texture)) -> Vec<u8> {
    let (device, queue) = device.wgpu();
    let (height, row) = (texture.height(), (4 * texture.width()).next_multiple_of(256));
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: u64::from(height * row),
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&Default::default());
    let layout = wgpu::TexelCopyBufferLayout {
        bytes_per_row: Some(row),
        ..Default::default()
    };
    let to = wgpu::TexelCopyBufferInfo {
        buffer: &buffer,
        layout,
    };
    encoder.copy_texture_to_buffer(texture.as_image_copy(), to, texture.size());
    queue.submit([encoder.finish()]);
    buffer.map_async(wgpu::MapMode::Read, .., |mapped| mapped.unwrap());
    device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
    let bytes = buffer.get_mapped_range(..).unwrap();
    let rows = bytes.chunks_exact(row as usize);
    rows.flat_map(|bytes| &bytes[..4 * texture.width() as usize])
        .copied()
        .collect()
}

/// Makes a hologram whose levels are read back and kept on the GPU. Returns both and the scale.
fn kept(job: &Job) -> (Vec<u8>, GpuLevels, f32) {
    let Size { width: w, height: h } = job.size;
    let mut plan = GpuPipeline::new(&device(), job).unwrap();
    let frame = rgbd(Size { width: w, height: h });
    let mut levels = vec![0; 3 * h * w];
    let scale = plan.process(&Frame::of(&frame), &mut levels).unwrap().scale;
    let ticket = plan.submit(&Frame::of(&frame), Deliver::Shown).unwrap();
    let kept = block_on(plan.keep_async(&ticket)).unwrap();
    plan.finish(ticket).unwrap();
    (levels, kept, scale)
}

#[test]
fn views_of_levels_on_the_gpu_are_those_of_the_cpu() {
    let beam = Array3::from_shape_fn((3, 2, 3), |(c, y, x)| 1.0 / (1.0 + (c + y + x) as f32 / 20.0));
    let lit = Illumination::new(beam.view()).unwrap();
    let lut = Response::lut(std::array::from_fn(|i| (i * 7 % 256) as u8));
    for (size, screen, response, illumination) in [
        (
            Size { width: 47, height: 29 },
            (29, 47),
            Response::Linear { bits: 8 },
            None,
        ),
        (Size { width: 90, height: 64 }, (21, 29), lut, Some(lit)),
        (
            Size { width: 5, height: 9 },
            (70, 81),
            Response::Linear { bits: 5 },
            None,
        ),
    ] {
        let display = Display::from_toml("offset_mm = 3.0\nvolume_depth_mm = 1").unwrap();
        let display = display.with_size(size).unwrap();
        let method = Method::Sweep(Sweep::for_display(&display));
        let mut job = planned(size, method, &display, Encoding::ANTI_ALIAS, Brightness::FrameMax);
        (job.target.response, job.target.illumination) = (response, illumination);
        let (levels, on_gpu, scale) = kept(&job);
        let area = size.height * size.width;
        let words = pixels(on_gpu.texture());
        let same = |(i, pixel): (usize, &[u8])| (0..3).all(|c| pixel[c] == levels[c * area + i]) && pixel[3] == 255;
        assert!(words.chunks_exact(4).enumerate().all(same));
        for encoding in [RgbEncoding::Amplitude, RgbEncoding::Srgb] {
            let colours = ViewColours::new(encoding, &job.target.display);
            let mut view = None;
            // One plan draws views at every z: the modulator's, one beside it, and one again.
            for z_m in [-2e-3, 3e-3, 2.9e-3, -2e-3] {
                let preview = Preview::new(size, &job.target, z_m, Size::from_shape(screen)).unwrap();
                let preview = preview.with_view_colours(colours);
                let view = view.get_or_insert_with(|| block_on(GpuView::new(&on_gpu, &preview)).unwrap());
                assert!(view.fits(&on_gpu, &preview));
                block_on(view.draw(&on_gpu, &preview, scale)).unwrap();
                let drawn = pixels(view.texture());
                let mut expected = vec![0; 4 * screen.0 * screen.1];
                let image = (Layout::Rgba, &mut expected[..], 4 * screen.1);
                preview.look(&levels, scale, image, &mut preview.scratch()).unwrap();
                let most = drawn.iter().zip(&expected).map(|(a, b)| a.abs_diff(*b)).max();
                println!("a view of {size} at {z_m} m: {most:?} of 255 apart");
                assert!(most <= Some(1), "{size} {screen:?} {z_m} {encoding:?}: {most:?}");
            }
        }
    }
}

#[test]
fn views_that_a_gpu_cannot_have_are_refused() {
    let (h, w) = (12, 16);
    let display = Display::from_toml("volume_depth_mm = 1")
        .unwrap()
        .with_size(Size { width: w, height: h })
        .unwrap();
    let method = Method::Sweep(Sweep::for_display(&display));
    let mut job = planned(
        Size { width: w, height: h },
        method,
        &display,
        Encoding::ANTI_ALIAS,
        Brightness::FrameMax,
    );
    // Two by two nodes for each colour.
    let table = PerPixel::new(
        Size { width: w, height: h },
        16,
        1,
        &[0.0, 255.0].repeat(12),
        &[6.2; 12],
    )
    .unwrap();
    job.target.response = Response::PerPixel(Arc::new(table));
    let (_, on_gpu, _) = kept(&job);
    let preview = Preview::new(
        Size { width: w, height: h },
        &job.target,
        0.0,
        Size { width: 8, height: 6 },
    )
    .unwrap();
    let refused = block_on(GpuView::new(&on_gpu, &preview)).err().unwrap().to_string();
    assert!(
        refused.contains("respond differently") && !refused.contains('\n'),
        "{refused}"
    );
}
