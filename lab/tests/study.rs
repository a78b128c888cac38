//! The studies of layers and planes: what they compare, and what the command writes.
#![allow(clippy::unwrap_used)]

use phasefront::Display;
use phasefront_lab::ldi::Ldi;
use phasefront_lab::plot::{self, Panel};
use phasefront_lab::study::{self, Scenes};
use phasefront_lab::{metrics, scene, sm_lbm};
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
    let scene = scene::random_scene(seed, size, size);
    scene::render_ldi_reference(&scene, size, size, layers)
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
    // An LDI of two layers is rendered apart here, cut from one of ten there.
    let direct: Vec<f64> = [11, 12]
        .map(|seed| {
            let (two, ten) = (amplitude(&ldi(seed, 40, 2)), amplitude(&ldi(seed, 40, 10)));
            metrics::compare(two.view(), ten.view())
                .unwrap()
                .ssim_overall
        })
        .to_vec();
    assert_eq!(rows[1].ssim_of_scenes, direct);
    assert!((rows[1].ssim - (direct[0] + direct[1]) / 2.0).abs() < 1e-12);
    assert!(
        rows[8].ssim >= rows[3].ssim && rows[3].ssim > rows[0].ssim,
        "{rows:?}"
    );
}

#[test]
fn planes_are_compared_with_the_finest() {
    let work = AtomicUsize::new(0);
    let count = |planes: usize| {
        work.fetch_add(planes, Ordering::Relaxed);
    };
    let rows = study::planes(&scenes(40), 5, 300, &count).unwrap();
    assert_eq!(work.into_inner(), study::planes_work(&scenes(40), 300));
    assert_eq!(
        rows.iter().map(|row| row.value).collect::<Vec<_>>(),
        [32, 128]
    );
    assert!(
        rows[1].ssim > rows[0].ssim && rows[1].psnr > rows[0].psnr,
        "{rows:?}"
    );
    let message = study::planes(&scenes(40), 5, 32, &|_| {})
        .unwrap_err()
        .to_string();
    assert!(message.contains("over 32"), "{message}");
    let none = Scenes {
        scenes: 0,
        ..scenes(40)
    };
    assert!(study::layers(&none, 12, &|_| {}).is_err());
}

#[test]
fn the_command_writes_figures_and_a_plot() {
    let folder = tempfile::tempdir().unwrap();
    for what in ["layers", "planes"] {
        let output = Command::new(env!("CARGO_BIN_EXE_phasefront"))
            .args([
                "study", what, "--scenes", "1", "--size", "24", "--planes", "40", "-o",
            ])
            .arg(folder.path().join("out"))
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        let text = std::fs::read_to_string(folder.path().join(format!("out/{what}.json"))).unwrap();
        let result: serde_json::Value = serde_json::from_str(&text).unwrap();
        let rows = result["rows"].as_array().unwrap();
        assert_eq!(rows.len(), if what == "layers" { 9 } else { 1 });
        assert_eq!(result["finest"], if what == "layers" { 10 } else { 40 });
        let svg = std::fs::read_to_string(folder.path().join(format!("out/{what}.svg"))).unwrap();
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
        let finite = rows.iter().filter(|row| row["psnr"].is_f64()).count();
        assert_eq!(svg.matches("<circle").count(), rows.len() + finite);
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
    for panels in [
        vec![],
        vec![panel(vec![])],
        vec![panel(vec![(1, f64::NAN)])],
    ] {
        assert!(plot::write_svg(&path, &panels).is_err());
        assert!(!path.exists());
    }
    plot::write_svg(&path, &[panel(vec![(3, 1.0)])]).unwrap();
    assert!(path.exists());
}
