//! `phasefront multiplex`: makes several phase maps of one image, for modulators that are faster than the eye.

use crate::flags::encoder::EncoderFlags;
use crate::flags::frame::{FrameFlags, shown_json, shown_text};
use crate::flags::method::{CoreMethod, Parts};
use clap::Args;
use ndarray::Array3;
use num_complex::Complex32;
use phasefront::Pipeline;
use phasefront::Size;
use phasefront::output::Packing;
use phasefront_cli::modulator::multiplex::{Differ, Map, Multiplex};
use phasefront_command::flags::{DisplayFlags, OverwriteFlag, PrecisionName, sweep_for};
use phasefront_command::terminal;
use phasefront_io::display::DisplayFile;
use phasefront_io::hologram::{self, Hologram, HologramInfo, Levels, packed};
use phasefront_io::{Error, Result, output};
use serde_json::json;
use std::path::PathBuf;

/// Make several phase maps of an RGB-D image for fast modulators, with a mean intensity close to the image's
#[derive(Args)]
pub(crate) struct MultiplexCommand {
    #[command(flatten)]
    frame: FrameFlags,
    /// Method for the wave [default: auto; network with --network or --encoder deep]
    #[arg(long, value_enum, help_heading = "Method")]
    method: Option<CoreMethod>,
    /// A bundled network, or an ONNX file [default: 8]
    #[arg(long, value_name = "NAME|FILE", help_heading = "Method")]
    network: Option<String>,
    /// Number type of a bundled network [default: int8]
    #[arg(long, value_enum, help_heading = "Expert")]
    precision: Option<PrecisionName>,
    #[command(flatten)]
    encoder: EncoderFlags,
    #[command(flatten)]
    display: DisplayFlags,
    /// Number of maps
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..=1024), help_heading = "Method")]
    maps: u16,
    /// Do not let each map compensate for the error in the mean of the maps before it
    #[arg(long, help_heading = "Expert")]
    no_feedback: bool,
    /// Also write the maps' planes as one frame of a modulator of bit planes
    #[arg(long, value_name = "FRAME.png", help_heading = "Output")]
    packed: Option<PathBuf>,
    /// The one colour of --packed; without it, a frame holds the maps of all three colours, red first
    #[arg(long, value_parser = packed::COLOURS, requires = "packed", help_heading = "Output")]
    colour: Option<String>,
    /// Compare the mean of the first 1, 2, 4, 8 … maps with the wave
    #[arg(long, help_heading = "Output")]
    judge: bool,
    /// Output folder of the maps: phase_000.png …
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteFlag,
}

