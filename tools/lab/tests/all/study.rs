//! Tests the studies of layers and planes: their comparisons, and the files that the command writes.
use ndarray::Array3;
use num_complex::Complex32;
use phasefront::Size;
use phasefront::{Display, Method, RgbdFrame, Sweep};
use phasefront_core::method::sweep::SweepPlan;
use phasefront_core::optics::metrics;
use phasefront_exact::{sm_lbm, truth};
use phasefront_io::ldi::Ldi;
use phasefront_io::picture::plot::{self, Panel};
use phasefront_lab::scene;
use phasefront_lab::sensor::Sensor;
use phasefront_lab::study::flicker::{self, ALONE, BOTH, Standing};
use phasefront_lab::study::{self, Scenes, slopes, sweep_parts};
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};

fn scenes(size: usize) -> Scenes {
    Scenes {
        scenes: 2,
        size,
        seed: 11,
        display: Display::default(),
    }
}

fn ldi(seed: u64, size: usize, layers: usize) -> Ldi {
    let scene = scene::random_scene(
        seed,
        Size {
            width: size,
            height: size,
        },
    );
    scene::render_ldi_reference(
        &scene,
        Size {
            width: size,
            height: size,
        },
        layers,
    )
    .unwrap()
    .quantized()
}

#[test]
fn layers_are_compared_with_ten() {
    let work = AtomicUsize::new(0);
    let count = |planes: usize| {
        work.fetch_add(planes, Ordering::Relaxed);
    };
    let rows = study::layers(&scenes(40), 12, &count).unwrap();
    assert_eq!(work.into_inner(), study::layers_work(&scenes(40), 12));
    let values: Vec<usize> = rows.iter().map(|row| row.value).collect();
    assert_eq!(values, (1..=9).collect::<Vec<_>>());
    let amplitude = |ldi: &Ldi| {
        let hologram = sm_lbm::hologram(ldi, &Display::default(), 12, &|_, _| {}).unwrap();
        hologram.mapv(|v| v.norm())
    };
    // This LDI is rendered with two layers. The study cuts two layers from an LDI of ten.
    let direct: Vec<f64> = [11, 12]
        .map(|seed| {
            let (two, ten) = (amplitude(&ldi(seed, 40, 2)), amplitude(&ldi(seed, 40, 10)));
            metrics::compare(two.view(), ten.view()).unwrap().ssim_overall
        })
        .to_vec();
    assert_eq!(rows[1].ssim_of_scenes, direct);
    assert!((rows[1].ssim - (direct[0] + direct[1]) / 2.0).abs() < 1e-12);
    assert!(rows[8].ssim >= rows[3].ssim && rows[3].ssim > rows[0].ssim, "{rows:?}");
}

#[test]
fn video_sessions_flicker_less_with_sensors_than_single_frames() {
    let display = Display::default().with_size(Size { width: 96, height: 96 }).unwrap();
    let method = Method::Sweep(Sweep::for_display(&display));
    for sensor in [Sensor::Noise, Sensor::Lidar, Sensor::Kinect] {
        let study = |frames, settings: &[_]| {
            let standing = Standing::read_by(sensor, &ldi(3, 96, 1), 5, frames);
            flicker::study(&standing, settings, &display, &method, &|| {})
        };
        let rows = study(6, &[ALONE, BOTH]).unwrap();
        let [alone, both] = &rows[..] else { panic!("{rows:?}") };
        assert!(both.pixel < 0.9 * alone.pixel, "{sensor:?}: {rows:?}");
        assert!(both.brightness < alone.brightness, "{sensor:?}: {rows:?}");
        assert!(study(1, &[ALONE]).unwrap_err().to_string().contains("two frames"));
    }
}

#[test]
fn planes_are_compared_with_the_finest() {
    let work = AtomicUsize::new(0);
    let count = |planes: usize| {
        work.fetch_add(planes, Ordering::Relaxed);
    };
    let rows = study::planes(&scenes(40), 5, 300, &count).unwrap();
    assert_eq!(work.into_inner(), study::planes_work(&scenes(40), 300));
    assert_eq!(rows.iter().map(|row| row.value).collect::<Vec<_>>(), [32, 128]);
    assert!(rows[1].ssim > rows[0].ssim && rows[1].psnr > rows[0].psnr, "{rows:?}");
    let message = study::planes(&scenes(40), 5, 32, &|_| {}).unwrap_err().to_string();
    assert!(message.contains("over 32"), "{message}");
    let none = Scenes {
        scenes: 0,
        ..scenes(40)
    };
    assert!(study::layers(&none, 12, &|_| {}).is_err());
}

/// Runs `phasefront-lab study` on one scene of 40 planes and reads NAME.json. The folder also holds the plot.
fn run(what: &str, size: &str, folder: &Path) -> serde_json::Value {
    let output = Command::new(env!("CARGO_BIN_EXE_phasefront-lab"))
        .args(["study", what, "--scenes", "1", "--planes", "40"])
        .args(["--size", size, "-o"])
        .arg(folder)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = std::fs::read_to_string(folder.join(format!("{what}.json"))).unwrap();
    serde_json::from_str(&text).unwrap()
}

#[test]
fn the_command_writes_figures_and_a_plot() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    for what in ["layers", "planes"] {
        let result = run(what, "24", &out);
        let rows = result["rows"].as_array().unwrap();
        assert_eq!(rows.len(), if what == "layers" { 9 } else { 1 });
        assert_eq!(result["finest"], if what == "layers" { 10 } else { 40 });
        let svg = std::fs::read_to_string(out.join(format!("{what}.svg"))).unwrap();
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
        let finite = rows.iter().filter(|row| row["psnr"].is_f64()).count();
        assert_eq!(svg.matches("<circle").count(), rows.len() + finite);
    }
}

