//! `phasefront devices`: lists the modulators that are known by name, or describes one with all that its file sets.

use clap::Args;
use phasefront::Display;
use phasefront::output::Layout;
use phasefront::output::{ModulatorSpec, Packing};
use phasefront_command::terminal;
use phasefront_io::display::DisplayFile;
use phasefront_io::{Result, display};
use serde_json::json;
use std::path::Path;

/// List the modulators that --display knows by name, or describe one of them
#[derive(Args)]
pub(crate) struct Devices {
    /// Name or file of a modulator to describe, with all that its file sets and the sources of its figures
    #[arg(value_name = "NAME|FILE")]
    device: Option<String>,
}

impl Devices {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        if let Some(name) = &self.device {
            let file = display::find_display(name)?;
            terminal::print(json, &object_of_file(name, &file), describe(&file));
            return Ok(());
        }
        let own: Vec<String> = (display::own_devices().iter())
            .filter_map(|path| Some(path.file_stem()?.to_str()?.to_owned()))
            .collect();
        let shipped = ModulatorSpec::names().map(str::to_owned);
        let names: Vec<String> = own
            .iter()
            .cloned()
            .chain(shipped.filter(|name| !own.contains(name)))
            .collect();
        let devices = names.iter().map(|name| Ok((name, display::find_display(name)?.device)));
        let devices = devices.collect::<Result<Vec<_>>>()?;
        let rows: Vec<_> = devices.iter().map(|(name, device)| row(name, device)).collect();
        let objects: Vec<_> = devices.iter().map(|(name, device)| object(name, device)).collect();
        terminal::print(json, &json!(objects), rows.join("\n"));
        Ok(())
    }
}

fn packing(device: &ModulatorSpec) -> &'static str {
    match &device.packing {
        Packing::Images(Layout::Rgb) => "three colours in one image",
        Packing::Images(Layout::Grey) => "an image a colour, grey",
        Packing::Images(Layout::Grey16) => "an image a colour, grey of 16 bits",
        Packing::Images(Layout::Split(_)) => "an image a colour, bits spread over red, green, blue",
        Packing::BitPlanes(_) => "24 bit planes a frame, 2x2 cells a pixel",
        _ => "",
    }
}

fn row(name: &str, device: &ModulatorSpec) -> String {
    let display = &device.display;
    let size = format!("{}x{}", display.size().width, display.size().height);
    let unconfirmed = match device.unconfirmed.len() {
        0 => String::new(),
        count => format!("; {count} figures unconfirmed"),
    };
    format!(
        "{name:18} {size:>9}  {:5.2} um  {:2} bits  {}{unconfirmed}",
        display.pitch_m() * 1e6,
        display.bits(),
        packing(device)
    )
}

/// Returns `value` to four digits after the point.
fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

/// Returns the keys of the calibrations that the file of a display names or holds.
fn calibrated(file: &DisplayFile) -> Vec<&'static str> {
    let target = &file.target;
    let keys = [
        ("lut", file.lut.is_some()),
        (
            "per_pixel or lut of each laser",
            target.response.size().is_some() && file.device.lasers_turns.is_none(),
        ),
        ("laser", target.illumination.is_some()),
        ("aberration", file.aberration.is_some()),
        ("model", target.model.is_some()),
        ("carrier_mrad", target.panel.carrier_rad != [0.0; 2]),
        ("lens_mm", target.panel.lens_m.is_some()),
        ("flatness", target.panel.flatness.is_some()),
        ("shift_px or scale", target.registration.moves()),
    ];
    (keys.into_iter().filter(|(_, there)| *there))
        .map(|(key, _)| key)
        .collect()
}

/// What a display can show at most, by its geometry.
struct Limits {
    /// The size of the finest detail that the aperture passes, half a period, in µm.
    detail_um: f64,
    /// The largest angle of each laser's light, in degrees.
    angle_deg: Vec<f64>,
    /// The distance from the modulator up to which the middle of the frame has the finest detail, in mm. Farther away,
    /// light of the largest angle comes from beyond the panel's edge.
    reach_mm: f64,
}

impl Limits {
    fn of(display: &Display) -> Self {
        let finest_m = display.pitch_m() / display.aperture_radius();
        let angle = |wavelength_m: &f64| (wavelength_m / (2.0 * finest_m)).min(1.0).asin();
        let size = display.size();
        let half_m = size.width.min(size.height) as f64 * display.pitch_m() / 2.0;
        Limits {
            detail_um: finest_m * 1e6,
            angle_deg: display.wavelengths_m().iter().map(|l| angle(l).to_degrees()).collect(),
            reach_mm: half_m / angle(&display.longest_wavelength_m()).tan() * 1e3,
        }
    }

