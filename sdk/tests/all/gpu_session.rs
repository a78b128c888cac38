//! Compares GPU sessions with CPU sessions: the levels of the same frames are nearly equal, unsupported work falls back
//! to the CPU, and sessions survive lost devices. Any device will do, including Mesa's software driver.
use crate::camera;
use crate::on_gpu;
use phasefront::Size;

use camera::{Scene, colour_formats, depth, frame, options};
use on_gpu::on_gpu;
use phasefront::input::{CameraFrame, DepthFormat, Orientation, Rotation};
use phasefront::output::Layout;
use phasefront::session::{Backend, DropReason, Event, Focus, Quality};
use phasefront::target::Response;
use phasefront::{
    Brightness, Display, Error, ImageSession, LiveSession, Method, Network, SessionOptions, Sweep, VideoSession,
};
use phasefront_gpu::{ChainOptions, Float};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::time::Duration;

const W: usize = 64;
const H: usize = 48;

/// Compares levels around the circle of `steps`: returns the share that differs, and asserts that no level differs by
/// more than one step, except for a share of `far`.
fn differing(levels: &[u8], expected: &[u8], far: f64) -> f64 {
    let apart = |(a, b): (&u8, &u8)| {
        let d = a.abs_diff(*b);
        d.min(255 - d + 1)
    };
    let count = |least: u8| {
        let differ = (levels.iter().zip(expected)).filter(|pair| apart(*pair) >= least);
        differ.count() as f64 / levels.len() as f64
    };
    assert_eq!(levels.len(), expected.len());
    assert!(count(2) <= far, "{} differ by over one step", count(2));
    count(1)
}

#[test]
fn images_are_those_of_the_cpu_in_every_way_to_make_them() {
    let plain = options(Size { width: W, height: H });
    let gpu = on_gpu(plain.clone());
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    for brightness in [Brightness::Smoothed, Brightness::Fixed(0.9), Brightness::FrameMax] {
        let (mut plain, mut gpu) = (plain.clone(), gpu.clone());
        (plain.encoder.brightness, gpu.encoder.brightness) = (brightness, brightness);
        if brightness == Brightness::FrameMax {
            let lut = Response::lut(std::array::from_fn(|i| 255 - i as u8));
            (plain.target.response, gpu.target.response) = (lut.clone(), lut);
        }
        let cpu = ImageSession::new(plain).unwrap();
        let gpu = ImageSession::new(gpu).unwrap();
        gpu.warm_up().unwrap();
        let frame = frame(7, &scene, &metres);
        let expected = cpu.process(&frame).unwrap();
        let made = gpu.process(&frame).unwrap();
        assert!((made.scale() - expected.scale()).abs() < 1e-4 * expected.scale());
        // With equal inputs, the 8-bit network gives the same bits as on the CPU. Colour converted on the GPU may round
        // the other way, which changes the field around it.
        let share = differing(made.levels(), expected.levels(), 0.002);
        assert!(share < 0.01, "{brightness:?}: {share}");
        assert_eq!(made.range_m(), expected.range_m());
        assert_eq!(made.z_at(0.3, 0.4), expected.z_at(0.3, 0.4));
        let z_m = made.z_at(0.3, 0.4);
        let (mut a, mut b) = (vec![0; 4 * 24 * 32], vec![0; 4 * 24 * 32]);
        made.write_preview(z_m, Size { width: 32, height: 24 }, Layout::Rgba, &mut a, 128)
            .unwrap();
        expected
            .write_preview(z_m, Size { width: 32, height: 24 }, Layout::Rgba, &mut b, 128)
            .unwrap();
        assert!(a.iter().zip(&b).all(|(a, b)| a.abs_diff(*b) <= 2));
        let (there, here) = (gpu.statistics(), cpu.statistics());
        let device = gpu.gpu().unwrap();
        assert_eq!(there.backend.name, device.name());
        assert!(there.backend.why.contains("int8"), "{:?}", there.backend);
        assert_ne!(there.backend.name, here.backend.name);
        assert!(cpu.gpu().is_none());
        // The stage times add up to no more than the frame's time.
        assert!(made.times().method > Duration::ZERO);
    }
}

