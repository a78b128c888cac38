//! Runs the conformance suite from Rust: frames in every format and their expected levels. Swift, Kotlin and Python run
//! the same suite from `tests/conformance/`; the bits of all four must be equal.
//!
//! `PHASEFRONT_BLESS=1` rewrites the suite. If `PHASEFRONT_CONFORMANCE` names a folder, the levels are written to its
//! `levels.bin` and views of the holograms to its `seen.bin`, for the other languages to compare with.
#![allow(clippy::unwrap_used)]

use phasefront_ffi::{
    Brightness, ColourFormat, ColourInfo, ColourScale, ConfidenceFormat, ConfidenceInfo, DepthFormat, DepthInfo,
    DepthNetwork, DepthRange, Encoding, Focus, FrameInfo, Method, Network, Orientation, PlaneInfo, RawHologram,
    RawPlanes, RawSession, RgbEncoding, Rotation, RunningMode, SessionOptions, Target, YuvMatrix, display_from_toml,
    session_options,
};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::sync::Arc;

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/conformance")
}

/// Returns the levels of `hologram`, read as the other languages read them.
fn levels(hologram: &RawHologram) -> Vec<u8> {
    let len = hologram.plane_len() as usize;
    (0..hologram.info().colours)
        .flat_map(|colour| {
            let address = hologram.plane_address(colour).unwrap() as usize;
            // SAFETY: the hologram is alive, and `address` points to its plane of `len` bytes.
            #[allow(unsafe_code)]
            unsafe { std::slice::from_raw_parts(address as *const u8, len) }.to_vec()
        })
        .collect()
}

/// Returns the bytes of all numbers of `planes`, read as the other languages read them.
fn numbers(planes: &RawPlanes) -> Vec<u8> {
    let sides = [planes.pixel_bytes(), planes.width(), planes.height(), planes.colours()];
    let len = sides.iter().product();
    let address = planes.plane_address(0).unwrap() as usize;
    assert!(planes.plane_address(planes.colours()).is_err());
    // SAFETY: the planes are alive and contiguous at `address`.
    #[allow(unsafe_code)]
    unsafe { std::slice::from_raw_parts(address as *const u8, len) }.to_vec()
}

/// Loads a network of `models/`.
fn model(name: &str) -> Arc<Network> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../models").join(name);
    Network::from_file(path.to_str().unwrap().into()).unwrap()
}

fn int(value: &Value) -> usize {
    value.as_u64().unwrap() as usize
}

fn plane(value: &Value) -> PlaneInfo {
    PlaneInfo {
        row_stride: int(&value["row_stride"]),
        pixel_stride: int(&value["pixel_stride"]),
    }
}

/// Returns the bytes of a plane in `frames.bin`.
fn bytes<'a>(frames: &'a [u8], plane: &Value) -> &'a [u8] {
    match plane {
        Value::Null => &[],
        _ => &frames[int(&plane["offset"])..][..int(&plane["length"])],
    }
}

