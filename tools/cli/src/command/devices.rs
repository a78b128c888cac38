//! `phasefront devices`: lists the modulators that are known by name, or describes one with all that its file sets.

use crate::limits::{Limits, share_of_light};
use clap::Args;
use phasefront::output::Layout;
use phasefront::output::{ModulatorSpec, Packing};
use phasefront::{Display, Size};
use phasefront_command::terminal;
use phasefront_core::display::lens::Lens;
use phasefront_io::display::DisplayFile;
use phasefront_io::{Error, Result, display};
use serde_json::json;
use std::path::Path;

/// List the modulators that --display knows by name, or describe one of them
#[derive(Args)]
pub(crate) struct Devices {
    /// Name or file of a modulator to describe, with all that its file sets and the sources of its figures
    #[arg(value_name = "NAME|FILE")]
    device: Option<String>,
    /// Also tell what is left of details at this z, mm from the middle of the volume, positive toward the viewer
    #[arg(long, value_name = "Z", allow_negative_numbers = true, requires = "device")]
    z_mm: Option<f64>,
}

impl Devices {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        if let Some(name) = &self.device {
            let file = display::find_display(name)?;
            if self.z_mm.is_some() && file.lens.is_some() {
                return Err(Error::Usage(
                    "--z-mm is for pictures about the modulator, and this display's lies in the focal plane of a lens"
                        .into(),
                ));
            }
            let value = object_of_file(name, &file, self.z_mm);
            terminal::print(json, &value, describe(&file, self.z_mm));
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

/// The scale that gives pictures more light, of which the documents have the cost in quality.
const BRIGHTER: f32 = 0.7;

/// Describes what `display` can show at most, and at `z_mm` if it is given.
fn describe_limits(display: &Display, z_mm: Option<f64>) -> String {
    let limits = Limits::of(display);
    let angles: Vec<_> = (limits.angle_rad.iter())
        .map(|angle| format!("{:.2}", angle.to_degrees()))
        .collect();
    let mut text = format!("\n{:12} {:.1} um", "detail", limits.detail_m * 1e6);
    text += &format!("\n{:12} {}° to each side", "angle", angles.join(", "));
    let Size { width, height } = display.size();
    let side_mm = |pixels: usize| pixels as f64 * display.pitch_m() * 1e3;
    text += &format!("\n{:12} {:.1} x {:.1} mm", "size", side_mm(width), side_mm(height));
    text += &format!(
        "\n{:12} {:.0} mm from the modulator with this detail",
        "reach",
        limits.reach_m * 1e3
    );
    let [least_mm, most_mm] = limits.range_m().map(|z_m| z_m * 1e3);
    text += &format!(", from z = {least_mm:.1} to {most_mm:.1} mm");
    let farthest_m = limits.farthest_m(display);
    if let Some(lost) = limits.lost_at(farthest_m) {
        text += &format!("\n{:12} z = {:.1} mm: {lost}", "too far", farthest_m * 1e3);
    }
    let [even, brighter] = [1.0, BRIGHTER].map(|scale| 100.0 * share_of_light(even_amplitudes(), scale));
    text += &format!(
        "\n{:12} {even:.0} % in a picture whose amplitudes spread evenly from 0 to 1; {brighter:.0} % with --scale {BRIGHTER}, which clips brighter ones",
        "light"
    );
    if let Some(z_mm) = z_mm {
        let [width_m, height_m] = limits.sharp_part_m(z_mm / 1e3);
        text += &format!(
            "\n{:12} {:.1} um in the middle, and {:.1} um in the middle {:.1} x {:.1} mm",
            format!("z = {z_mm} mm"),
            limits.detail_at_m(z_mm / 1e3) * 1e6,
            limits.detail_m * 1e6,
            width_m * 1e3,
            height_m * 1e3
        );
        let half_mm = display.volume_depth_m() * 500.0;
        if z_mm.abs() > half_mm {
            text += &format!("; outside the volume, from {:.1} to {half_mm:.1} mm", -half_mm);
        }
    }
    text
}

/// Returns amplitudes that spread evenly from 0 to 1.
fn even_amplitudes() -> impl Iterator<Item = f32> {
    (0..1000).map(|step| (step as f32 + 0.5) / 1000.0)
}

/// Describes where the picture lies in the focal plane of `lens`.
fn describe_lens(lens: &Lens, display: &Display) -> String {
    let (Size { width, height }, pixel_m) = (display.size(), lens.pixel_m());
    let fields_m = || display.wavelengths_m().iter().map(|l| lens.field_m(*l, display));
    let fields: Vec<_> = fields_m().map(|field_m| format!("{:.1}", field_m * 1e3)).collect();
    let details = fields_m().map(|field_m| (field_m / width as f64 * 1e6, field_m / height as f64 * 1e6));
    let details: Vec<_> = details.map(|(x, y)| format!("{x:.1} x {y:.1}")).collect();
    let places = [("left of", "right of"), ("above", "below")]
        .into_iter()
        .zip(lens.centre_m());
    let places = places
        .filter(|(_, centre_m)| *centre_m != 0.0)
        .map(|((less, more), centre_m)| {
            // The middle of the picture lies at the centre, so that the zero order lies the other way.
            let way = if centre_m > 0.0 { less } else { more };
            format!("{:.1} mm {way}", centre_m.abs() * 1e3)
        });
    let places: Vec<_> = places.collect();
    let zero_order = match places.is_empty() {
        true => "in the middle of the picture: block it, or move the picture by carrier_mrad".to_owned(),
        false => format!("{} the middle of the picture", places.join(" and ")),
    };
    let mut text = format!(
        "\n{:12} {:.1} x {:.1} mm in the focal plane of a lens of {} mm, pixels of {:.1} um",
        "picture",
        width as f64 * pixel_m * 1e3,
        height as f64 * pixel_m * 1e3,
        rounded(lens.focal_m() * 1e3),
        pixel_m * 1e6
    );
    text += &format!(
        "\n{:12} {} mm for each laser, around the zero order",
        "field",
        fields.join(", ")
    );
    text += &format!("\n{:12} {} um", "detail", details.join(", "));
    text + &format!("\n{:12} {zero_order}", "zero order")
}

fn describe(file: &DisplayFile, z_mm: Option<f64>) -> String {
    let (device, display) = (&file.device, &file.target.display);
    let lasers: Vec<_> = (display.wavelengths_m().iter())
        .map(|wavelength| format!("{:.0}", wavelength * 1e9))
        .collect();
    let mut text = row(&device.name, device);
    text += &format!("\n{:12} {} nm", "lasers", lasers.join(", "));
    let volume_mm = rounded(display.volume_depth_m() * 1e3);
    match &file.lens {
        Some(lens) => {
            text += &format!("\n{:12} {volume_mm} mm deep, its middle in the focal plane", "volume");
            text += &describe_lens(lens, display);
        }
        None => {
            text += &format!(
                "\n{:12} {volume_mm} mm deep, its middle {} mm from the modulator",
                "volume",
                rounded(display.offset_m() * 1e3),
            );
            text += &format!(
                "\n{:12} {} of the Nyquist frequency",
                "aperture",
                rounded(display.aperture_radius())
            );
            text += &describe_limits(display, z_mm);
        }
    }
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
fn object_of_file(name: &str, file: &DisplayFile, z_mm: Option<f64>) -> serde_json::Value {
    let display = &file.target.display;
    let mut told = object(name, &file.device);
    told["wavelengths_nm"] = (display.wavelengths_m().iter())
        .map(|wavelength| rounded(wavelength * 1e9))
        .collect();
    told["volume_mm"] = rounded(display.volume_depth_m() * 1e3).into();
    told["offset_mm"] = rounded(display.offset_m() * 1e3).into();
    told["aperture"] = display.aperture_radius().into();
    told["calibrated"] = calibrated(file).into();
    if let Some(lens) = &file.lens {
        told["focal_mm"] = rounded(lens.focal_m() * 1e3).into();
        told["picture_pixel_um"] = rounded(lens.pixel_m() * 1e6).into();
        told["picture_middle_mm"] = lens.centre_m().map(|centre_m| rounded(centre_m * 1e3)).to_vec().into();
        let fields = display
            .wavelengths_m()
            .iter()
            .map(|l| rounded(lens.field_m(*l, display) * 1e3));
        told["field_mm"] = fields.collect();
        return told;
    }
    let limits = Limits::of(display);
    told["detail_um"] = rounded(limits.detail_m * 1e6).into();
    told["angle_deg"] = (limits.angle_rad.iter())
        .map(|angle| rounded(angle.to_degrees()))
        .collect();
    told["reach_mm"] = rounded(limits.reach_m * 1e3).into();
    told["range_mm"] = limits.range_m().map(|z_m| rounded(z_m * 1e3)).to_vec().into();
    let [even, brighter] = [1.0, BRIGHTER].map(|scale| rounded(share_of_light(even_amplitudes(), scale)));
    told["light"] = json!({"even": even, "even_scale_0.7": brighter});
    if let Some(z_mm) = z_mm {
        let part_mm = limits.sharp_part_m(z_mm / 1e3).map(|side_m| rounded(side_m * 1e3));
        told["at_z"] =
            json!({"z_mm": z_mm, "detail_um": rounded(limits.detail_at_m(z_mm / 1e3) * 1e6), "sharp_mm": part_mm});
    }
    told
}
