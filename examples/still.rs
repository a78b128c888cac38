//! Makes a hologram of a picture and its depth map:
//!
//! ```sh
//! cargo run --release --bin still -- samples/scene_rgb.jpg samples/scene_depth.png hologram.png
//! phasefront refocus hologram.png --z-mm 2 -o near.png
//! ```

mod hologram_png;

use phasefront::Size;
use phasefront::input::{CameraFrame, ColourFormat, ColourImage, DepthFormat, DepthImage, Plane};
use phasefront::{Display, ImageSession, SessionOptions};
use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [rgb, depth, hologram] = &arguments[..] else {
        return Err("three files are needed: still RGB DEPTH HOLOGRAM.png".into());
    };

    // A picture and the depth of each of its points: 0 is nearest, 255 farthest.
    let rgb = image::open(rgb)?.into_rgb8();
    let depth = image::open(depth)?.into_luma8();
    let size = |(width, height): (u32, u32)| (width as usize, height as usize);
    let ((width, height), (depth_width, depth_height)) = (size(rgb.dimensions()), size(depth.dimensions()));

    // A session plans its work once and then makes holograms of any number of frames. The display is the target: here
    // the paper's, with 8 µm pixels and three lasers, and as many pixels as the picture.
    let display = Display::default().with_size(Size { width, height })?;
    let session = ImageSession::new(SessionOptions::for_target(display))?;

    // A frame borrows the images' bytes. A plane takes the number of bytes from one row to the next and from one pixel
    // to the next.
    let colour = Plane::new(&rgb, 3 * width, 3);
    let colour = ColourImage::new(ColourFormat::Rgb, Size { width, height }, &[colour])?;
    let depth = Plane::new(&depth, depth_width, 1);
    let depth = DepthImage::new(
        DepthFormat::NormalizedU8,
        Size {
            width: depth_width,
            height: depth_height,
        },
        depth,
    )?;
    let made = session.process(&CameraFrame::new(0, colour, depth))?;

    println!("{width}×{height} pixels in {:.0?}", made.times().total());
    hologram_png::save(&made, Path::new(hologram))
}