fn options(case: &Value) -> SessionOptions {
    let display = display_from_toml(case["display"].as_str().unwrap().into()).unwrap();
    let target = match (case["calibration"].as_str(), case["lut"].as_array()) {
        (Some(file), _) => Target::from_file(folder().join(file).to_str().unwrap().into()).unwrap(),
        (None, Some(levels)) => {
            let levels = levels.iter().map(|level| int(level) as u8).collect();
            Target::with_look_up_table(display, levels).unwrap()
        }
        (None, None) => Target::of_display(display).unwrap(),
    };
    let method = match case["method"].as_str().unwrap() {
        "default" => None,
        "network" => Some(Method::Trained {
            network: Network::built_in("rgbd-8").unwrap(),
        }),
        "sweep" => Some(Method::Sweep),
        "auto" => Some(Method::Auto {
            network: Some(Network::built_in("rgbd-8").unwrap()),
        }),
        file => Some(Method::Trained { network: model(file) }),
    };
    SessionOptions {
        encoding: match case["encoding"].as_str().unwrap() {
            "double-phase" => Encoding::DoublePhase,
            "anti-alias" => Encoding::AntiAlias { sigma: 0.7, width: 3 },
            "band-limit" => Encoding::BandLimit { k: 1.0 },
            file => Encoding::Deep { prefilter: model(file) },
        },
        brightness: match &case["brightness"] {
            Value::Null => Brightness::Smoothed,
            scale => Brightness::Fixed {
                scale: scale.as_f64().unwrap() as f32,
            },
        },
        depth_range: match &case["range"] {
            Value::Null => DepthRange::Percentiles,
            range => DepthRange::Fixed {
                near_m: range[0].as_f64().unwrap() as f32,
                far_m: range[1].as_f64().unwrap() as f32,
            },
        },
        focus: match &case["focus_steps"] {
            Value::Null => Focus::Coherent,
            steps => Focus::Natural { steps: int(steps) },
        },
        depth_network: case["depth_network"].as_str().map(|file| {
            let onnx = std::fs::read(folder().join(file)).unwrap();
            DepthNetwork::from_bytes(&onnx, Some(ColourScale::Unit), false).unwrap()
        }),
        ..session_options(target, method).unwrap()
    }
}

fn info(frame: &Value) -> FrameInfo {
    let (colour, depth, confidence) = (&frame["colour"], &frame["depth"], &frame["confidence"]);
    FrameInfo {
        timestamp_ns: frame["timestamp_ns"].as_i64().unwrap(),
        colour: ColourInfo {
            format: match colour["format"].as_str().unwrap() {
                "rgba" => ColourFormat::Rgba,
                "bgra" => ColourFormat::Bgra,
                "rgb" => ColourFormat::Rgb,
                "nv12" => ColourFormat::Nv12,
                "yuv420" => ColourFormat::Yuv420,
                other => panic!("{other}"),
            },
            width: int(&colour["width"]),
            height: int(&colour["height"]),
            planes: colour["planes"].as_array().unwrap().iter().map(plane).collect(),
            matrix: match colour["matrix"].as_str().unwrap() {
                "bt601" => YuvMatrix::Bt601,
                "bt709" => YuvMatrix::Bt709,
                other => panic!("{other}"),
            },
            video_range: colour["video_range"].as_bool().unwrap(),
            encoding: RgbEncoding::from_name(colour["encoding"].as_str().unwrap()).unwrap(),
        },
        depth: match depth {
            Value::Null => None,
            _ => Some(DepthInfo {
                format: match depth["format"].as_str().unwrap() {
                    "metres-f32" => DepthFormat::MetresF32,
                    "metres-f16" => DepthFormat::MetresF16,
                    "disparity-f32" => DepthFormat::DisparityF32,
                    "disparity-f16" => DepthFormat::DisparityF16,
                    "millimetres-u16" => DepthFormat::MillimetresU16,
                    "android-depth16" => DepthFormat::AndroidDepth16,
                    "normalized-u8" => DepthFormat::NormalizedU8,
                    "normalized-u16" => DepthFormat::NormalizedU16,
                    "relative-f32" => DepthFormat::RelativeF32,
                    "relative-f16" => DepthFormat::RelativeF16,
                    other => panic!("{other}"),
                },
                width: int(&depth["width"]),
                height: int(&depth["height"]),
                plane: plane(&depth["plane"]),
            }),
        },
        confidence: match confidence {
            Value::Null => None,
            _ => Some(ConfidenceInfo {
                format: match confidence["format"].as_str().unwrap() {
                    "low-medium-high" => ConfidenceFormat::LowMediumHigh,
                    "u8" => ConfidenceFormat::U8,
                    other => panic!("{other}"),
                },
                width: int(&confidence["width"]),
                height: int(&confidence["height"]),
                plane: plane(&confidence["plane"]),
            }),
        },
        orientation: Orientation {
            rotation: match frame["rotation"].as_u64().unwrap() {
                0 => Rotation::Upright,
                90 => Rotation::Clockwise90,
                180 => Rotation::Half,
                270 => Rotation::Clockwise270,
                other => panic!("{other}"),
            },
            mirrored: frame["mirrored"].as_bool().unwrap(),
        },
        cameras: None,
    }
}

