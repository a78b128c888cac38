//! `phasefront devices`: lists the modulators that are known by name.

use clap::Args;
use phasefront::output::Layout;
use phasefront::output::{ModulatorSpec, Packing};
use phasefront_command::terminal;
use phasefront_io::{Result, display};
use serde_json::json;
use std::path::Path;

/// List the modulators that --display knows by name, or describe one of them
#[derive(Args)]
pub(crate) struct Devices {
    /// Name or file of a modulator to describe, with the sources of its figures
    #[arg(value_name = "NAME|FILE")]
    device: Option<String>,
}

impl Devices {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        if let Some(name) = &self.device {
            let device = display::find_display(name)?.device;
            terminal::print(json, &object(name, &device), describe(&device));
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
    let size = format!("{}x{}", display.width(), display.height());
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

fn describe(device: &ModulatorSpec) -> String {
    let mut text = row(&device.name, device);
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
        "width": display.width(), "height": display.height(), "pitch_um": display.pitch_m() * 1e6,
        "bits": display.bits(), "packing": packing(device), "flip_x": device.flip_x, "flip_y": device.flip_y,
        "levels_turns": device.levels_turns, "rate_hz": device.rate_hz,
        "sources": device.sources, "unconfirmed": device.unconfirmed,
    })
}