/// f32 networks give nearly the CPU's levels in 32 bits, and similar levels in 16 bits.
#[test]
fn images_of_an_f32_network_are_near_the_cpus() {
    let mut plain = options(Size { width: W, height: H });
    let network = Network::from_onnx(include_bytes!("../../../models/rgbd-8.onnx")).unwrap();
    plain.quality_levels[0].method = Method::Network(Arc::new(network));
    let gpu = on_gpu(plain.clone());
    let scene = Scene::new(Size { width: W, height: H }, 10);
    let metres = scene.depth_bytes(DepthFormat::MetresF32);
    let frame = frame(7, &scene, &metres);
    let cpu = ImageSession::new(plain).unwrap();
    let expected = cpu.process(&frame).unwrap();
    for (float, far, most) in [(Float::F32, 0.001, 0.02), (Float::Fastest, 0.2, 0.6)] {
        let mut options = gpu.clone();
        options.gpu.chain = ChainOptions {
            float,
            ..Default::default()
        };
        let session = ImageSession::new(options).unwrap();
        let made = session.process(&frame).unwrap();
        let share = differing(made.levels(), expected.levels(), far);
        println!("{float:?}: {share} differ");
        assert!(share < most, "{float:?}: {share}");
    }
}

/// Runs steps of natural focus on a video that stands partly still, from depth of the frame's size and from readings.
#[test]
fn steps_of_natural_focus_are_those_of_the_cpu() {
    let mut plain = options(Size { width: W, height: H });
    plain.encoder.focus_steps = 2;
    let cpu = VideoSession::new(plain.clone()).unwrap();
    let gpu = VideoSession::new(on_gpu(plain)).unwrap();
    let planar = Scene::new(Size { width: W, height: H }, 10);
    let metres = planar.depth_bytes(DepthFormat::MetresF32);
    for frame in [frame_at(1), frame_at(2), frame(3 * 33_000_000, &planar, &metres)] {
        let expected = cpu.process(&frame).unwrap();
        let made = gpu.process(&frame).unwrap();
        let share = differing(made.levels(), expected.levels(), 0.01);
        assert!(share < 0.05, "{share}");
    }
    assert_eq!(gpu.statistics().backend.name, gpu.gpu().unwrap().name());
}

/// Runs the plane sweep, alone and under a network, at separate quality levels, on camera frames.
#[test]
#[ignore = "slow: 20 seconds of a core in software"]
fn sweeps_are_those_of_the_cpu() {
    let mut plain = options(Size { width: W, height: H });
    let seeded = Network::from_onnx(include_bytes!("../../../models/unbundled/seeded-8-80.onnx")).unwrap();
    let sweep = Method::Sweep(Sweep::for_display(&plain.target.display));
    for (method, word) in [(sweep, "the sweep"), (Method::Seeded(Arc::new(seeded)), "Layers")] {
        plain.quality_levels[0].method = method;
        let mut gpu = on_gpu(plain.clone());
        gpu.gpu.chain.float = Float::F32;
        let cpu = ImageSession::new(plain.clone()).unwrap();
        let gpu = ImageSession::new(gpu).unwrap();
        let expected = cpu.process(&frame_at(1)).unwrap();
        let made = gpu.process(&frame_at(1)).unwrap();
        let (scale, wanted) = (made.scale(), expected.scale());
        assert!((scale - wanted).abs() < 2e-3 * wanted, "{word}: {scale} for {wanted}");
        // The CPU's sweep is rounded to 16 bits.
        let share = differing(made.levels(), expected.levels(), 0.01);
        assert!(share < 0.1, "{word}: {share}");
        let backend = gpu.statistics().backend;
        assert_eq!(backend.name, gpu.gpu().unwrap().name());
        assert!(backend.why.contains(word), "{backend:?}");
    }
}