/// The results of a case's frames, one after another.
#[derive(Default)]
struct CaseResult {
    levels: Vec<u8>,
    /// The amplitudes at 1.5 mm and the field at -1 mm of each frame.
    seen: Vec<u8>,
}

fn run(case: &Value, frames: &[u8]) -> CaseResult {
    let mode = match case["mode"].as_str().unwrap() {
        "image" => RunningMode::Image,
        "video" => RunningMode::Video,
        other => panic!("{other}"),
    };
    let session = RawSession::new(options(case), mode, None).unwrap();
    let mut all = CaseResult::default();
    for frame in case["frames"].as_array().unwrap() {
        let colour = |index: usize| bytes(frames, &frame["colour"]["planes"][index]);
        let hologram: Arc<RawHologram> = session
            .process(
                colour(0),
                colour(1),
                colour(2),
                bytes(frames, &frame["depth"]["plane"]),
                bytes(frames, &frame["confidence"]["plane"]),
                info(frame),
            )
            .unwrap();
        all.levels.extend(levels(&hologram));
        all.seen.extend(numbers(&hologram.refocus(1.5).unwrap()));
        all.seen.extend(numbers(&hologram.field(-1.0).unwrap()));
    }
    all
}

/// Returns the number of levels that differ, and the largest difference around the circle of `levels` levels.
fn difference(a: &[u8], b: &[u8], levels: i32) -> (usize, i32) {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).fold((0, 0), |(count, most), (a, b)| {
        let apart = (i32::from(*a) - i32::from(*b)).rem_euclid(levels);
        let apart = apart.min(levels - apart);
        (count + usize::from(apart > 0), most.max(apart))
    })
}

/// Rewrites the suite once, if that is asked for.
fn bless() {
    static BLESSED: std::sync::Once = std::sync::Once::new();
    if std::env::var_os("PHASEFRONT_BLESS").is_some() {
        BLESSED.call_once(write::suite);
    }
}

#[test]
fn frames_become_the_levels_that_are_expected() {
    bless();
    let suite = std::fs::read_to_string(folder().join("cases.json")).unwrap();
    let suite: Value = serde_json::from_str(&suite).unwrap();
    let frames = std::fs::read(folder().join("frames.bin")).unwrap();
    let expected = std::fs::read(folder().join("levels.bin")).unwrap();
    let mut all = CaseResult::default();
    for case in suite["cases"].as_array().unwrap() {
        let CaseResult { levels: got, seen } = run(case, &frames);
        let want = &expected[all.levels.len()..][..got.len()];
        // Another processor may round the last bit differently, which changes a few levels. The levels of a calibrated
        // modulator are not ordered, so a changed one may be any other.
        let (count, most) = difference(&got, want, int(&case["levels"]) as i32);
        let name = &case["name"];
        assert!(
            count * 200 <= got.len(),
            "{name}: {count} of {} levels differ",
            got.len()
        );
        assert!(
            most <= 1 || !case["lut"].is_null() || !case["calibration"].is_null(),
            "{name}: a level differs by {most}"
        );
        all.levels.extend(got);
        all.seen.extend(seen);
    }
    assert_eq!(all.levels.len(), expected.len());
    if let Some(folder) = std::env::var_os("PHASEFRONT_CONFORMANCE") {
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(PathBuf::from(&folder).join("levels.bin"), all.levels).unwrap();
        std::fs::write(PathBuf::from(folder).join("seen.bin"), all.seen).unwrap();
    }
}

