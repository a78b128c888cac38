//! Tests that a session tells the log, which every language forwards, of depth that an app enlarged.
use log::{LevelFilter, Log, Metadata, Record};
use phasefront::input::{CameraFrame, ColourFormat, ColourImage, DepthFormat, DepthImage, Plane};
use phasefront::{Display, Method, SessionOptions, Size, Sweep, VideoSession};
use std::sync::Mutex;

const SIZE: Size = Size {
    width: 160,
    height: 120,
};

/// The warnings of this process about depth.
struct Lines(Mutex<Vec<String>>);

static LINES: Lines = Lines(Mutex::new(Vec::new()));

impl Log for Lines {
    fn enabled(&self, _: &Metadata<'_>) -> bool {
        true
    }

    fn log(&self, record: &Record<'_>) {
        let line = record.args().to_string();
        if line.contains("the depth of frames") {
            self.0.lock().unwrap().push(format!("{}: {line}", record.level()));
        }
    }

    fn flush(&self) {}
}

/// Returns the depth of discs before a wall, where `place` tells which reading a pixel shows.
fn discs(place: impl Fn(usize) -> usize) -> Vec<u8> {
    let near = |x: usize, y: usize, i: usize| {
        let [dx, dy] = [x.abs_diff((29 + 37 * i) % 160), y.abs_diff((31 + 53 * i) % 120)];
        dx * dx + dy * dy < 30 + 40 * (i % 7)
    };
    let depth = |x: usize, y: usize| (0..24).filter(|i| near(x, y, *i)).map(|i| 9 * i as u8).max();
    (0..SIZE.pixels())
        .map(|i| depth(place(i % SIZE.width), place(i / SIZE.width)).unwrap_or(220))
        .collect()
}

#[test]
fn a_session_warns_once_of_depth_that_an_app_enlarged() {
    log::set_logger(&LINES).unwrap();
    log::set_max_level(LevelFilter::Warn);
    let display = Display::default().with_size(SIZE).unwrap();
    let sweep = Sweep::for_display(&display);
    let sharp = discs(|x| x);
    let enlarged = discs(|x| x / 4 * 4 + 2);
    let said = |depth: &[u8]| {
        let session = VideoSession::new(SessionOptions::new(display.clone(), Method::Sweep(sweep))).unwrap();
        for time in 1..4 {
            let readings = Plane::new(depth, SIZE.width, 1);
            let grey: Vec<u8> = depth.iter().flat_map(|d| [*d; 3]).collect();
            let rgb = Plane::new(&grey, 3 * SIZE.width, 3);
            let colours = ColourImage::new(ColourFormat::Rgb, SIZE, &[rgb]).unwrap();
            let depth = DepthImage::new(DepthFormat::NormalizedU8, SIZE, readings).unwrap();
            session.process(&CameraFrame::new(time, colours, depth)).unwrap();
        }
        std::mem::take(&mut *LINES.0.lock().unwrap())
    };
    assert_eq!(said(&sharp), Vec::<String>::new());
    let line =
        "WARN: the depth of frames was enlarged 4 times (nearest) from 40×30; it is conditioned as depth of that size";
    assert_eq!(said(&enlarged), [line]);
}