/// Chooses the method of each frame as the CPU does, from depth of the frame's size and from readings.
#[test]
#[ignore = "slow: 15 seconds of a core in software"]
fn the_automatic_choice_is_that_of_the_cpu() {
    let size = Size { width: 128, height: 96 };
    let mut plain = options(size);
    // Where the modulator is at the midpoint, either method alone ends there too.
    plain.target.display = Display::from_toml("width = 128\nheight = 96\noffset_mm = 0").unwrap();
    let Method::Network(network) = plain.quality_levels[0].method.clone() else {
        panic!("the tests' network");
    };
    let sweep = Sweep::for_display(&plain.target.display);
    plain.quality_levels[0].method = Method::Auto(sweep, network.clone());
    let alone = |method: Method| {
        let mut options = plain.clone();
        options.quality_levels[0].method = method;
        options
    };
    let methods = [Method::Sweep(sweep), Method::Network(network)];
    let scene = Scene::new(size, 40);
    let gpu = VideoSession::new(on_gpu(plain.clone())).unwrap();
    let cpu = VideoSession::new(plain.clone()).unwrap();
    let resumed = VideoSession::new(on_gpu(plain.clone())).unwrap();
    for (i, (soft, rows)) in [(false, 96), (true, 96), (true, 48), (false, 24), (true, 96)]
        .into_iter()
        .enumerate()
    {
        let columns = rows * 4 / 3;
        let metres = |x: usize, y: usize| {
            let (x, y) = (x as f32 / columns as f32 - 0.5, y as f32 / rows as f32 - 0.5);
            let r = (x * x + y * y).sqrt();
            let share = if soft {
                ((r - 0.1) / 0.2).clamp(0.0, 1.0)
            } else {
                f32::from(r > 0.25)
            };
            0.6 + 1.2 * share * share * (3.0 - 2.0 * share)
        };
        let bytes: Vec<u8> = (0..rows * columns)
            .flat_map(|i| metres(i % columns, i / columns).to_le_bytes())
            .collect();
        let depth = depth(
            &bytes,
            DepthFormat::MetresF32,
            Size {
                width: columns,
                height: rows,
            },
        );
        let time = (i as u64 + 1) * 33_000_000;
        let frame = CameraFrame::new(time, scene.colour(), depth);
        let expected = cpu.process(&frame).unwrap();
        let made = gpu.process(&frame).unwrap();
        let share = differing(made.levels(), expected.levels(), 0.01);
        assert!(share < 0.1, "{i}: {share}");
        let single = ImageSession::new(alone(methods[usize::from(soft)].clone())).unwrap();
        let single = single.process(&frame).unwrap();
        let image = ImageSession::new(plain.clone()).unwrap().process(&frame).unwrap();
        assert!(image.levels() == single.levels(), "{i}: soft is {soft}");
        // A frame that is replayed counts.
        match i {
            0..4 => resumed.replay(&frame, made.scale()).unwrap(),
            _ => assert_eq!(resumed.process(&frame).unwrap().levels(), made.levels()),
        }
    }
    let why = gpu.statistics().backend.why;
    assert!(why.contains("int8") && why.contains("the sweep"), "{why}");
}

/// Runs each colour format, rotated and not, as frames of one session, which plans only its input again.
#[test]
fn cameras_may_change_their_format() {
    let plain = options(Size { width: W, height: H });
    let gpu = on_gpu(plain.clone());
    let cpu = ImageSession::new(plain).unwrap();
    let gpu = ImageSession::new(gpu).unwrap();
    let turned = Orientation {
        rotation: Rotation::Half,
        mirrored: true,
    };
    let metres = Scene::new(Size { width: 32, height: 24 }, 9).depth_bytes(DepthFormat::MetresF32);
    for (seed, format) in colour_formats().into_iter().enumerate() {
        for (size, orientation) in [
            (Size { width: W, height: H }, Orientation::default()),
            (Size { width: 101, height: 75 }, turned),
        ] {
            let noise = camera::Noise::new(seed as u64, format, size, 3);
            let depth = depth(&metres, DepthFormat::MetresF32, Size { width: 32, height: 24 });
            let mut frame = CameraFrame::new(1, noise.image().unwrap(), depth);
            frame.orientation = orientation;
            let expected = cpu.process(&frame).unwrap();
            let made = gpu.process(&frame).unwrap();
            let share = differing(made.levels(), expected.levels(), 0.02);
            assert!(share < 0.05, "{format:?} {size}: {share}");
        }
    }
    assert!(gpu.statistics().backend.name.contains('('));
}

#[test]
fn natural_focus_of_the_network_is_that_of_the_cpu() {
    let target = options(Size { width: W, height: H }).target;
    let plain = SessionOptions::for_focus(target, Focus::Natural { steps: 0 }).unwrap();
    let gpu = ImageSession::new(on_gpu(plain.clone())).unwrap();
    let made = gpu.process(&frame_at(1)).unwrap();
    let expected = ImageSession::new(plain).unwrap().process(&frame_at(1)).unwrap();
    let share = differing(made.levels(), expected.levels(), 0.01);
    assert!(share < 0.05, "{share}");
    let backend = gpu.statistics().backend;
    assert!(gpu.gpu().is_some() && backend.name.contains('('), "{backend:?}");
}

