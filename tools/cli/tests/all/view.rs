//! Tests `phasefront view` and `phasefront judge`: the size limits of the pages, and the table. `pages` tests
//! the pages in a browser.
use crate::folder;
use crate::ldi;
use phasefront::Size;

use folder::Folder;
use phasefront_cli::viewer;
use serde_json::Value;

/// Creates a folder with a frame of 96×64 pixels that has something near on the left.
fn with_frame() -> Folder {
    let folder = Folder::new();
    let near = |x: u32, y: u32| (12..40).contains(&x) && (16..48).contains(&y);
    let rgb = image::RgbImage::from_fn(96, 64, |x, y| {
        if near(x, y) {
            image::Rgb([230, (x * 9) as u8, 40])
        } else {
            image::Rgb([30, 90, ((x / 6 + y / 6) % 2 * 180) as u8])
        }
    });
    rgb.save(folder.path("rgb.png")).unwrap();
    let depth = image::GrayImage::from_fn(96, 64, |x, y| image::Luma([if near(x, y) { 20 } else { 230 }]));
    depth.save(folder.path("depth.png")).unwrap();
    folder
}

const FRAME: [&str; 4] = ["--rgb", "rgb.png", "--depth", "depth.png"];

#[test]
fn an_image_becomes_a_page_of_its_hologram_beside_its_field() {
    let folder = with_frame();
    let call = [&["view"], &FRAME[..], &["--views", "7", "--json", "-o", "v.html"]].concat();
    let said: Value = serde_json::from_str(&folder.succeeds(&call)).unwrap();
    assert_eq!((said["views"].as_u64(), said["scenes"].as_u64()), (Some(14), Some(1)));
    let page = std::fs::read_to_string(folder.path("v.html")).unwrap();
    assert_eq!(said["bytes"].as_u64().unwrap(), page.len() as u64);
    // The page loads nothing from the network.
    assert!(!page.contains("http://") && !page.contains("https://") && !page.contains("src=\"/"));
    let scene = viewer::read(&folder.path("v.html")).unwrap().remove(0);
    assert_eq!(
        (scene.shown.len(), scene.field.len(), scene.title.as_str()),
        (7, 7, "rgb")
    );
    assert!(scene.z_mm.windows(2).all(|pair| pair[0] > pair[1]) && (scene.z_mm[0] - 3.0).abs() < 1e-9);
    assert!(scene.depth.known && scene.phase.is_some());
    let shown = scene
        .figures
        .iter()
        .find(|(name, _)| name.starts_with("Shown against"))
        .unwrap();
    assert!(shown.1.contains("dB"), "{shown:?}");
}

#[test]
fn pages_and_holograms_are_joined_and_keep_their_budget() {
    let folder = with_frame();
    folder.succeeds(&[&["hologram"], &FRAME[..], &["-o", "h.png", "--complex", "f.npy"]].concat());
    folder.succeeds(&["view", "h.png", "--title", "one", "-o", "one.html"]);
    folder.succeeds(&["view", "one.html", "f.npy", "h.png", "--views", "3", "-o", "all.html"]);
    let scenes = viewer::read(&folder.path("all.html")).unwrap();
    let titles: Vec<_> = scenes.iter().map(|scene| scene.title.as_str()).collect();
    assert_eq!(titles, ["one", "f", "h"]);
    assert!(scenes[1].phase.is_none() && scenes[2].shown.len() == 3 && !scenes[2].depth.known);
    folder.succeeds(&["view", "h.png", "--views", "60", "--max-mb", "0.5", "-o", "small.html"]);
    assert!(std::fs::metadata(folder.path("small.html")).unwrap().len() < 500_000);
    for (arguments, code, word) in [
        (vec!["view", "rgb.png", "-o", "n.html"], 1, "rgb.png"),
        (vec!["view", "h.png", "-o", "n.png"], 1, ".html"),
        (vec!["view", "h.png", "--max-mb", "0.1", "-o", "n.html"], 2, "--max-mb"),
        (vec!["view", "-o", "n.html"], 2, "--rgb"),
        (vec!["view", ".", "-o", "n.html"], 1, "phase_000000.png"),
        (vec!["view", "missing.html", "-o", "n.html"], 1, "missing.html"),
    ] {
        let errors = folder.fails(&arguments, code);
        assert!(
            errors.lines().count() == 1 && errors.contains(word),
            "{arguments:?}: {errors}"
        );
        assert!(!folder.path("n.html").exists());
    }
}