#[test]
fn the_command_studies_the_sweep() {
    let folder = tempfile::tempdir().unwrap();
    // In smaller scenes a sensor's depth would consist only of holes.
    let result = run("sweep", "64", folder.path());
    let rows = result["rows"].as_array().unwrap();
    let count = |part: &str| rows.iter().filter(|row| row["part"] == part).count();
    let svg = std::fs::read_to_string(folder.path().join("sweep.svg")).unwrap();
    // The default sweep is a point of all four curves, and the planes have two curves.
    let points = 4 + 2 * count("planes") + count("taps") + count("hidden");
    assert_eq!(svg.matches("<circle").count(), points);
    let result = run("slopes", "48", folder.path());
    assert_eq!(result["rows"].as_array().unwrap().len(), 3 * slopes::SLOPES.len());
    assert!(folder.path().join("slopes.png").exists());
    let result = run("displays", "24", folder.path());
    let rows = result["rows"].as_array().unwrap();
    assert_eq!(rows.len(), sweep_parts::DISPLAYS.len());
    for row in rows {
        assert!(row["sweep"]["psnr"].as_f64().unwrap() > 15.0, "{row}");
    }
}

#[test]
fn what_cannot_be_plotted_is_refused_and_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("plot.svg");
    let panel = |points| Panel {
        title: "t",
        x: "x",
        y: "y",
        points,
    };
    for panels in [vec![], vec![panel(vec![])], vec![panel(vec![(1, f64::NAN)])]] {
        assert!(plot::write_svg(&path, &panels).is_err());
        assert!(!path.exists());
    }
    plot::write_svg(&path, &[panel(vec![(3, 1.0)])]).unwrap();
    assert!(path.exists());
}

#[test]
fn the_sweep_is_studied_beside_exact_waves() {
    let scenes = Scenes {
        scenes: 2,
        ..scenes(64)
    };
    let work = AtomicUsize::new(0);
    let done = || {
        work.fetch_add(1, Ordering::Relaxed);
    };
    let rows = sweep_parts::ablation(&scenes, 200, &done).unwrap();
    assert_eq!(work.into_inner(), sweep_parts::ablation_work(&scenes, 200));
    let of = |part: &str, value: usize| {
        let found = rows.iter().find(|r| r.part == part && r.value == value);
        found.unwrap_or_else(|| panic!("no {part} {value}: {rows:?}"))
    };
    let default = of("default", 30);
    // Merged steps and tiles change only the time.
    for same in [of("merge", 0), of("tile", 128)] {
        assert!((same.clean.psnr - default.clean.psnr).abs() < 0.02, "{same:?}");
        assert!(same.ns_per_pixel.unwrap() > 0.0);
    }
    assert!(default.clean.psnr > of("hidden", 0).clean.psnr + 0.5, "{rows:?}");
    assert!(default.clean.psnr > of("between", 0).clean.psnr + 0.5);
    assert!(default.noisy.psnr > of("between", 0).noisy.psnr + 1.0);
    assert!(of("planes", 48).clean.psnr > of("planes", 12).clean.psnr + 1.0);
    assert!(default.clean.psnr > default.refined.psnr, "{default:?}");
    assert!(of("exact", 2).clean.psnr > default.clean.psnr, "{rows:?}");

    // One row is recomputed by hand.
    let display = &scenes.display;
    let sweep = Sweep {
        hidden_layers: 0,
        ..Sweep::for_display(display)
    };
    let by_hand: f64 = [11, 12]
        .map(|seed| {
            let ldi = ldi(seed, 64, 5);
            let rgb = truth::visible_rgb(&ldi);
            let depth = ldi.layers[0].depth.mapv(|d| if d.is_nan() { 1.0 } else { d });
            let frame = RgbdFrame::new(rgb, depth).unwrap();
            let plan = SweepPlan::new(Size { width: 64, height: 64 }, display, sweep, 0.0).unwrap();
            let mut field = Array3::zeros((3, 64, 64));
            plan.field(&frame, field.as_slice_mut().unwrap(), &mut plan.scratch())
                .unwrap();
            let truth = sm_lbm::hologram(&ldi, display, 200, &|_, _| {}).unwrap();
            let [a, b] = [field, truth].map(|u| u.mapv(|u: Complex32| u.norm()));
            metrics::compare(a.view(), b.view()).unwrap().psnr_overall / 2.0
        })
        .iter()
        .sum();
    assert!((of("hidden", 0).clean.psnr - by_hand).abs() < 1e-6);
}

#[test]
fn slopes_have_no_stripes() {
    let display = Display::default();
    let work = AtomicUsize::new(0);
    let done = || {
        work.fetch_add(1, Ordering::Relaxed);
    };
    let study = slopes::study(96, 300, &display, &done).unwrap();
    assert_eq!(work.into_inner(), slopes::work(&display));
    for rows in study.rows.chunks(3) {
        let [moved, between, _] = rows else { panic!("{rows:?}") };
        let views = |row: &slopes::Row| [row.midpoint, row.near, row.far];
        for (moved, between) in views(moved).into_iter().zip(views(between)) {
            assert!(between.psnr > moved.psnr + 3.0, "{rows:?}");
        }
    }
    // Three panels in near focus and three in far focus beside each other, four slopes below each other.
    assert_eq!(study.picture.dim(), (3, 4 * 96 + 12, 6 * 96 + 20));
}
