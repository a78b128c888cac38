//! Tests the evaluation on small generated data sets against separately computed metrics.
use ndarray::{Array2, Array3, Axis};
use num_complex::Complex32;
use phasefront::Size;
use phasefront::target::Aberration;
use phasefront::{Brightness, Display, EncoderOptions, Encoding, Sweep};
use phasefront_command::networks::{self, Precision};
use phasefront_core::display::levels::LevelsMut;
use phasefront_core::optics::aperture::Opening;
use phasefront_core::optics::asm::{Padding, Propagator};
use phasefront_core::optics::metrics;
use phasefront_core::optics::zernike::Aberrations;
use phasefront_core::pipeline::display_plan::DisplayPlan;
use phasefront_exact::sm_lbm;
use phasefront_io::display::calibration::AberrationFile;
use phasefront_io::hologram::{Hologram, HologramInfo, Levels};
use phasefront_io::picture;
use phasefront_lab::dataset::{self, Manifest};
use phasefront_lab::evaluate::{self, Method, Row, Sample, Shown, Viewer};
use phasefront_lab::scene;
use phasefront_lab::sensor::Sensor;
use std::fs;
use std::path::Path;
use std::process::Command;

const SIZE: usize = 48;
const PLANES: usize = 10;

/// A data set of 80 pairs, of which only the two in the test split exist: 78 and 79.
struct Data {
    dir: tempfile::TempDir,
    manifest: Manifest,
}

impl Data {
    fn new() -> Self {
        Self::correcting(None)
    }

    fn correcting(aberration: Option<&AberrationFile>) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let manifest = Manifest::new(80, SIZE, PLANES, 3, 4, Display::default()).unwrap();
        let manifest = manifest.correcting(aberration);
        assert_eq!(manifest.splits.test, [78, 80]);
        for shard in [78, 79] {
            dataset::make(&manifest, &[], dir.path(), (shard, 80), &|| {}).unwrap();
        }
        Data { dir, manifest }
    }

    fn path(&self) -> &Path {
        self.dir.path()
    }

    fn evaluate(&self, methods: &[Method<'_>], shown: &[Shown]) -> Vec<Row> {
        let sample = Sample {
            scenes: vec![78, 79],
            seed: 5,
            sensors: Vec::new(),
            margin: 0,
        };
        evaluate::evaluate(&self.manifest, self.path(), &sample, methods, shown, &|| {}).unwrap()
    }

    fn command(&self, arguments: &[&str]) -> std::process::Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_phasefront-lab"));
        command
            .arg("evaluate")
            .arg(self.path())
            .args(arguments)
            .env_remove("RUST_LOG");
        command.output().unwrap()
    }
}

fn encoded(display: &Display, name: &str, encoding: Encoding) -> Shown {
    let options = EncoderOptions {
        brightness: Brightness::FrameMax,
        ..encoding.into()
    };
    Shown {
        name: name.into(),
        levels: Some((display.into(), options)),
        ceiling: 0,
        through: None,
    }
}

#[test]
fn a_pair_is_read_as_it_was_made() {
    let data = Data::new();
    let pair = dataset::read_pair(&data.manifest, data.path(), 79).unwrap();
    let scene = scene::random_scene(
        data.manifest.scene_seed(79),
        Size {
            width: SIZE,
            height: SIZE,
        },
    );
    let ldi = scene::render_ldi_reference(
        &scene,
        Size {
            width: SIZE,
            height: SIZE,
        },
        3,
    )
    .unwrap()
    .quantized();
    assert_eq!(pair.ldi, ldi);
    let hologram = sm_lbm::hologram(&ldi, &Display::default(), PLANES, &|_, _| {}).unwrap();
    assert_eq!(pair.hologram, hologram);

    let refused = |index: usize, words: &[&str]| {
        let message = match dataset::read_pair(&data.manifest, data.path(), index) {
            Ok(_) => panic!("pair {index} was read"),
            Err(e) => e.to_string(),
        };
        for word in words {
            assert!(message.contains(word), "{message}");
        }
    };
    refused(3, &["pair_000003.npz", "completes the data set"]);
    let path = Manifest::pair_path(data.path(), 78);
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    refused(78, &["pair_000078.npz", "no whole pair"]);
    let other = Manifest::new(80, SIZE + 1, PLANES, 3, 4, Display::default()).unwrap();
    let message = dataset::read_pair(&other, data.path(), 79).err().unwrap().to_string();
    assert!(message.contains("49×49"), "{message}");
}