/// The default is the plane sweep where edges are sharp and the built-in network where they are soft.
#[test]
fn the_default_depends_on_the_edges_of_depth() {
    bless();
    let suite = std::fs::read(folder().join("cases.json")).unwrap();
    let cases: Value = serde_json::from_slice(&suite).unwrap();
    let frames = std::fs::read(folder().join("frames.bin")).unwrap();
    for (edges, method) in [("sharp", "sweep"), ("soft", "network")] {
        let name = format!("the default method, {edges} edges");
        let cases = cases["cases"].as_array().unwrap();
        let case = cases.iter().find(|case| case["name"] == name.as_str()).unwrap();
        for explicit in ["sweep", "network", "auto"] {
            let mut named = case.clone();
            named["method"] = json!(explicit);
            let same = run(&named, &frames).levels == run(case, &frames).levels;
            assert_eq!(same, explicit == method || explicit == "auto", "{name} by {explicit}");
        }
    }
}

/// Writes the suite: a picture and its depth in each format.
mod write {
    use super::*;
    use phasefront::Size;

    const DISPLAY: Size = Size { width: 48, height: 36 };

    /// Returns colour and metres at (x, y) of a picture with sides 0..1 at time t: a ball in front of a striped wall.
    fn scene(x: f64, y: f64, t: f64) -> ([f64; 3], f64) {
        let (dx, dy) = (x - 0.45 - 0.1 * t, (y - 0.5) * 0.75);
        let r = (dx * dx + dy * dy).sqrt() / 0.22;
        if r < 1.0 {
            let light = 0.35 + 0.6 * (1.0 - r * r).sqrt();
            return ([light, 0.55 * light, 0.2 + 0.1 * y], 0.6 - 0.15 * (1.0 - r * r).sqrt());
        }
        let stripe = if (x * 9.0 + y * 4.0).floor() as i64 % 2 == 0 {
            0.8
        } else {
            0.25
        };
        (
            [0.3 * stripe, 0.3 + 0.5 * stripe * y, stripe * (1.0 - 0.4 * x)],
            1.2 + 0.5 * x,
        )
    }

    /// Returns the metres of a scene without a sharp edge: a bump in front of a wall, as depth from motion has it.
    fn soft_metres(x: f64, y: f64) -> f64 {
        let (dx, dy) = (x - 0.5, (y - 0.5) * 0.75);
        let r = (dx * dx + dy * dy).sqrt();
        let near = 1.0 - ((r - 0.15) / 0.2).clamp(0.0, 1.0);
        1.8 - 1.2 * near * near * (3.0 - 2.0 * near)
    }

    fn at(i: usize, n: usize) -> f64 {
        (i as f64 + 0.5) / n as f64
    }

    fn byte(value: f64) -> u8 {
        (value.clamp(0.0, 1.0) * 255.0).round() as u8
    }

    /// The memory of the whole suite.
    #[derive(Default)]
    struct Frames(Vec<u8>);

    impl Frames {
        /// Writes a plane with gaps after rows and pixels, filled with bytes that must not be read.
        fn plane(
            &mut self,
            Size { width, height }: Size,
            size: usize,
            pixel: usize,
            pad: usize,
            fill: impl Fn(usize, usize) -> Vec<u8>,
        ) -> Value {
            let row = width * pixel + pad;
            let mut bytes = vec![0xa5; row * (height - 1) + (width - 1) * pixel + size];
            for y in 0..height {
                for x in 0..width {
                    bytes[y * row + x * pixel..][..size].copy_from_slice(&fill(x, y));
                }
            }
            let offset = self.0.len();
            self.0.extend(&bytes);
            json!({"offset": offset, "length": bytes.len(), "row_stride": row, "pixel_stride": pixel})
        }

