//! Checks that sessions show pictures in their own colours: what goes in as sRGB comes out of a preview as sRGB.
use phasefront::input::{CameraFrame, ColourFormat, ColourImage, DepthFormat, DepthImage, Plane, RgbEncoding};
use phasefront::output::Layout;
use phasefront::session::Event;
use phasefront::{Display, ImageSession, LiveSession, Method, SessionOptions, Size, Sweep};
use std::sync::mpsc;

const SIDE: usize = 64;

fn square(side: usize) -> Size {
    Size {
        width: side,
        height: side,
    }
}

fn options(toml: &str) -> SessionOptions {
    let display = Display::from_toml(&format!(
        "width = {SIDE}\nheight = {SIDE}\nvolume_depth_mm = 0.5\n{toml}"
    ))
    .unwrap();
    let method = Method::Sweep(Sweep::for_display(&display));
    SessionOptions::new(display, method)
}

/// Calls `work` with a frame of one colour at the middle of the volume.
fn with_frame<R>(
    timestamp_ns: u64,
    rgb: [u8; 3],
    encoding: RgbEncoding,
    work: impl FnOnce(&CameraFrame<'_>) -> R,
) -> R {
    let (colour, depth) = (rgb.repeat(SIDE * SIDE), vec![128; SIDE * SIDE]);
    let plane = Plane::new(&colour, 3 * SIDE, 3);
    let image = ColourImage::new(ColourFormat::Rgb, square(SIDE), &[plane])
        .unwrap()
        .with_encoding(encoding);
    let depth = DepthImage::new(DepthFormat::NormalizedU8, square(SIDE), Plane::new(&depth, SIDE, 1)).unwrap();
    work(&CameraFrame::new(timestamp_ns, image, depth))
}

/// Returns the mean bytes of the preview's middle.
fn seen(hologram: &phasefront::Hologram) -> [f64; 3] {
    let side = SIDE / 2;
    let mut rgb = vec![0; 3 * side * side];
    hologram
        .write_preview(0.0, square(side), Layout::Rgb, &mut rgb, 3 * side)
        .unwrap();
    let inner = side / 4..3 * side / 4;
    let count = (inner.len() * inner.len()) as f64;
    [0, 1, 2].map(|c| {
        let bytes = inner.clone().flat_map(|y| inner.clone().map(move |x| (y, x)));
        bytes.map(|(y, x)| f64::from(rgb[3 * (y * side + x) + c])).sum::<f64>() / count
    })
}

fn assert_near(seen: [f64; 3], right: [u8; 3], what: &str) {
    let near = seen.iter().zip(right).all(|(a, b)| (a - f64::from(b)).abs() < 6.0);
    assert!(near, "{what}: {seen:?}, not {right:?}");
}

#[test]
fn previews_show_what_frames_say() {
    for toml in ["", "powers = [2, 1, 1]", "wavelengths_nm = [638, 532, 450]"] {
        let session = ImageSession::new(options(toml)).unwrap();
        for rgb in [[180, 120, 60], [90, 140, 200], [128, 128, 128], [230, 225, 220]] {
            // One session takes frames of any encoding in turn.
            for encoding in [RgbEncoding::Srgb, RgbEncoding::Amplitude] {
                let hologram = with_frame(1, rgb, encoding, |frame| session.process(frame).unwrap());
                assert_eq!(hologram.encoding(), encoding);
                assert_near(seen(&hologram), rgb, &format!("{toml} {encoding:?}"));
            }
        }
    }
}

/// Display P3's values of a colour of sRGB, from the matrices of both, show that colour.
#[test]
fn display_p3_is_the_same_colour_by_other_numbers() {
    let session = ImageSession::new(options("")).unwrap();
    let hologram = with_frame(1, [171, 123, 71], RgbEncoding::DisplayP3, |frame| {
        session.process(frame).unwrap()
    });
    assert_near(seen(&hologram), [180, 120, 60], "Display P3");
}

#[test]
fn one_laser_shows_the_luminance_of_the_light() {
    let session = ImageSession::new(options("wavelengths_nm = [532]")).unwrap();
    // The luminance of sRGB's [180, 120, 60] is that of grey 133.
    let hologram = with_frame(1, [180, 120, 60], RgbEncoding::Srgb, |frame| {
        session.process(frame).unwrap()
    });
    assert_near(seen(&hologram), [133; 3], "one laser");
}

/// A live session copies the frame with its encoding.
#[test]
fn live_sessions_keep_the_encoding() {
    let (sender, results) = mpsc::channel();
    let listener = move |event| {
        if let Event::Processed(hologram) = event {
            sender.send(hologram).unwrap();
        }
    };
    let session = LiveSession::new(options(""), listener).unwrap();
    with_frame(1, [90, 140, 200], RgbEncoding::DisplayP3, |frame| {
        session.submit(frame).unwrap()
    });
    assert_eq!(results.recv().unwrap().encoding(), RgbEncoding::DisplayP3);
}