#[test]
fn the_figures_are_those_of_the_definition() {
    let data = Data::new();
    let rows = data.evaluate(&[Method::rgb(&data.manifest.display)], &[Shown::complex()]);
    assert_eq!((rows.len(), rows[0].scenes.len()), (1, 2));
    let display = Display::default();
    for (index, figures) in &rows[0].scenes {
        let pair = dataset::read_pair(&data.manifest, data.path(), *index).unwrap();
        let front = &pair.ldi.layers[0];
        let rgb = Array3::from_shape_fn((3, SIZE, SIZE), |(c, y, x)| {
            if front.depth[(y, x)].is_nan() {
                0.0
            } else {
                front.rgb[(c, y, x)]
            }
        });
        let truth = pair.hologram.mapv(|v| v.norm());
        let direct = metrics::compare(rgb.view(), truth.view()).unwrap();
        assert!((figures.coherent.amplitude_psnr - direct.psnr_overall).abs() < 1e-3);
        assert!((figures.coherent.amplitude_ssim - direct.ssim_overall).abs() < 1e-4);

        let field = rgb.mapv(Complex32::from);
        let depths = evaluate::stack_depths(&front.depth, (5 << 32) + *index as u64);
        let (mut psnr, mut ssim) = (0.0, 0.0);
        for d in &depths {
            let view = |field: &Array3<Complex32>| {
                let mut out = field.clone();
                for (colour, lambda) in display.wavelengths_m().iter().copied().enumerate() {
                    let z = display.z_of_depth(*d);
                    let plan = Propagator::new(
                        Size {
                            width: SIZE,
                            height: SIZE,
                        },
                        display.pitch_m(),
                        lambda,
                        z,
                        Padding::Double,
                    )
                    .unwrap();
                    let mut plane = out.index_axis_mut(Axis(0), colour);
                    plan.propagate(plane.as_slice_mut().unwrap(), &mut plan.scratch());
                }
                out.mapv(|v| v.norm())
            };
            let at = metrics::compare(view(&field).view(), view(&pair.hologram).view()).unwrap();
            psnr += at.psnr_overall / depths.len() as f64;
            ssim += at.ssim_overall / depths.len() as f64;
        }
        assert!(
            (figures.coherent.focal_psnr - psnr).abs() < 0.1,
            "{} {psnr}",
            figures.coherent.focal_psnr
        );
        assert!(
            (figures.coherent.focal_ssim - ssim).abs() < 5e-3,
            "{} {ssim}",
            figures.coherent.focal_ssim
        );
    }
    let mean = (rows[0].scenes[0].1.coherent.focal_psnr + rows[0].scenes[1].1.coherent.focal_psnr) / 2.0;
    assert!((rows[0].mean.coherent.focal_psnr - mean).abs() < 1e-12);
}

#[test]
fn the_truth_is_the_truth_and_what_is_visible_is_nearer_to_it_than_the_image() {
    let data = Data::new();
    let display = &data.manifest.display;
    let methods = [
        Method::layers(display, PLANES),
        Method::visible(display, PLANES),
        Method::rgb(display),
    ];
    let rows = data.evaluate(&methods, &[Shown::complex()]);
    let [layers, visible, rgb] = [0, 1, 2].map(|i| &rows[i].mean);
    assert_eq!(layers.coherent.amplitude_psnr, f64::INFINITY);
    assert!((layers.coherent.focal_ssim - 1.0).abs() < 1e-9);
    assert!(
        visible.coherent.amplitude_psnr > rgb.coherent.amplitude_psnr,
        "{visible:?} {rgb:?}"
    );
    assert!(visible.coherent.focal_ssim > rgb.coherent.focal_ssim);
}