        fn colour(&mut self, format: &str, size: Size, matrix: &str, video_range: bool, t: f64) -> Value {
            let Size { width, height } = size;
            let rgb = |x: usize, y: usize| scene(at(x, width), at(y, height), t).0;
            let (kr, kb) = if matrix == "bt709" {
                (0.2126, 0.0722)
            } else {
                (0.299, 0.114)
            };
            let yuv = |[r, g, b]: [f64; 3]| {
                let y = kr * r + (1.0 - kr - kb) * g + kb * b;
                let (u, v) = ((b - y) / (2.0 - 2.0 * kb), (r - y) / (2.0 - 2.0 * kr));
                if video_range {
                    [
                        (16.0 + 219.0 * y) / 255.0,
                        (128.0 + 224.0 * u) / 255.0,
                        (128.0 + 224.0 * v) / 255.0,
                    ]
                } else {
                    [y, u + 128.0 / 255.0, v + 128.0 / 255.0]
                }
            };
            let half = Size {
                width: width.div_ceil(2),
                height: height.div_ceil(2),
            };
            let chroma = |x: usize, y: usize| yuv(scene(at(x, half.width), at(y, half.height), t).0);
            let luma = |x, y| vec![byte(yuv(rgb(x, y))[0])];
            let planes = match format {
                "rgba" => vec![self.plane(size, 4, 4, 12, |x, y| {
                    let [r, g, b] = rgb(x, y);
                    vec![byte(r), byte(g), byte(b), 7]
                })],
                "bgra" => vec![self.plane(size, 4, 4, 0, |x, y| {
                    let [r, g, b] = rgb(x, y);
                    vec![byte(b), byte(g), byte(r), 9]
                })],
                "rgb" => {
                    vec![self.plane(size, 3, 3, 1, |x, y| rgb(x, y).map(byte).to_vec())]
                }
                "nv12" => vec![
                    self.plane(size, 1, 1, 8, luma),
                    self.plane(half, 2, 2, 8, |x, y| {
                        chroma(x, y)[1..].iter().map(|v| byte(*v)).collect()
                    }),
                ],
                "yuv420" => vec![
                    self.plane(size, 1, 1, 3, luma),
                    self.plane(half, 1, 2, 5, |x, y| vec![byte(chroma(x, y)[1])]),
                    self.plane(half, 1, 2, 5, |x, y| vec![byte(chroma(x, y)[2])]),
                ],
                other => panic!("{other}"),
            };
            json!({"format": format, "width": width, "height": height, "matrix": matrix, "video_range": video_range, "encoding": "amplitude", "planes": planes})
        }

        fn depth(&mut self, format: &str, size: Size, t: f64) -> Value {
            let Size { width, height } = size;
            let hole = |x: usize, y: usize| (x * 7 + y * 3).is_multiple_of(19);
            let pixel = if format.ends_with("f32") {
                4
            } else if format.ends_with("u8") {
                1
            } else {
                2
            };
            let plane = self.plane(size, pixel, pixel, 2 * pixel, |x, y| {
                let metres = scene(at(x, width), at(y, height), t).1;
                let measured = if hole(x, y) { 0.0 } else { metres };
                let normalized = (metres - 0.4) / 1.4;
                match format {
                    "soft-metres-f32" => (soft_metres(at(x, width), at(y, height)) as f32).to_le_bytes().to_vec(),
                    "metres-f32" => (if hole(x, y) { f32::NAN } else { metres as f32 })
                        .to_le_bytes()
                        .to_vec(),
                    "metres-f16" => f16_bits(measured).to_le_bytes().to_vec(),
                    "disparity-f32" => (if hole(x, y) { 0.0 } else { 1.0 / metres as f32 })
                        .to_le_bytes()
                        .to_vec(),
                    "disparity-f16" => f16_bits(if hole(x, y) { 0.0 } else { 1.0 / metres })
                        .to_le_bytes()
                        .to_vec(),
                    "millimetres-u16" => ((measured * 1000.0) as u16).to_le_bytes().to_vec(),
                    "android-depth16" => {
                        let code = if hole(x, y) { 1 } else { (x as u16 % 3) * 3 };
                        ((metres * 1000.0) as u16 | code << 13).to_le_bytes().to_vec()
                    }
                    "normalized-u8" => vec![byte(normalized)],
                    "normalized-u16" => ((normalized * 65535.0) as u16).to_le_bytes().to_vec(),
                    "relative-f32" => (if hole(x, y) { f32::NAN } else { 1.0 - metres as f32 })
                        .to_le_bytes()
                        .to_vec(),
                    "relative-f16" => f16_bits(5.0 - 2.0 * metres).to_le_bytes().to_vec(),
                    other => panic!("{other}"),
                }
            });
            json!({"format": format, "width": width, "height": height, "plane": plane})
        }

