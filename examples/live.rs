//! Makes holograms of a camera's frames while it runs. A moving picture simulates the camera:
//!
//! ```sh
//! cargo run --release --bin live -- samples/scene_rgb.jpg samples/scene_depth.png last.png
//! ```

mod hologram_png;

use image::imageops::FilterType::Nearest;
use phasefront::Size;
use phasefront::input::{CameraFrame, ColourFormat, ColourImage, DepthFormat, DepthImage, Plane};
use phasefront::session::Event;
use phasefront::{Display, LiveSession, SessionOptions};
use std::error::Error;
use std::path::Path;
use std::sync::mpsc;
use std::time::Duration;

const WIDTH: usize = 640;
const HEIGHT: usize = 360;
const RATE_HZ: u64 = 15;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [rgb, depth, last] = &arguments[..] else {
        return Err("three files are needed: live RGB DEPTH LAST.png".into());
    };
    let small =
        |path| Ok::<_, image::ImageError>(image::open(path)?.resize_exact(WIDTH as u32, HEIGHT as u32, Nearest));
    let (mut rgb, mut depth) = (small(rgb)?.into_rgb8(), small(depth)?.into_luma8());

    // The session makes holograms on its own thread and reports the outcome of each frame to its listener. The listener
    // only forwards holograms, because no frame is processed while it is busy.
    let (sender, holograms) = mpsc::channel();
    let display = Display::default().with_size(Size {
        width: WIDTH,
        height: HEIGHT,
    })?;
    let mut options = SessionOptions::for_target(display);
    options.target_rate_hz = Some(RATE_HZ as f64);
    let session = LiveSession::new(options, move |event| match event {
        Event::Processed(hologram) => drop(sender.send(hologram)),
        other => println!("{other:?}"),
    })?;
    session.warm_up()?;

    for frame in 0..2 * RATE_HZ {
        // The camera's next picture: all rows move to the left.
        rgb.chunks_exact_mut(3 * WIDTH).for_each(|row| row.rotate_left(3 * 4));
        depth.chunks_exact_mut(WIDTH).for_each(|row| row.rotate_left(4));
        let colour = ColourImage::new(
            ColourFormat::Rgb,
            Size {
                width: WIDTH,
                height: HEIGHT,
            },
            &[Plane::new(&rgb, 3 * WIDTH, 3)],
        )?;
        let depth = DepthImage::new(
            DepthFormat::NormalizedU8,
            Size {
                width: WIDTH,
                height: HEIGHT,
            },
            Plane::new(&depth, WIDTH, 1),
        )?;
        // This copies the frame and returns at once. If the session cannot keep up, it drops the older of two frames.
        session.submit(&CameraFrame::new(frame * 1_000_000_000 / RATE_HZ, colour, depth))?;
        std::thread::sleep(Duration::from_millis(1000 / RATE_HZ));
        for hologram in holograms.try_iter() {
            // An app sends `hologram.levels()` to its modulator here.
            println!(
                "{} ms: {:.0?}",
                hologram.timestamp_ns().unwrap_or_default() / 1_000_000,
                hologram.times().total()
            );
            hologram_png::save(&hologram, Path::new(last))?;
        }
    }
    session.close();
    println!("{:#?}", session.statistics());
    Ok(())
}