impl MultiplexCommand {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        if self.output.is_none() && self.packed.is_none() && !self.judge {
            return Err(Error::Input(
                "give -o, --packed or --judge: where the maps go, or whether to judge them".into(),
            ));
        }
        if let Some(path) = &self.packed {
            output::file(path, &["png"])?;
        }
        if let Some(folder) = &self.output {
            output::folder(folder, self.overwrite.holding())?;
        }
        let file = self.display.read()?;
        let target = file.corrected()?;
        if target.display.bits() > 8 || target.panel.adds() {
            return Err(Error::Input(
                "maps are made for levels of up to 8 bits, without a carrier, a lens or a flatness map".into(),
            ));
        }
        let (frame, depth) = self.frame.read(&target.display, self.display.is_given())?;
        let network = self.network.as_deref();
        let method = CoreMethod::or_default(self.method, network, &self.encoder);
        let (method, encoder) = method.of(&Parts {
            network,
            precision: self.precision,
            display: &target.display,
            sweep: sweep_for(&target.display, None, None),
            encoder: &self.encoder,
        })?;
        let pipeline = Pipeline::new(frame.size(), method, &target, &encoder.options)?;
        let Size { width, height } = frame.size();
        let mut wave = Array3::from_elem((pipeline.colours(), height, width), Complex32::ZERO);
        let values = wave.as_slice_mut().expect("standard layout");
        pipeline.field(&frame, values, &mut pipeline.scratch())?;
        let plan = Multiplex::new(frame.size(), &target, &encoder.options)?;
        let differ = Differ {
            start: true,
            feedback: !self.no_feedback,
        };
        let maps = plan.maps(&wave, self.maps.into(), differ);
        self.write(&file, encoder.name, &maps)?;
        let counts: Vec<usize> = [1, 2, 4, 8, 12, 24, 48, 96]
            .into_iter()
            .filter(|n| *n <= maps.len())
            .collect();
        let figures = if self.judge {
            plan.judge(&wave, &maps, &counts)?
        } else {
            Vec::new()
        };
        let rows: Vec<_> = (counts.iter().zip(&figures))
            .map(|(n, f)| {
                json!({
                    "maps": n, "psnr_db": f.amplitude_psnr, "ssim": f.amplitude_ssim,
                    "stack_psnr_db": f.focal_psnr, "stack_ssim": f.focal_ssim, "brightness": f.brightness,
                })
            })
            .collect();
        let text = (counts.iter().zip(&figures)).map(|(n, f)| {
            format!(
                "\n{n:3} maps: {:.2} dB, SSIM {:.3}, over the stack {:.2} dB, {:.3}, brightness {:.2}",
                f.amplitude_psnr, f.amplitude_ssim, f.focal_psnr, f.focal_ssim, f.brightness
            )
        });
        let text = format!(
            "{} maps of {width}×{height}{}{}",
            maps.len(),
            shown_text(depth),
            text.collect::<String>()
        );
        let value = json!({
            "output": self.output, "packed": self.packed, "width": width, "height": height,
            "depth": shown_json(depth), "shown": rows,
        });
        terminal::print(json, &value, text);
        Ok(())
    }

    fn write(&self, display: &DisplayFile, encoder: &str, maps: &[Map]) -> Result<()> {
        if let Some(path) = &self.packed {
            self.frame_of(display, maps)?.write(path)?;
        }
        let Some(dir) = &self.output else {
            return Ok(());
        };
        output::make_folder(dir)?;
        let path = |n: usize| dir.join(format!("phase_{n:03}.png"));
        for (n, map) in maps.iter().enumerate() {
            let info = HologramInfo {
                display: display.target.display.clone(),
                encoder: Some(encoder.into()),
                scale: Some(map.scale),
                lut: display.lut.map(Vec::from),
                levels_turns: display.target.panel.levels_turns.clone(),
                calibrated: display.calibrated(true),
            };
            let levels = Levels::Bytes(map.levels.clone());
            hologram::write_hologram(&path(n), &Hologram::Levels(levels, info))?;
        }
        // With --overwrite: further maps of a longer earlier run do not belong to these.
        for left in (maps.len()..).map(path).take_while(|path| path.is_file()) {
            std::fs::remove_file(&left).map_err(|e| Error::file(left, format!("cannot be removed: {e}")))?;
        }
        Ok(())
    }

    fn frame_of(&self, display: &DisplayFile, maps: &[Map]) -> Result<packed::Image> {
        let Packing::BitPlanes(cells) = &display.device.packing else {
            return Err(Error::Input(
                "--packed is for modulators whose frames are bit planes; this one's are not, -o writes the maps".into(),
            ));
        };
        let (count, height, width) = maps[0].levels.dim();
        let colours: Vec<usize> = match &self.colour {
            None => (0..count).collect(),
            Some(name) => vec![packed::colour(name, count)?],
        };
        let plan = packed::bit_planes(display, Size { width, height }, cells)?;
        let planes: Vec<&[u8]> = (colours.iter())
            .flat_map(|colour| {
                maps.iter().map(move |map| {
                    let all = map.levels.as_slice().expect("standard layout");
                    &all[colour * height * width..][..height * width]
                })
            })
            .collect();
        packed::pack_maps(&plan, &planes)
    }
}
