//! The reference images that holograms are compared with, and the measures of the comparison. The references are the
//! surfaces of a layered depth image, or those that the sweep finds behind an RGB-D frame.

use ndarray::{Array2, Array3};
use phasefront::Size;
use phasefront::{Display, RgbdFrame};
use phasefront_core::method::sweep::hidden::{Hidden, NOTHING};
use phasefront_core::method::sweep::hidden_reach;
use phasefront_core::optics::metrics;
use phasefront_io::Result;
use phasefront_io::ldi::{Ldi, LdiLayer};
use serde::Serialize;

/// Returns the amplitudes of the front layer. Pixels without a surface are black.
pub fn visible_rgb(ldi: &Ldi) -> Array3<f32> {
    let front = &ldi.layers[0];
    Array3::from_shape_fn(front.rgb.dim(), |(c, y, x)| {
        if front.depth[(y, x)].is_nan() {
            0.0
        } else {
            front.rgb[(c, y, x)]
        }
    })
}

/// Returns the depth of the front layer, (H, W). Pixels without a surface are farthest.
pub fn visible_depth(ldi: &Ldi) -> Array2<f32> {
    ldi.layers[0].depth.mapv(|d| if d.is_nan() { 1.0 } else { d })
}

/// Returns the front layer as a frame for `display`. Pixels without a surface are black and farthest.
///
/// # Errors
/// Returns an error if the layer's values are not valid for a frame.
pub fn visible_frame(ldi: &Ldi, display: &Display) -> Result<RgbdFrame> {
    Ok(RgbdFrame::new(visible_rgb(ldi), visible_depth(ldi))?.for_display(display))
}

/// Returns `frame` with the hidden surfaces that the sweep finds.
///
/// # Errors
/// Never returns an error, because all layers have the same shape.
pub fn filled(frame: &RgbdFrame, display: &Display) -> Result<Ldi> {
    let Size { width, height } = frame.size();
    let size = height * width;
    let front = LdiLayer::from(frame);
    let hidden = Hidden::new(frame.size(), hidden_reach(display));
    let mut sources = vec![0; 2 * size];
    let values = front.depth.as_slice().expect("standard layout");
    hidden.find(values, &mut sources, &mut hidden.scratch());
    let behind = sources.chunks_exact(size).map(|sources| {
        let of = |y: usize, x: usize| match sources[y * width + x] {
            NOTHING => None,
            source => Some((source as usize / width, source as usize % width)),
        };
        LdiLayer {
            rgb: Array3::from_shape_fn((3, height, width), |(c, y, x)| {
                of(y, x).map_or(0.0, |(y, x)| front.rgb[(c, y, x)])
            }),
            depth: Array2::from_shape_fn((height, width), |(y, x)| {
                of(y, x).map_or(f32::NAN, |at| front.depth[at])
            }),
        }
    });
    let behind: Vec<_> = behind.collect();
    Ldi::new(std::iter::once(front).chain(behind).collect())
}

/// The measures of one scene's hologram against the truth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Figures {
    /// The PSNR of the midpoint's amplitude, in dB. Infinite if it equals the truth.
    pub amplitude_psnr: f64,
    /// The SSIM of the midpoint's amplitude.
    pub amplitude_ssim: f64,
    /// The mean PSNR over the focal stack, in dB.
    pub focal_psnr: f64,
    /// The mean SSIM over the focal stack.
    pub focal_ssim: f64,
    /// The mean amplitude at the midpoint divided by that of the truth.
    pub brightness: f64,
    /// The share of the modulator's light that passes the aperture. 1 for a complex field.
    pub light: f64,
}

/// Returns the z positions, in metres, at which a hologram for `display` is evaluated: the midpoint and a stack of four
/// depths.
pub fn judged_z_m(display: &Display) -> Vec<f64> {
    let depths = (0..4).map(|i| (f64::from(i) + 0.5) / 4.0);
    std::iter::once(0.0)
        .chain(depths.map(|depth| display.z_of_depth(depth)))
        .collect()
}

/// Compares `views` with `truth`, counting all light as displayed. Each view is (C, H, W); the midpoint comes first and
/// the focal stack follows. `margin` pixels at the border do not count.
///
/// # Errors
/// Returns an error if the views differ in shape.
pub fn judge(views: &[Array3<f32>], truth: &[Array3<f32>], margin: usize) -> Result<Figures> {
    let (_, height, width) = truth[0].dim();
    let inner = ndarray::s![.., margin..height - margin, margin..width - margin];
    let each = (views.iter().zip(truth))
        .map(|(view, truth)| metrics::compare(view.slice(inner), truth.slice(inner)))
        .collect::<phasefront::Result<Vec<_>>>()?;
    let (midpoint, stack) = (&each[0], &each[1..]);
    let mean = |figure: fn(&metrics::Comparison) -> f64| stack.iter().map(figure).sum::<f64>() / stack.len() as f64;
    Ok(Figures {
        amplitude_psnr: midpoint.psnr_overall,
        amplitude_ssim: midpoint.ssim_overall,
        focal_psnr: mean(|c| c.psnr_overall),
        focal_ssim: mean(|c| c.ssim_overall),
        brightness: f64::from(views[0].slice(inner).sum() / truth[0].slice(inner).sum()),
        light: 1.0,
    })
}