#[test]
fn video_is_as_smooth_as_on_the_cpu() {
    let mut plain = options(Size { width: W, height: H });
    // GPUs compute every frame whole.
    plain.keep_standing = false;
    let gpu = on_gpu(plain.clone());
    let cpu = VideoSession::new(plain).unwrap();
    let gpu = VideoSession::new(gpu).unwrap();
    let mut scales = Vec::new();
    for i in 0..8u64 {
        let mut scene = Scene::new(Size { width: W, height: H }, 4 + 3 * i as usize);
        // The scene darkens abruptly.
        if i > 3 {
            scene.rgba.iter_mut().for_each(|v| *v /= 2);
        }
        let metres = scene.depth_bytes(DepthFormat::MetresF32);
        let frame = frame(33_000_000 * (i + 1), &scene, &metres);
        let expected = cpu.process(&frame).unwrap();
        let made = gpu.process(&frame).unwrap();
        // The tolerance is one bin of the histogram, because an amplitude may lie on its bound.
        assert!(
            (made.scale() - expected.scale()).abs() < 4.0 / 2048.0,
            "{} {}",
            made.scale(),
            expected.scale()
        );
        let share = differing(made.levels(), expected.levels(), 0.01);
        assert!(share < 0.05, "{i}: {share}");
        scales.push(made.scale());
    }
    let late = gpu.process(&frame_at(1)).unwrap_err();
    assert!(matches!(late, Error::Timestamp { .. }));
    // The brightness follows slowly.
    let step = |i: usize| (scales[i + 1] - scales[i]).abs();
    assert!(step(3) < 0.05 * scales[3], "{scales:?}");
    assert!(scales[7] < scales[3], "{scales:?}");
    assert_eq!(gpu.statistics().processed, 8);
}

/// The levels of coarse and of full-size depth, in a video in which something moves. A frame that is replayed counts.
#[test]
#[ignore = "slow: 30 seconds of a core in software"]
fn depth_is_conditioned_on_the_gpu_as_on_the_cpu() {
    for size @ Size { width, height } in [
        Size {
            width: W / 4,
            height: H / 4,
        },
        Size { width: W, height: H },
    ] {
        let mut plain = options(Size { width: W, height: H });
        plain.quality_levels[0].method = Method::Sweep(Sweep::for_display(&plain.target.display));
        // A GPU computes every frame whole.
        plain.keep_standing = false;
        let cpu = VideoSession::new(plain.clone()).unwrap();
        let [gpu, resumed] = [(); 2].map(|()| VideoSession::new(on_gpu(plain.clone())).unwrap());
        for time in 0..4 {
            let scene = Scene::new(Size { width: W, height: H }, 8 + 4 * time);
            let mut sensor = Scene::new(size, (8 + 4 * time) * width / W);
            // A hole and noise.
            sensor.metres[width / 2] = 0.0;
            let noise = |i: usize| 0.01 * ((i * 7 + time) % 5) as f32;
            sensor
                .metres
                .iter_mut()
                .enumerate()
                .for_each(|(i, m)| *m += noise(i) * *m);
            let metres = sensor.depth_bytes(DepthFormat::MetresF32);
            let depth = depth(&metres, DepthFormat::MetresF32, Size { width, height });
            let frame = CameraFrame::new(33_000_000 * (time as u64 + 1), scene.colour(), depth);
            let expected = cpu.process(&frame).unwrap();
            let made = gpu.process(&frame).unwrap();
            let share = differing(made.levels(), expected.levels(), 0.01);
            println!("{height}×{width} {time}: {share}");
            assert!(share < 0.1, "{height}×{width} {time}: {share}");
            // On the GPU z is known at the sensor's resolution.
            for (x, y) in [(0.9, 0.8), (0.1, 0.9)] {
                assert!((made.z_at(x, y) - expected.z_at(x, y)).abs() < 1e-4);
            }
            match time {
                3 => assert_eq!(resumed.process(&frame).unwrap().levels(), made.levels()),
                _ => resumed.replay(&frame, made.scale()).unwrap(),
            }
        }
    }
}