        fn confidence(&mut self, format: &str, size: Size) -> Value {
            let Size { width, height } = size;
            let plane = self.plane(size, 1, 1, 1, |x, y| {
                let low = (x * 5 + y * 11) % 13 == 0;
                vec![match (format, low) {
                    (_, true) => 0,
                    ("u8", false) => 200,
                    _ => 2,
                }]
            });
            json!({"format": format, "width": width, "height": height, "plane": plane})
        }
    }

    /// Returns the largest 16-bit float that is not above `value`, which is 0 or in 2^-14..2^15.
    fn f16_bits(value: f64) -> u16 {
        if value == 0.0 {
            return 0;
        }
        let exponent = value.log2().floor();
        ((exponent as i32 + 15) as u16) << 10 | ((value / exponent.exp2() - 1.0) * 1024.0) as u16
    }

    /// Returns a calibration of a display with a nonlinear phase response, uneven illumination and an aberrated lens.
    fn calibration(display: &str) -> Vec<u8> {
        use phasefront::target::Aberration;
        use phasefront_core::display::response::per_pixel::PerPixel;
        use phasefront_core::display::response::per_pixel::nodes;
        let (rows, columns) = nodes(DISPLAY, 12);
        let levels: Vec<f32> = (0..3 * rows * columns)
            .flat_map(|node| {
                let most = 200.0 + (node * 11 % 50) as f32;
                (0..=8).map(move |k| most * (k as f32 / 8.0).powf(1.2))
            })
            .collect();
        let turns = vec![std::f32::consts::TAU; 3 * rows * columns];
        let table = PerPixel::new(DISPLAY, 12, 8, &levels, &turns).unwrap();
        let amplitude = ndarray::Array3::from_shape_fn((3, 4, 5), |(c, y, x)| {
            1.0 - 0.05 * ((x as f32 - 2.0).powi(2) + (y as f32 - 1.5).powi(2)) - 0.01 * c as f32
        });
        let display = phasefront::Display::from_toml(display).unwrap();
        phasefront::Target {
            response: phasefront::target::Response::PerPixel(Arc::new(table)),
            illumination: Some(phasefront::target::Illumination::new(amplitude.view()).unwrap()),
            correction: Some(Aberration::new([[0.0, 1.5, 0.2, 0.0, 0.0]; 3]).unwrap()),
            ..display.into()
        }
        .to_bytes()
        .unwrap()
    }