    fn describe(&self, display: &Display) -> String {
        let angles: Vec<_> = self.angle_deg.iter().map(|angle| format!("{angle:.2}")).collect();
        let mut text = format!("\n{:12} {:.1} um", "detail", self.detail_um);
        text += &format!("\n{:12} {}° to each side", "angle", angles.join(", "));
        text += &format!(
            "\n{:12} {:.0} mm from the modulator with this detail",
            "reach", self.reach_mm
        );
        let farthest_mm = (display.offset_m().abs() + display.volume_depth_m() / 2.0) * 1e3;
        if farthest_mm > self.reach_mm {
            text += &format!("; the volume reaches {farthest_mm:.0} mm and is coarser there");
        }
        text
    }
}

fn describe(file: &DisplayFile) -> String {
    let (device, display) = (&file.device, &file.target.display);
    let lasers: Vec<_> = (display.wavelengths_m().iter())
        .map(|wavelength| format!("{:.0}", wavelength * 1e9))
        .collect();
    let mut text = row(&device.name, device);
    text += &format!("\n{:12} {} nm", "lasers", lasers.join(", "));
    text += &format!(
        "\n{:12} {} mm deep, its middle {} mm from the modulator",
        "volume",
        rounded(display.volume_depth_m() * 1e3),
        rounded(display.offset_m() * 1e3),
    );
    text += &format!(
        "\n{:12} {} of the Nyquist frequency",
        "aperture",
        rounded(display.aperture_radius())
    );
    text += &Limits::of(display).describe(display);
    if let Some(turns) = device.levels_turns.as_ref().and_then(|turns| turns.last()) {
        text += &format!("\n{:12} {} turns at the last level", "range", rounded(*turns));
    }
    if let Some(lasers) = &device.lasers_turns {
        let ends: Vec<_> = lasers
            .iter()
            .filter_map(|turns| turns.last())
            .map(|end| rounded(*end).to_string())
            .collect();
        text += &format!(
            "\n{:12} {} turns at the last level of each laser",
            "range",
            ends.join(", ")
        );
    }
    if let Some(rate) = device.rate_hz {
        text += &format!("\n{:12} {} Hz", "rate", rounded(rate));
    }
    let flips = [(device.flip_x, "left to right"), (device.flip_y, "top to bottom")];
    let flips: Vec<_> = flips.iter().filter(|(flips, _)| *flips).map(|(_, how)| *how).collect();
    for (title, set) in [("flipped", flips), ("calibrated", calibrated(file))] {
        if !set.is_empty() {
            text += &format!("\n{title:12} {}", set.join(", "));
        }
    }
    for (title, figures) in [("from", &device.sources), ("unconfirmed", &device.unconfirmed)] {
        for (key, source) in figures {
            text += &format!("\n{title:12} {key}: {source}");
        }
    }
    text
}

fn object(name: &str, device: &ModulatorSpec) -> serde_json::Value {
    let display = &device.display;
    json!({
        "name": Path::new(name).file_stem().and_then(|stem| stem.to_str()), "title": device.name,
        "width": display.size().width, "height": display.size().height, "pitch_um": display.pitch_m() * 1e6,
        "bits": display.bits(), "packing": packing(device), "flip_x": device.flip_x, "flip_y": device.flip_y,
        "levels_turns": device.levels_turns, "lasers_turns": device.lasers_turns, "rate_hz": device.rate_hz,
        "sources": device.sources, "unconfirmed": device.unconfirmed,
    })
}

/// Returns [`object`] with what only a file sets.
fn object_of_file(name: &str, file: &DisplayFile) -> serde_json::Value {
    let display = &file.target.display;
    let mut told = object(name, &file.device);
    told["wavelengths_nm"] = (display.wavelengths_m().iter())
        .map(|wavelength| rounded(wavelength * 1e9))
        .collect();
    told["volume_mm"] = rounded(display.volume_depth_m() * 1e3).into();
    told["offset_mm"] = rounded(display.offset_m() * 1e3).into();
    told["aperture"] = display.aperture_radius().into();
    let limits = Limits::of(display);
    told["detail_um"] = rounded(limits.detail_um).into();
    told["angle_deg"] = limits.angle_deg.into_iter().map(rounded).collect();
    told["reach_mm"] = rounded(limits.reach_mm).into();
    told["calibrated"] = calibrated(file).into();
    told
}
