//! What a display can show at most, by its geometry.
//!
//! With the pitch p, the aperture's radius r, a wavelength λ and half of the panel's smaller side h:
//!
//! | limit | formula |
//! |---|---|
//! | finest detail, half a period | p/r |
//! | largest angle of light | θ = asin(λ·r/(2p)) |
//! | distance up to which the middle of the frame keeps the finest detail | h/tan θ, for the longest wave |
//! | detail in the middle, farther away | λ/(2·sin(atan(h/distance))) |
//! | the part of the frame that keeps the finest detail | each side minus 2·distance·tan θ |
//! | share of the light in the picture | mean(min(a, s)²)/s², a the amplitudes, s the scale |

use phasefront::{Display, Size};

/// The limits of a display whose picture lies about the modulator.
pub(crate) struct Limits {
    /// The finest detail that the aperture passes, in metres.
    pub(crate) detail_m: f64,
    /// The largest angle of each laser's light, in radians.
    pub(crate) angle_rad: Vec<f64>,
    /// The distance from the modulator up to which the middle of the frame has the finest detail, in metres. Farther
    /// away, light of the largest angle comes from beyond the panel's edge.
    pub(crate) reach_m: f64,
    size_m: [f64; 2],
    longest_m: f64,
    offset_m: f64,
}

impl Limits {
    pub(crate) fn of(display: &Display) -> Self {
        let detail_m = display.pitch_m() / display.aperture_radius();
        let angle = |wavelength_m: &f64| (wavelength_m / (2.0 * detail_m)).min(1.0).asin();
        let Size { width, height } = display.size();
        let size_m = [width, height].map(|side| side as f64 * display.pitch_m());
        let longest_m = display.longest_wavelength_m();
        Limits {
            detail_m,
            angle_rad: display.wavelengths_m().iter().map(angle).collect(),
            reach_m: size_m[0].min(size_m[1]) / 2.0 / angle(&longest_m).tan(),
            size_m,
            longest_m,
            offset_m: display.offset_m(),
        }
    }

    /// Returns the least and the largest z at which the middle of the frame has the finest detail, in metres.
    pub(crate) fn range_m(&self) -> [f64; 2] {
        [self.offset_m - self.reach_m, self.offset_m + self.reach_m]
    }

    /// Returns the finest detail in the middle of the frame at `z_m`, in metres.
    pub(crate) fn detail_at_m(&self, z_m: f64) -> f64 {
        let half_m = self.size_m[0].min(self.size_m[1]) / 2.0;
        let largest = half_m.atan2((z_m - self.offset_m).abs());
        self.detail_m.max(self.longest_m / (2.0 * largest.sin()))
    }

    /// Returns the sides of the part of the frame that has the finest detail at `z_m`, in metres; 0 if there is none.
    pub(crate) fn sharp_part_m(&self, z_m: f64) -> [f64; 2] {
        let widest = self.angle_rad.iter().copied().fold(0.0, f64::max);
        let lost_m = 2.0 * (z_m - self.offset_m).abs() * widest.tan();
        self.size_m.map(|side_m| (side_m - lost_m).max(0.0))
    }

    /// Returns the z of the end of the volume of `display` that is farther from the modulator, in metres.
    pub(crate) fn farthest_m(&self, display: &Display) -> f64 {
        let half_m = display.volume_depth_m() / 2.0;
        if self.offset_m > 0.0 { -half_m } else { half_m }
    }

    /// Returns what is lost at `z_m`, if that is beyond the reach.
    pub(crate) fn lost_at(&self, z_m: f64) -> Option<String> {
        let [least_mm, most_mm] = self.range_m().map(|z_m| z_m * 1e3);
        let distance_m = (z_m - self.offset_m).abs();
        (distance_m > self.reach_m).then(|| {
            format!(
                "details below {:.0} um are lost there even in the middle of the frame, and the display keeps those of {:.1} um from z = {least_mm:.1} to {most_mm:.1} mm; a wider modulator, or one nearer to the picture, keeps more",
                self.detail_at_m(z_m) * 1e6,
                self.detail_m * 1e6
            )
        })
    }
}

/// Warns if the volume of `display` reaches farther than its details.
pub(crate) fn warn_of_volume(display: &Display) {
    let limits = Limits::of(display);
    let farthest_m = limits.farthest_m(display);
    if let Some(lost) = limits.lost_at(farthest_m) {
        log::warn!("the volume reaches z = {:.1} mm: {lost}", farthest_m * 1e3);
    }
}

/// Returns the share of the panel's light that is in a picture of `amplitudes` whose full light stands for `scale`.
pub(crate) fn share_of_light(amplitudes: impl Iterator<Item = f32>, scale: f32) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for amplitude in amplitudes {
        sum += f64::from(amplitude.min(scale) / scale).powi(2);
        count += 1.0;
    }
    sum / count
}