    #[expect(clippy::too_many_lines, reason = "case after case")]
    pub(super) fn suite() {
        let mut frames = Frames::default();
        let Size { width: w, height: h } = DISPLAY;
        let display = format!("width = {w}\nheight = {h}\n");
        let still = |colour: Value, depth: Value| json!({"timestamp_ns": 1, "colour": colour, "depth": depth, "confidence": null, "rotation": 0, "mirrored": false});
        let case = |name: &str, frames: Vec<Value>| {
            json!({"name": name, "method": "network", "mode": "image", "display": display, "levels": 256, "encoding": "anti-alias", "lut": null,
                   "calibration": null, "brightness": null, "range": null, "focus_steps": null, "depth_network": null, "frames": frames})
        };
        let mut cases = Vec::new();

        let colour = frames.colour("rgba", Size { width: 64, height: 48 }, "bt601", false, 0.0);
        let depth = frames.depth("metres-f32", Size { width: 32, height: 24 }, 0.0);
        let plain = still(colour, depth);
        cases.push(case("RGBA and metres", vec![plain.clone()]));

        let mut one = case("BGRA and 16-bit metres, sensor turned", vec![]);
        let mut frame = still(
            frames.colour("bgra", Size { width: 36, height: 48 }, "bt601", false, 0.0),
            frames.depth("metres-f16", Size { width: 18, height: 24 }, 0.0),
        );
        frame["rotation"] = json!(90);
        frame["mirrored"] = json!(true);
        one["frames"] = json!([frame]);
        cases.push(one);

        let mut frame = still(
            frames.colour("rgb", Size { width: 61, height: 47 }, "bt601", false, 0.0),
            frames.depth("disparity-f32", Size { width: 31, height: 24 }, 0.0),
        );
        frame["rotation"] = json!(180);
        cases.push(case("RGB of odd size and disparity, upside down", vec![frame]));

        let mut frame = still(
            frames.colour("nv12", Size { width: 64, height: 48 }, "bt709", true, 0.0),
            frames.depth("disparity-f16", Size { width: 32, height: 24 }, 0.0),
        );
        frame["confidence"] = frames.confidence("low-medium-high", Size { width: 32, height: 24 });
        cases.push(case("420v of BT.709 and 16-bit disparity with confidence", vec![frame]));

        let mut frame = still(
            frames.colour("yuv420", Size { width: 63, height: 47 }, "bt601", false, 0.0),
            frames.depth("millimetres-u16", Size { width: 40, height: 30 }, 0.0),
        );
        frame["confidence"] = frames.confidence("u8", Size { width: 40, height: 30 });
        cases.push(case(
            "YUV_420_888 of odd size and millimetres with confidence",
            vec![frame],
        ));

        let mut frame = still(
            frames.colour("yuv420", Size { width: 48, height: 64 }, "bt601", true, 0.0),
            frames.depth("android-depth16", Size { width: 24, height: 32 }, 0.0),
        );
        frame["rotation"] = json!(270);
        cases.push(case(
            "YUV_420_888 of video range and DEPTH16, sensor turned",
            vec![frame],
        ));

        let frame = still(
            frames.colour("nv12", Size { width: 64, height: 48 }, "bt601", false, 0.0),
            frames.depth("normalized-u8", Size { width: 64, height: 48 }, 0.0),
        );
        cases.push(case("420f and normalized depth", vec![frame]));

        let mut one = case(
            "a small frame, 16-bit normalized depth, modulator off the volume, double phase, 5 bits",
            vec![],
        );
        one["frames"] = json!([still(
            frames.colour("rgba", Size { width: 24, height: 18 }, "bt601", false, 0.0),
            frames.depth("normalized-u16", Size { width: 24, height: 18 }, 0.0)
        )]);
        one["display"] = json!(format!("{display}offset_mm = 4.5\nbits = 5\n"));
        one["levels"] = json!(32);
        one["encoding"] = json!("double-phase");
        cases.push(one);

        let mut one = case(
            "band limit, fixed brightness, fixed range, a calibrated modulator",
            vec![plain.clone()],
        );
        one["encoding"] = json!("band-limit");
        one["brightness"] = json!(1.25);
        one["range"] = json!([0.5, 1.5]);
        one["lut"] = (0..256).map(|i| (i * 3 / 4 + 20) as u8).collect();
        cases.push(one);

        std::fs::create_dir_all(folder()).unwrap();
        std::fs::write(folder().join("display.pfc"), calibration(&display)).unwrap();
        let mut one = case(
            "a display that was calibrated pixel by pixel, its laser and its optics too",
            vec![plain.clone()],
        );
        one["calibration"] = json!("display.pfc");
        cases.push(one);

        let mut one = case("deep double phase", vec![plain.clone()]);
        one["method"] = json!("ddpm-8-int8.onnx");
        one["encoding"] = json!("ddpm-8-prefilter.onnx");
        cases.push(one);

        let mut one = case("a network seeded by the plane sweep", vec![plain.clone()]);
        one["method"] = json!("unbundled/seeded-8-80-int8.onnx");
        cases.push(one);

        let mut one = case("what suits the depth", vec![plain.clone()]);
        one["method"] = json!("auto");
        cases.push(one);

        let mut one = case("the plane sweep, for a display that no network is for", vec![plain]);
        one["method"] = json!("sweep");
        one["display"] = json!(format!(
            "{display}pitch_um = 4.5\nwavelengths_nm = [650, 530, 440]\nvolume_depth_mm = 2.0\n"
        ));
        cases.push(one);

        let mut one = case("video", vec![]);
        one["mode"] = json!("video");
        one["frames"] = (0..4u64)
            .map(|i| {
                let t = i as f64 / 3.0;
                let mut frame = still(
                    frames.colour("bgra", Size { width: 48, height: 36 }, "bt601", false, t),
                    frames.depth("metres-f32", Size { width: 24, height: 18 }, t),
                );
                frame["timestamp_ns"] = json!(1_000_000_000 + i * 33_000_000);
                frame
            })
            .collect();
        cases.push(one);

        let mut one = case("a display of one laser", vec![cases[0]["frames"][0].clone()]);
        one["display"] = json!(format!("{display}wavelengths_nm = [532]\n"));
        cases.push(one);

        for format in ["relative-f32", "relative-f16"] {
            let frame = still(
                frames.colour("rgba", Size { width: 64, height: 48 }, "bt601", false, 0.0),
                frames.depth(format, Size { width: 32, height: 24 }, 0.0),
            );
            cases.push(case(&format!("depth of a network, {format}"), vec![frame]));
        }

        let mut one = case("depth of the session's own network", vec![]);
        one["depth_network"] = json!("depth.onnx");
        one["frames"] = json!([still(
            frames.colour("rgba", Size { width: 64, height: 48 }, "bt601", false, 0.0),
            Value::Null
        )]);
        cases.push(one);

        let size = Size { width: 96, height: 72 };
        let half = Size { width: 48, height: 36 };
        for (name, format) in [("sharp", "metres-f32"), ("soft", "soft-metres-f32")] {
            let mut one = case(&format!("the default method, {name} edges"), vec![]);
            one["method"] = json!("default");
            one["display"] = json!(format!("width = {}\nheight = {}\n", size.width, size.height));
            let colour = frames.colour("rgba", size, "bt601", false, 0.0);
            let mut depth = frames.depth(format, half, 0.0);
            depth["format"] = json!("metres-f32");
            one["frames"] = json!([still(colour, depth)]);
            cases.push(one);
        }

        for (encoding, name, display) in [
            ("srgb", "sRGB", display.clone()),
            (
                "display-p3",
                "Display P3 on measured lasers",
                format!("{display}powers = [4.0, 3.5, 2.0]\n"),
            ),
            ("bt2020-hlg", "hybrid log-gamma", display.clone()),
            ("bt2020-pq", "perceptual quantization", display.clone()),
            (
                "srgb",
                "sRGB on one laser",
                format!("{display}wavelengths_nm = [532]\n"),
            ),
        ] {
            let mut one = case(name, vec![cases[0]["frames"][0].clone()]);
            one["display"] = json!(display);
            one["frames"][0]["colour"]["encoding"] = json!(encoding);
            cases.push(one);
        }

        for (steps, name) in [(0, "natural focus by a network"), (2, "natural focus by steps")] {
            let mut one = case(name, vec![cases[0]["frames"][0].clone()]);
            one["method"] = json!("default");
            one["focus_steps"] = json!(steps);
            cases.push(one);
        }

        let levels: Vec<u8> = cases.iter().flat_map(|case| run(case, &frames.0).levels).collect();
        let folder = folder();
        std::fs::write(folder.join("frames.bin"), &frames.0).unwrap();
        std::fs::write(folder.join("levels.bin"), levels).unwrap();
        let text = serde_json::to_string_pretty(&json!({"cases": cases})).unwrap();
        std::fs::write(folder.join("cases.json"), text + "\n").unwrap();
    }
}