/// The true wave has the true colours. A tenth less light of all lasers changes them a little, a quarter less of green
/// much more.
#[test]
fn colours_are_judged_by_light() {
    let data = Data::new();
    let display = &data.manifest.display;
    let dimmed = |name: &str, factors: [f32; 3]| {
        Method::new(name, move |ldi| {
            let mut field = sm_lbm::hologram(ldi, display, PLANES, &|_, _| {})?;
            for (mut plane, factor) in field.outer_iter_mut().zip(factors) {
                plane.mapv_inplace(|v| v * factor);
            }
            Ok(field)
        })
    };
    let methods = [
        dimmed("true", [1.0; 3]),
        dimmed("dim", [0.95; 3]),
        dimmed("tinted", [1.0, 0.85, 1.0]),
    ];
    let rows = data.evaluate(&methods, &[Shown::complex()]);
    let [same, dim, tinted] = [0, 1, 2].map(|i| rows[i].mean.ciede2000);
    assert!(same < 1e-3, "{same}");
    // L* + 16 goes with the cube root of light and is 3.4 % less: 0.5 of L* in the dark, 3.9 in white.
    assert!((0.5..3.9).contains(&dim), "{dim}");
    assert!(tinted > 2.0 * dim, "{tinted} {dim}");
}

/// Tests that the holograms of a data set that corrects an aberration are all viewed through it (Fig. 8).
#[test]
#[ignore = "slow: 10 seconds of a core"]
fn holograms_that_correct_an_aberration_are_judged_through_it() {
    let cylinder = Aberration::new([[2.0, 4.0, 0.0, 0.0, 0.0]; 3]).unwrap();
    let all = Aberrations::new(vec![(0.0, cylinder)]).unwrap();
    let plain = Data::new();
    let corrected = Data::correcting(Some(&AberrationFile::Uniform(all)));
    let psnr = |data: &Data, method: Method<'_>| {
        data.evaluate(&[method], &[Shown::complex()])[0]
            .mean
            .coherent
            .amplitude_psnr
    };
    let display = Display::default();
    let layers = || Method::layers(&display, PLANES);
    assert!(psnr(&plain, layers()) > 100.0);
    // Holograms without a correction are blurred.
    let blurred = psnr(&corrected, layers());
    assert!(blurred < 25.0, "{blurred}");
    // The corrected holograms look the same through the cylinder as the others without it, except for light beyond the
    // border.
    let z_m = [0.0, 1e-3];
    let see = |data: &Data| {
        let pair = dataset::read_pair(&data.manifest, data.path(), 78).unwrap();
        let viewer = Viewer::new(&data.manifest).unwrap();
        let complex = Shown::complex();
        viewer.views(None, &pair.hologram, &complex, &z_m).unwrap().views
    };
    let inner = ndarray::s![.., 12..SIZE - 12, 12..SIZE - 12];
    for (there, here) in see(&corrected).iter().zip(&see(&plain)) {
        let figures = metrics::compare(there.slice(inner), here.slice(inner)).unwrap();
        assert!(
            figures.psnr_overall > blurred + 6.0,
            "{} {blurred}",
            figures.psnr_overall
        );
    }
}

#[test]
fn the_ceiling_is_above_every_encoder() {
    let data = Data::new();
    let display = data.manifest.display.clone();
    let plain = encoded(&display, "anti-alias", Encoding::ANTI_ALIAS);
    let lifted = Shown {
        name: "ceiling".into(),
        ceiling: 60,
        ..plain.clone()
    };
    let rows = data.evaluate(&[Method::layers(&data.manifest.display, PLANES)], &[plain, lifted]);
    let [plain, lifted] = [0, 1].map(|row: usize| rows[row].mean);
    assert!(
        lifted.coherent.amplitude_psnr > plain.coherent.amplitude_psnr + 1.0,
        "{plain:?} {lifted:?}"
    );
    assert!(
        lifted.coherent.focal_psnr > plain.coherent.focal_psnr,
        "{plain:?} {lifted:?}"
    );
}

