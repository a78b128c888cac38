//! Tests calls that people make by mistake: each is refused in one line that says what is right.
use crate::folder;

use folder::{Folder, SMALL_HOLOGRAM};
use image::imageops::{self, FilterType};
use phasefront_io::hologram;
use std::fs;
use std::path::Path;

fn with_hologram() -> Folder {
    let folder = Folder::new().with_frame();
    folder.succeeds(&[&SMALL_HOLOGRAM[..], &["-o", "h.png"]].concat());
    folder
}

/// Writes `picture` with the text chunks of the hologram at `from`, as viewers and editors keep them.
fn with_chunks(from: &Path, to: &Path, picture: &image::RgbImage) {
    let reader = png::Decoder::new(std::io::BufReader::new(fs::File::open(from).unwrap()));
    let reader = reader.read_info().unwrap();
    let mut encoder = png::Encoder::new(fs::File::create(to).unwrap(), picture.width(), picture.height());
    encoder.set_color(png::ColorType::Rgb);
    for chunk in &reader.info().uncompressed_latin1_text {
        encoder
            .add_text_chunk(chunk.keyword.clone(), chunk.text.clone())
            .unwrap();
    }
    encoder
        .write_header()
        .unwrap()
        .write_image_data(picture.as_raw())
        .unwrap();
}

#[test]
fn a_hologram_that_another_program_changed_is_refused() {
    let folder = with_hologram();
    let (from, to) = (folder.path("h.png"), folder.path("changed.png"));
    let whole = image::open(&from).unwrap().into_rgb8();
    with_chunks(&from, &to, &whole);
    assert_eq!(
        hologram::read_hologram(&to).unwrap(),
        hologram::read_hologram(&from).unwrap()
    );
    let mut edited = whole.clone();
    edited.get_pixel_mut(5, 5).0[1] ^= 1;
    for (name, picture) in [
        ("resized", imageops::resize(&whole, 96, 64, FilterType::Triangle)),
        ("upside down", imageops::rotate180(&whole)),
        ("turned", imageops::rotate90(&whole)),
        ("mirrored", imageops::flip_horizontal(&whole)),
        ("cropped", imageops::crop_imm(&whole, 0, 0, 40, 32).to_image()),
        ("edited", edited),
    ] {
        with_chunks(&from, &to, &picture);
        for call in [
            &["refocus", "changed.png", "--z-mm", "0", "-o", "v.png"][..],
            &["view", "changed.png", "-o", "v.html"],
        ] {
            let errors = folder.fails(call, 1);
            assert!(
                errors.lines().count() == 1
                    && errors.contains("changed.png")
                    && errors.contains("resized, turned or edited"),
                "{name}: {errors}"
            );
        }
    }
}

#[test]
fn a_view_far_outside_the_volume_is_refused() {
    let folder = with_hologram();
    for z in ["1000", "-1000", "61", "1e9", "nan"] {
        let errors = folder.fails(&["refocus", "h.png", "--z-mm", z, "-o", "v.png"], 1);
        assert!(
            errors.lines().count() == 1 && errors.contains("-3 mm to 3 mm"),
            "{errors}"
        );
    }
    assert!(!folder.path("v.png").exists());
    folder.succeeds(&["refocus", "h.png", "--z-mm", "20", "-o", "v.png"]);
}

#[test]
fn a_folder_is_refused_where_one_picture_is_meant() {
    let squeezed = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let folder = Folder::new().with_frame();
    fs::create_dir(folder.path("pictures")).unwrap();
    for command in ["judge", "view", "multiplex"] {
        let output = if command == "view" { "v.html" } else { "out" };
        for pictures in [
            &["--rgb", "pictures", "--depth", "pictures"][..],
            &["--rgb", "rgb.png", "--depth", "pictures"],
            &["--photo", "pictures"],
        ] {
            let mut call = [&[command], pictures].concat();
            if command != "judge" {
                call.extend(["-o", output]);
            }
            let errors = folder.fails(&call, 1);
            assert!(
                errors.lines().count() == 1 && errors.contains("pictures: is a folder") && errors.contains("hologram"),
                "{call:?}: {errors}"
            );
        }
        let help = squeezed(&folder.succeeds(&[command, "--help"]));
        assert!(!help.contains("or a folder of them"), "{command}: {help}");
    }
    assert!(squeezed(&folder.succeeds(&["hologram", "--help"])).contains("or a folder of them"));
}

#[test]
fn a_picture_without_a_flag_is_refused_with_advice() {
    let folder = Folder::new().with_frame();
    for call in [
        &["hologram", "rgb.png", "-o", "h.png"][..],
        &["hologram", "photo.jpg", "-o", "h.png", "--method", "sweep"],
    ] {
        let errors = folder.fails(call, 1);
        assert!(
            errors.lines().count() == 1
                && errors.contains(call[1])
                && errors.contains("--photo")
                && errors.contains("--rgb"),
            "{errors}"
        );
    }
    assert!(!folder.succeeds(&["hologram", "--help"]).contains("[PICTURE]"));
}