#[test]
fn a_page_takes_nothing_of_another_but_its_data() {
    let folder = with_frame();
    folder.succeeds(
        &[
            &["hologram", "--method", "sweep", "--planes", "4"],
            &FRAME[..],
            &["-o", "h.png"],
        ]
        .concat(),
    );
    let title = "</script><script>alert(1)</script>";
    folder.succeeds(&["view", "h.png", "--views", "2", "--title", title, "-o", "one.html"]);
    let one = std::fs::read_to_string(folder.path("one.html")).unwrap();
    assert!(one.contains("default-src 'none'; img-src data:;") && !one.contains("alert(1)</script>"));
    // Everything around the data comes from the program itself.
    let visited = one.replace("<main>", "<img src=\"https://example.org/a.png\"><main>");
    std::fs::write(folder.path("visited.html"), visited).unwrap();
    folder.succeeds(&["view", "visited.html", "h.png", "-o", "joined.html"]);
    let joined = std::fs::read_to_string(folder.path("joined.html")).unwrap();
    assert!(!joined.contains("example.org") && joined.matches("Content-Security-Policy").count() == 1);
    let (before, rest) = one.split_once("data:image/webp;base64,").unwrap();
    let (data, after) = rest.split_once('"').unwrap();
    let picture = |url: &str| format!("{before}{url}\"{after}");
    let data = format!("data:image/webp;base64,{data}");
    assert_eq!(picture(&data), one);
    for (name, page, word) in [
        (
            "remote",
            picture("https://example.org/a.webp"),
            "https://example.org/a.webp",
        ),
        ("svg", picture("data:image/svg+xml;base64,PHN2Zy8+"), "svg"),
        ("text", picture("data:image/webp;base64,\\\"><b>"), "no picture"),
        ("fewer", one.replacen(&format!("\"{data}\","), "", 1), "1 views"),
        ("depth", one.replacen("\"slices\":\"", "\"slices\":\"////", 1), "depth"),
        (
            "empty",
            "<script type=\"application/json\" id=\"scenes\">[]</script>".into(),
            "no hologram",
        ),
    ] {
        std::fs::write(folder.path("bad.html"), page).unwrap();
        let errors = folder.fails(&["view", "bad.html", "h.png", "-o", "n.html"], 1);
        assert!(
            errors.lines().count() == 1 && errors.contains("bad.html"),
            "{name}: {errors}"
        );
        assert!(
            errors.contains(word) && !folder.path("n.html").exists(),
            "{name}: {errors}"
        );
    }
    let none = viewer::write(&folder.path("n.html"), &[]).unwrap_err().to_string();
    assert!(none.contains("a page needs a hologram") && !folder.path("n.html").exists());
    let small = [
        "view", "one.html", "h.png", "--views", "2", "--max-mb", "0.9", "-o", "n.html",
    ];
    folder.succeeds(&small);
    let alone = ["view", "one.html", "--views", "2", "-o", "n.html"];
    assert!(folder.fails(&alone, 2).contains("pages keep their views"));
}

#[test]
fn ways_are_judged_by_the_best_wave_at_hand() {
    let folder = with_frame();
    let judged = |more: &[&str]| -> Value {
        let call = [&["judge", "--json", "--planes", "24", "--margin", "4"], more].concat();
        serde_json::from_str(&folder.succeeds(&call)).unwrap()
    };
    // What the steps bring was measured on amplitudes.
    let said = judged(&[&FRAME[..], &["--rgb-encoding", "amplitude", "-o", "j.html"]].concat());
    assert!(said["truth"].as_str().unwrap().contains("there is no truth"), "{said}");
    let rows = said["rows"].as_array().unwrap();
    // Sweep and network with three corrections each, and the pair.
    assert_eq!(rows.len(), 7);
    let psnr = |row: &Value| row["psnr_db"].as_f64().unwrap();
    for of_method in rows[..6].chunks(3) {
        assert!(
            psnr(&of_method[1]) > psnr(&of_method[0]) + 0.5,
            "a step brings something: {said}"
        );
        assert!(
            psnr(&of_method[2]) > psnr(&of_method[1]),
            "and steps for a still more: {said}"
        );
    }
    assert!(rows.iter().all(|row| row["wave_ms"].as_f64().unwrap() > 0.0));
    let scenes = viewer::read(&folder.path("j.html")).unwrap();
    assert_eq!(scenes.len(), 9);
    assert_eq!(
        (scenes[1].title.as_str(), scenes[1].shown.len()),
        ("Judged by what incoherent light shows", 6)
    );
    ldi::write(&folder.path("ldi"), 5, Size { width: 64, height: 48 }, 2);
    let said = judged(&["--ldi", "ldi", "--method", "sweep", "--encoder", "double,band-limit"]);
    assert!(
        said["truth"].as_str().unwrap().contains("2 layers: the truth"),
        "{said}"
    );
    assert_eq!(said["rows"].as_array().unwrap().len(), 6);
    let table = folder.succeeds(&[&["judge", "--method", "sweep", "--planes", "8"], &FRAME[..]].concat());
    assert!(table.contains("PSNR dB") && table.contains("anti-alias, dark 0.4") && table.contains("Judged by"));
    assert!(folder.fails(&["judge"], 2).contains("--rgb"));
}