/// At an offset the modulator's frame is too small for the light at its border. Away from the border it reproduces the
/// field.
#[test]
fn at_an_offset_a_margin_leaves_out_what_the_frame_cannot_show() {
    let data = Data::new();
    let display = data.manifest.display.clone().with_offset_m(2e-3).unwrap();
    let shown = [encoded(&display, "at 2 mm", Encoding::ANTI_ALIAS)];
    let methods = [Method::layers(&data.manifest.display, PLANES)];
    let psnr = |margin: usize| {
        let sample = Sample {
            scenes: vec![78, 79],
            seed: 5,
            sensors: Vec::new(),
            margin,
        };
        let rows = evaluate::evaluate(&data.manifest, data.path(), &sample, &methods, &shown, &|| {}).unwrap();
        rows[0].mean.coherent.amplitude_psnr
    };
    let (whole, inner) = (psnr(0), psnr(10));
    assert!(inner > whole + 0.5 && inner > 18.0, "{whole} {inner}");
}

/// A correction for the viewing aperture gives a better image than a correction for another aperture, and an off-axis
/// aperture gives a worse one.
#[test]
fn what_is_shown_depends_on_the_aperture() {
    let data = Data::new();
    let of = |made_for: f64, radius: f64, shift: f64| {
        let display = Display::from_toml(&format!("aperture_radius = {made_for:?}")).unwrap();
        let options = EncoderOptions {
            local_steps: 2,
            ..Encoding::ANTI_ALIAS.into()
        };
        Shown {
            name: format!("{made_for} {radius} {shift}"),
            levels: Some(((&display).into(), options)),
            ceiling: 0,
            through: Some(Opening { radius, shift }),
        }
    };
    let shown = [
        of(0.7, 0.7, 0.0),
        of(1.0, 0.7, 0.0),
        of(1.0, 1.0, 0.0),
        of(1.0, 1.0, 0.2),
    ];
    let rows = data.evaluate(&[Method::layers(&data.manifest.display, PLANES)], &shown);
    let psnr: Vec<f64> = rows.iter().map(|row| row.mean.coherent.amplitude_psnr).collect();
    assert!(psnr[0] > psnr[1] && psnr[2] > psnr[3], "{psnr:?}");
    assert!(rows[1].mean.coherent.light < rows[2].mean.coherent.light, "{rows:?}");
}

#[test]
fn each_sensors_depth_is_judged_after_the_true_depth() {
    let data = Data::new();
    let methods = [
        Method::visible(&data.manifest.display, PLANES),
        Method::rgb(&data.manifest.display),
    ];
    let sample = Sample {
        scenes: vec![78, 79],
        seed: 5,
        sensors: vec![Sensor::HalfBilinear, Sensor::CoarseNearest],
        margin: 0,
    };
    let shown = [Shown::complex()];
    let rows = evaluate::evaluate(&data.manifest, data.path(), &sample, &methods, &shown, &|| {}).unwrap();
    let of = |method: &str| -> Vec<&Row> { rows.iter().filter(|row| row.method == method).collect() };
    let sensors = [None, Some(Sensor::HalfBilinear), Some(Sensor::CoarseNearest)];
    for method in ["visible", "rgb"] {
        let found: Vec<_> = of(method).iter().map(|row| row.sensor).collect();
        assert_eq!(found, sensors);
    }
    let visible = of("visible");
    assert!(
        visible[0].mean.coherent.focal_psnr > visible[1].mean.coherent.focal_psnr + 0.5,
        "{visible:?}"
    );
    assert_eq!(visible[0].wrong_depth, 0.0);
    assert!(
        visible[1].wrong_depth > 0.01 && visible[1].wrong_depth < visible[2].wrong_depth,
        "{visible:?}"
    );
    // The image itself does not depend on depth.
    assert_eq!(of("rgb")[0].mean, of("rgb")[2].mean);
}

/// The automatic choice takes the network for depth with soft edges and the sweep for all other depth.
#[test]
fn the_automatic_choice_is_one_of_its_methods() {
    let data = Data::new();
    let display = &data.manifest.display;
    let network = networks::network("8", None).unwrap();
    let sweep = Sweep::for_display(display);
    let methods = [
        Method::auto(SIZE, display, sweep, network.clone()).unwrap(),
        Method::sweep(SIZE, display, sweep).unwrap(),
        Method::network("network", &network, SIZE, display).unwrap(),
    ];
    let rows = data.evaluate(&methods, &[Shown::complex()]);
    for (scene, (_, figures)) in rows[0].scenes.iter().enumerate() {
        assert!(
            [1, 2].iter().any(|&row: &usize| rows[row].scenes[scene].1 == *figures),
            "{rows:?}"
        );
    }
}