/// Depth that is too high for a GPU turns up in the midst of a session.
#[test]
fn depth_that_the_gpu_refuses_is_conditioned_on_the_cpu() {
    let height = 65_536;
    let plain = options(Size { width: W, height: H });
    let cpu = ImageSession::new(plain.clone()).unwrap();
    let gpu = ImageSession::new(on_gpu(plain)).unwrap();
    gpu.process(&frame_at(1)).unwrap();
    assert_ne!(gpu.statistics().backend.name, cpu.statistics().backend.name);
    let high = Scene::new(Size { width: 1, height }, 0);
    let metres = high.depth_bytes(DepthFormat::MetresF32);
    let frame = frame(2, &high, &metres);
    let (made, expected) = (gpu.process(&frame).unwrap(), cpu.process(&frame).unwrap());
    assert_eq!(made.levels(), expected.levels());
    assert!(
        gpu.statistics().backend.why.contains("workgroups"),
        "{:?}",
        gpu.statistics().backend
    );
}

fn frame_at(timestamp_ns: u64) -> CameraFrame<'static> {
    static SCENE: std::sync::OnceLock<(Scene, Vec<u8>)> = std::sync::OnceLock::new();
    let (scene, metres) = SCENE.get_or_init(|| {
        let scene = Scene::new(Size { width: W, height: H }, 10);
        let metres = scene.depth_bytes(DepthFormat::MetresF32);
        (scene, metres)
    });
    frame(timestamp_ns, scene, metres)
}

/// Destroys the device repeatedly in mid-stream: frames on it fail as lost, and all others are answered.
#[test]
fn a_live_session_outlives_its_device() {
    let options = on_gpu(options(Size { width: W, height: H }));
    let (sender, events) = mpsc::channel();
    let listener = move |event| sender.send(event).unwrap();
    let session = LiveSession::new(options, listener).unwrap();
    let (mut made, mut lost, mut timestamp) = (0, 0, 0);
    let mut levels = None;
    for round in 0..3 {
        for i in 0..3 {
            timestamp += 1;
            let device = session.gpu();
            session.submit(&frame_at(timestamp)).unwrap();
            if let (1, Some(device)) = (i, device) {
                // Destroy the device at different moments of the frame.
                std::thread::sleep(Duration::from_millis(2 * round));
                device.wgpu().0.destroy();
            }
            match events.recv().unwrap() {
                Event::Processed(hologram) => {
                    assert_eq!(hologram.timestamp_ns(), Some(timestamp));
                    let first = levels.get_or_insert_with(|| hologram.levels().to_vec());
                    assert!(differing(hologram.levels(), first, 0.0) < 0.01);
                    made += 1;
                }
                Event::Failed {
                    timestamp_ns,
                    error: Error::Lost(why),
                } => {
                    assert_eq!(timestamp_ns, timestamp);
                    assert!(why.contains("lost") && !why.contains('\n'), "{why}");
                    lost += 1;
                }
                other => panic!("{other:?}"),
            }
        }
    }
    let statistics = session.statistics();
    assert_eq!((statistics.processed, statistics.failed), (made, lost));
    assert_eq!(made + lost, 9);
    assert!(made >= 6, "{made}");
    // A frame succeeded after each loss, so the GPU is still in use.
    assert!(statistics.backend.why.contains("opened again after"));
    session.close();
}

