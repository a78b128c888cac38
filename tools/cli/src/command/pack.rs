//! `phasefront pack` and `phasefront unpack`: convert holograms to frames for a modulator's input, and back.

use clap::Args;
use phasefront::Size;
use phasefront::output::{Cells, Packing};
use phasefront_command::flags::{DisplayFlags, parse_size};
use phasefront_command::terminal;
use phasefront_io::display::DisplayFile;
use phasefront_io::hologram::{self, Hologram, HologramInfo, Levels, packed};
use phasefront_io::{Error, Result, output};
use serde_json::json;
use std::path::PathBuf;

/// Convert a hologram to the frame that a modulator's input takes
#[derive(Args)]
pub(crate) struct Pack {
    /// A hologram PNG, or a phase map of other software: a PNG, BMP or TIFF of levels, a .npy of levels or radians;
    /// several for one frame of bit planes that shows them one after another
    #[arg(required = true)]
    holograms: Vec<PathBuf>,
    #[command(flatten)]
    display: DisplayFlags,
    /// The one colour to pack, where the modulator takes an image for each colour, or of several holograms; not for one
    /// laser
    #[arg(long, value_parser = packed::COLOURS)]
    colour: Option<String>,
    /// Output frame: one PNG, or FRAME-red.png, FRAME-green.png and FRAME-blue.png
    #[arg(short, long, value_name = "FRAME.png")]
    output: PathBuf,
}

impl Pack {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        let display = self.display.read_with_lens()?;
        match &self.colour {
            None => packed::declare(&self.output, &display)?,
            Some(_) => output::file(&self.output, &["png"])?,
        }
        let colours = display.device.display.colours();
        let images = match (&self.holograms[..], &display.device.packing) {
            ([_], Packing::BitPlanes(cells)) if self.colour.is_some() => vec![self.planes(&display, cells)?],
            ([hologram], _) => {
                let levels = hologram::read_for(hologram, Some(&display))?;
                let packed = packed::pack_colour(&levels, &display, self.colour.as_deref());
                packed.map_err(|e| Error::file(hologram, e))?
            }
            (_, Packing::BitPlanes(_)) if self.colour.is_none() && colours > 1 => {
                return Err(Error::Usage(
                    "several holograms in one frame need --colour, which of theirs is shown".into(),
                ));
            }
            (_, Packing::BitPlanes(cells)) => vec![self.planes(&display, cells)?],
            _ => {
                return Err(Error::Input(
                    "several holograms in one frame are for modulators whose frames are bit planes; this one's are not, so pack one at a time"
                        .into(),
                ));
            }
        };
        let written = packed::write(&self.output, &images)?;
        let names: Vec<_> = written.iter().map(|path| path.display().to_string()).collect();
        let Size { width, height } = images[0].size;
        let text: Vec<_> = written.iter().map(|path| terminal::name(path)).collect();
        let text = format!("{}: {width}×{height}", text.join(", "));
        terminal::print(
            json,
            &json!({ "output": names, "width": width, "height": height }),
            text,
        );
        Ok(())
    }

    /// Packs one colour of all holograms into the planes of a frame, one after another.
    fn planes(&self, display: &DisplayFile, cells: &Cells) -> Result<packed::Image> {
        let colour = match &self.colour {
            Some(colour) => packed::colour(colour, display.device.display.colours())?,
            None => 0,
        };
        let mut maps = Vec::new();
        for path in &self.holograms {
            let hologram = hologram::read_for(path, Some(display))?;
            hologram.check_display(display).map_err(|e| Error::file(path, e))?;
            let Hologram::Levels(Levels::Bytes(levels), _) = hologram else {
                return Err(Error::file(path, "is no hologram of levels of up to 8 bits"));
            };
            maps.push(levels.index_axis(ndarray::Axis(0), colour).to_owned());
        }
        let plan = packed::bit_planes(display, Size::from_shape(maps[0].dim()), cells)?;
        if let Some((path, map)) = (self.holograms.iter().zip(&maps)).find(|(_, map)| map.dim() != maps[0].dim()) {
            let size = Size::from_shape(map.dim());
            return Err(Error::file(path, format!("is {size}; the first has another size")));
        }
        let maps: Vec<&[u8]> = maps
            .iter()
            .map(|map| map.as_slice().expect("standard layout"))
            .collect();
        packed::pack_maps(&plan, &maps)
    }
}

/// Read the levels back from the frame that a modulator's input takes, as the inverse of `pack`
#[derive(Args)]
pub(crate) struct Unpack {
    /// The frame: one PNG, BMP or TIFF, or one each for red, green and blue
    #[arg(required = true, num_args = 1..=3)]
    frames: Vec<PathBuf>,
    #[command(flatten)]
    display: DisplayFlags,
    /// Size of the hologram in the modulator's middle [default: the modulator's size]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<Size>,
    /// Output hologram: a PNG of modulator levels
    #[arg(short, long, value_name = "OUT.png")]
    output: PathBuf,
}

impl Unpack {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        output::file(&self.output, &["png"])?;
        let display = self.display.read_with_lens()?;
        let modulator = &display.target.display;
        let size = self.size.unwrap_or(modulator.size());
        let images = self.frames.iter().map(|path| packed::Image::read(path));
        let levels = packed::unpack(&images.collect::<Result<Vec<_>>>()?, &display, size)?;
        let info = HologramInfo::of_levels(&display);
        let levels = match modulator.bits() {
            0..=8 => Levels::Bytes(levels.mapv(|level| level as u8)),
            _ => Levels::Words(levels),
        };
        hologram::write_hologram(&self.output, &Hologram::Levels(levels, info))?;
        let text = format!("{}: {size}", terminal::name(&self.output));
        terminal::print(
            json,
            &json!({ "output": self.output, "width": size.width, "height": size.height }),
            text,
        );
        Ok(())
    }
}