#[test]
fn encoded_fields_are_judged_as_their_files_look() {
    let data = Data::new();
    let display = &data.manifest.display;
    let shown = [
        encoded(display, "double", Encoding::DoublePhase),
        encoded(display, "anti-alias", Encoding::ANTI_ALIAS),
    ];
    let rows = data.evaluate(&[Method::layers(display, PLANES)], &shown);
    for (row, shown) in rows.iter().zip(&shown) {
        assert_eq!(row.shown, shown.name);
        let pair = dataset::read_pair(&data.manifest, data.path(), 78).unwrap();
        let (target, options) = shown.levels.as_ref().unwrap();
        let modulator = DisplayPlan::new(
            Size {
                width: SIZE,
                height: SIZE,
            },
            target,
            options,
        )
        .unwrap();
        let mut field = pair.hologram.clone();
        let mut levels = Array3::zeros((3, SIZE, SIZE));
        let modulation = modulator.modulate(
            None,
            field.as_slice_mut().unwrap(),
            LevelsMut::Bytes(levels.as_slice_mut().unwrap()),
            &mut modulator.scratch(),
        );
        let info = HologramInfo {
            calibrated: Vec::new(),
            srgb_of_light: None,
            display: display.clone(),
            encoder: Some(shown.name.clone()),
            scale: Some(modulation.scale),
            lut: None,
            levels_turns: None,
        };
        let view = Hologram::Levels(Levels::Bytes(levels), info)
            .views(&[0.0])
            .unwrap()
            .remove(0);
        let truth = pair.hologram.mapv(|v| v.norm());
        let direct = metrics::compare(view.view(), truth.view()).unwrap();
        let ours = row.scenes[0].1.coherent;
        assert!(ours.brightness > 0.8 && ours.brightness < 1.2, "{ours:?}");
        assert!(ours.light > 0.01 && ours.light < 0.9, "{ours:?}");
        // One is padded for the volume and the other is not, so the aperture's edge falls between different
        // frequencies.
        assert!(
            (ours.amplitude_psnr - direct.psnr_overall).abs() < 1.0,
            "{ours:?} {direct:?}"
        );
    }
}

#[test]
fn a_focal_stack_is_the_fullest_bins_and_random_others() {
    // Bin 2k of the first 40 bins holds 40 − k pixels, and the others hold none. Two pixels have no hit.
    let mut depths: Vec<f32> = (0..20)
        .flat_map(|k| std::iter::repeat_n((2 * k) as f32 / 200.0 + 0.001, 40 - k))
        .collect();
    depths.extend([f32::NAN; 2]);
    let depth = Array2::from_shape_vec((1, depths.len()), depths).unwrap();
    let stack = evaluate::stack_depths(&depth, 1);
    assert_eq!(stack.len(), 20);
    let frequent: Vec<f64> = (0..15).map(|k| (2.0 * f64::from(k) + 0.5) / 200.0).collect();
    assert_eq!(stack[..15], frequent);
    let mut sorted = stack.clone();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    assert_eq!(sorted.len(), 20, "no depth comes twice");
    assert!(stack[15..].iter().all(|d| (0.0..1.0).contains(d)));
    assert_eq!(stack, evaluate::stack_depths(&depth, 1));
    assert_ne!(stack, evaluate::stack_depths(&depth, 2));
}