/// Work that the GPU does not support runs on the CPU, which reports the reason; the levels are exactly the CPU's.
#[test]
fn where_the_gpu_does_not_serve_the_cpu_does_and_says_why() {
    let cpu = |mut options: SessionOptions| {
        options.backend = Backend::Cpu;
        let session = ImageSession::new(options).unwrap();
        session.process(&frame_at(1)).unwrap().levels().to_vec()
    };
    let mut missing = options(Size { width: W, height: H });
    missing.backend = Backend::Gpu;
    missing.gpu.device.name = Some("no such card".into());
    let mut cases = vec![(missing, "no GPU")];
    let gpu = on_gpu(options(Size { width: W, height: H }));
    let mut sweep = gpu.clone();
    sweep.quality_levels[0].method = Method::Sweep(Sweep {
        taps: 31,
        ..Sweep::for_display(&sweep.target.display)
    });
    cases.push((sweep, "31 taps"));
    let text = "width = 64\nheight = 48\noffset_mm = 2\nbits = 10";
    let mut ten = SessionOptions::new(Display::from_toml(text).unwrap(), gpu.quality_levels[0].method.clone());
    (ten.backend, ten.gpu) = (gpu.backend, gpu.gpu.clone());
    cases.push((ten, "8 bits"));
    let text = "width = 64\nheight = 48\noffset_mm = 2\nwavelengths_nm = [532]";
    let mut one = SessionOptions::new(Display::from_toml(text).unwrap(), gpu.quality_levels[0].method.clone());
    (one.backend, one.gpu) = (gpu.backend, gpu.gpu.clone());
    cases.push((one, "one laser"));
    // One line is too long for any workgroup's memory.
    let mut long = gpu.clone();
    let text = "width = 9000\nheight = 4\noffset_mm = 2";
    long.target.display = Display::from_toml(text).unwrap();
    long.quality_levels[0].size = Size { width: 9000, height: 4 };
    cases.push((long, "workgroup"));
    let mut half = gpu.clone();
    let network = Network::from_onnx(include_bytes!("../../../models/rgbd-8.onnx")).unwrap();
    half.quality_levels[0].method = Method::Network(Arc::new(network));
    half.gpu.chain.float = Float::F16;
    let device = phasefront_gpu::Device::open(&half.gpu.device).unwrap();
    if !device.has_half() {
        cases.push((half, "shader-f16"));
    }
    for (options, word) in cases {
        let expected = cpu(options.clone());
        let session = ImageSession::new(options).unwrap();
        let backend = session.statistics().backend;
        assert!(backend.why.contains(word), "{word}: {backend:?}");
        assert!(!backend.name.is_empty() && !backend.why.contains('\n'));
        assert_eq!(session.process(&frame_at(1)).unwrap().levels(), expected);
        assert!(session.gpu().is_none() || word != "no GPU");
    }
    // Options that the CPU refuses too are an error.
    let mut wrong = options(Size { width: W, height: H });
    wrong.backend = Backend::Gpu;
    wrong.gpu.device.name = Some("no such card".into());
    wrong.target.display = Display::from_toml("width = 64\nheight = 48\npitch_um = 4").unwrap();
    assert!(ImageSession::new(wrong).is_err());
}

/// Runs quality levels on the GPU and on the CPU in one session.
#[test]
fn quality_levels_say_where_they_are_computed() {
    let mut options = on_gpu(options(Size { width: W, height: H }));
    let mut low = options.quality_levels[0].clone();
    low.backend = Some(Backend::Cpu);
    low.size = Size {
        width: W / 2,
        height: H / 2,
    };
    let mut middle = low.clone();
    middle.backend = None;
    options.quality_levels.extend([middle, low]);
    options.quality = Quality::Fixed(0);
    let session = VideoSession::new(options).unwrap();
    let device = session.gpu().unwrap();
    let mut names = Vec::new();
    for (i, quality_level) in [0, 1, 2, 2, 0].into_iter().enumerate() {
        session.set_quality(Quality::Fixed(quality_level)).unwrap();
        session.process(&frame_at(2 * i as u64 + 1)).unwrap();
        let hologram = session.process(&frame_at(2 * i as u64 + 2)).unwrap();
        assert_eq!(hologram.quality_level(), quality_level);
        names.push(session.statistics().backend.name);
    }
    assert_eq!((&names[0], &names[1]), (&device.name(), &device.name()));
    assert_ne!(names[2], names[0]);
    assert_eq!((&names[3], &names[4]), (&names[2], &names[0]));
    // All levels share one device.
    assert!(Arc::ptr_eq(&device, &session.gpu().unwrap()));
}

#[test]
fn sessions_close_at_any_moment() {
    let options = on_gpu(options(Size { width: W, height: H }));
    for round in 0..6 {
        let closed = Arc::new(AtomicBool::new(false));
        let (sender, events) = mpsc::channel();
        let late = closed.clone();
        let listener = move |event| {
            assert!(!late.load(Ordering::SeqCst), "told after it was closed");
            sender.send(event).unwrap();
        };
        let session = LiveSession::new(options.clone(), listener);
        let session = session.unwrap();
        for timestamp in 1..=round {
            session.submit(&frame_at(timestamp)).unwrap();
        }
        std::thread::sleep(Duration::from_millis(3 * round));
        session.close();
        closed.store(true, Ordering::SeqCst);
        let statistics = session.statistics();
        assert_eq!(statistics.pending, 0);
        assert_eq!(statistics.failed, 0);
        drop(session);
        let mut told: Vec<Event> = events.iter().collect();
        assert!(matches!(told.pop(), Some(Event::Closed)));
        assert_eq!(told.len() as u64, round);
        assert!(told.iter().all(|event| matches!(
            event,
            Event::Processed(_)
                | Event::Dropped {
                    reason: DropReason::Closed | DropReason::Superseded,
                    ..
                }
        )));
    }
}