#[test]
fn networks_are_judged_and_pre_filters_or_other_displays_refused() {
    let data = Data::new();
    let network = networks::network("8", Some(Precision::Float32)).unwrap();
    let layers = concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/unbundled/ldi3-15.onnx");
    let layers = networks::network(layers, None).unwrap();
    let judged = [("8", &network), ("layers", &layers)]
        .map(|(name, n)| Method::network(name, n, SIZE, &data.manifest.display).unwrap());
    let [flat, layers] = judged;
    let rows = data.evaluate(
        &[flat, layers, Method::rgb(&data.manifest.display)],
        &[Shown::complex()],
    );
    let psnr: Vec<f64> = rows.iter().map(|row| row.mean.coherent.amplitude_psnr).collect();
    assert!(psnr[0] > psnr[2] && psnr[1] > psnr[2] + 3.0, "{psnr:?}");
    let deep = Display::from_toml("volume_depth_mm = 12").unwrap();
    let refused = Method::network("8", &network, SIZE, &deep).err().unwrap();
    assert!(refused.to_string().contains("2.00 times the range"), "{refused}");
}

#[test]
fn the_command_prints_figures_and_draws_the_worst() {
    let data = Data::new();
    let pictures = data.path().join("pictures");
    let output = data.command(&[
        "--method",
        "rgb,visible",
        "--encoder",
        "band-limit",
        "--json",
        "--pictures",
        pictures.to_str().unwrap(),
        "--worst",
        "1",
    ]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let result: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let rows = result["rows"].as_array().unwrap();
    let names: Vec<_> = rows
        .iter()
        .map(|r| (r["method"].as_str().unwrap(), r["shown"].as_str().unwrap()))
        .collect();
    assert_eq!(
        names,
        [
            ("rgb", "complex"),
            ("rgb", "band-limit, dark 0.4, steps 1"),
            ("visible", "complex"),
            ("visible", "band-limit, dark 0.4, steps 1")
        ]
    );
    let worst = |i: usize| {
        let scenes = rows[i]["scenes"].as_array().unwrap();
        let psnr = |s: &serde_json::Value| s[1]["amplitude_psnr"].as_f64().unwrap();
        let worst = scenes.iter().min_by(|a, b| psnr(a).total_cmp(&psnr(b))).unwrap();
        worst[0].as_u64().unwrap()
    };
    for (i, (method, shown)) in names.iter().enumerate() {
        let shown = shown.replace(", ", "-").replace(' ', "-");
        let name = format!("{method}-{shown}-worst-1-scene-{:06}.png", worst(i));
        let picture = picture::read_rgb(&pictures.join(name)).unwrap();
        assert_eq!(picture.dim(), (3, SIZE, 4 * SIZE + 12));
    }

    let refused = |arguments: &[&str], code: i32, word: &str| {
        let output = data.command(arguments);
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{errors}");
        assert!(errors.contains(word), "{errors}");
    };
    refused(&[], 2, "--method");
    refused(&["--method", "rgb", "--split", "validation"], 1, "pair_00007");
    refused(&["--network", "nowhere.onnx"], 1, "nowhere.onnx");
    refused(&["--method", "rgb", "--margin", "24"], 1, "leaves nothing");
    refused(&["--method", "rgb", "--sensor", "eye"], 2, "eye");
    refused(&["--pair", "--offset-mm", "3"], 1, "3 mm");
    refused(
        &["--method", "rgb", "--taps", "9"],
        2,
        "--taps goes with --method sweep or auto",
    );
    refused(
        &["--method", "rgb", "--planes", "9"],
        2,
        "--planes goes with a --method of waves",
    );
    refused(
        &["--method", "rgb", "--precision", "f32"],
        2,
        "--precision goes with a bundled --network, --pair or --method auto",
    );
    refused(&["--method", "rgb", "--dark-threshold", "0"], 2, "--encoder");
}

/// Tests that a pre-filter replaces all encoders, once.
#[test]
fn a_pairs_rows_are_deep() {
    let data = Data::new();
    let encoders = [
        "--encoder",
        "double,anti-alias,band-limit",
        "--dark-threshold",
        "0,0.4",
        "--scenes",
        "1",
        "--json",
    ];
    let output = data.command(&[&["--pair", "--method", "rgb"], &encoders[..]].concat());
    let result: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let of = |method: &str| -> Vec<String> {
        let rows = result["rows"]
            .as_array()
            .unwrap()
            .iter()
            .filter(|row| row["method"] == method);
        rows.map(|row| row["shown"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(
        of("pair"),
        ["complex", "deep, dark 0, steps 1", "deep, dark 0.4, steps 1"]
    );
    assert_eq!(of("rgb").len(), 7);
}
