//! `phasefront multiplex`: makes several phase maps of one image, for modulators that are faster than the eye.

use crate::flags::frame::{FrameFlags, shown_json, shown_text};
use crate::flags::method::{CoreMethod, HologramFlags};
use crate::make::levels_info;
use clap::Args;
use ndarray::Array3;
use num_complex::Complex32;
use phasefront::output::Packing;
use phasefront::session::Focus;
use phasefront::{EncoderOptions, Pipeline, RgbdFrame, Size, Sweep};
use phasefront_cli::modulator::multiplex::{Differ, Map, Multiplex};
use phasefront_command::flags::{OverwriteFlag, check_used};
use phasefront_command::terminal::{self, progress_bar};
use phasefront_core::view::colours::ViewColours;
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
    #[command(flatten)]
    hologram: HologramFlags,
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
    /// Compare the mean of the first 1, 2, 4, 8 … and of all maps with the wave
    #[arg(long, help_heading = "Output")]
    judge: bool,
    /// Output folder of the maps: phase_000.png …
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteFlag,
}

/// The largest number of maps of natural focus, which are in memory together.
const MOST_NATURAL: u16 = 24;

impl MultiplexCommand {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        if self.output.is_none() && self.packed.is_none() && !self.judge {
            return Err(Error::Usage(
                "give -o, --packed or --judge: where the maps go, or whether to judge them".into(),
            ));
        }
        if let Some(path) = &self.packed {
            output::file(path, &["png"])?;
        }
        if let Some(folder) = &self.output {
            output::folder(folder, self.overwrite.holding())?;
        }
        let file = self.frame.colours.display(&self.hologram.display)?;
        let target = file.corrected()?;
        if target.display.bits() > 8 || target.panel.adds() {
            return Err(Error::Input(
                "maps are made for levels of up to 8 bits, without a carrier, a lens or a flatness map".into(),
            ));
        }
        self.check_flags()?;
        let (frame, depth) = self.frame.read(&target.display, self.hologram.display.is_given())?;
        let method = self.hologram.method(self.method);
        let sweep = Sweep::for_display(&target.display);
        let (method, encoder) = self.hologram.read(method, &target.display, sweep)?;
        // Joint steps follow after all maps.
        let options = EncoderOptions {
            focus_steps: 0,
            ..encoder.options.clone()
        };
        let pipeline = Pipeline::new(frame.size(), method, &target, &options)?;
        let Size { width, height } = frame.size();
        let mut wave = Array3::from_elem((pipeline.colours(), height, width), Complex32::ZERO);
        let values = wave.as_slice_mut().expect("standard layout");
        pipeline.field(&frame, values, &mut pipeline.scratch())?;
        let plan = Multiplex::new(frame.size(), &target, &options)?;
        let maps = match encoder.options.focus_steps {
            0 => {
                let differ = Differ {
                    start: true,
                    feedback: !self.no_feedback,
                };
                plan.maps(&wave, self.maps.into(), differ)
            }
            steps => {
                let bar = progress_bar(self.maps.into(), "maps");
                let maps = plan.natural(&frame, self.maps.into(), steps, &|n| bar.set_position(n as u64))?;
                bar.finish_and_clear();
                maps
            }
        };
        self.write(&file, encoder.name, &maps)?;
        let (rows, text) = match self.judge {
            true => judged(&plan, &frame, &wave, &maps)?,
            false => (Vec::new(), String::new()),
        };
        let text = format!("{} maps of {width}×{height}{}{text}", maps.len(), shown_text(depth));
        let value = json!({
            "output": self.output, "packed": self.packed, "width": width, "height": height,
            "depth": shown_json(depth), "shown": rows,
        });
        terminal::print(json, &value, text);
        Ok(())
    }

    /// Refuses flags that natural focus does not use.
    fn check_flags(&self) -> Result<()> {
        let coherent = !self.hologram.encoder.is_natural();
        let with = "--focus coherent";
        check_used(&[
            ("--method", self.method.is_some(), coherent, with),
            ("--network", self.hologram.network.is_some(), coherent, with),
            ("--precision", self.hologram.precision.is_some(), coherent, with),
            ("--no-feedback", self.no_feedback, coherent, with),
        ])?;
        if self.hologram.encoder.focus()? == (Focus::Natural { steps: 0 }) {
            return Err(Error::Usage(
                "--focus-steps 0 is for one map, by a network; several maps of natural focus take at least 1 joint step"
                    .into(),
            ));
        }
        if !coherent && self.maps > MOST_NATURAL {
            return Err(Error::Usage(format!(
                "--focus natural makes at most {MOST_NATURAL} maps, all at once; --maps is {}",
                self.maps
            )));
        }
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
        let colours = ViewColours::new(self.frame.colours.viewed(), &display.target.display);
        let info = levels_info(display, encoder, Some(&colours));
        for (n, map) in maps.iter().enumerate() {
            let info = HologramInfo {
                scale: Some(map.scale),
                ..info.clone()
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
            return Err(Error::Usage(
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

/// Compares the mean of the first 1, 2, 4 … and of all `maps` with `wave` and with what incoherent light shows of
/// `frame`.
fn judged(
    plan: &Multiplex<'_>,
    frame: &RgbdFrame,
    wave: &Array3<Complex32>,
    maps: &[Map],
) -> Result<(Vec<serde_json::Value>, String)> {
    let counts = [1, 2, 4, 8, 12, 24, 48, 96].into_iter();
    let counts: Vec<usize> = counts.filter(|n| *n < maps.len()).chain([maps.len()]).collect();
    let natural = plan.judge_natural(frame, maps, &counts)?;
    let (mut rows, mut text) = (Vec::new(), String::new());
    for ((n, f), natural) in counts.iter().zip(plan.judge(wave, maps, &counts)?).zip(natural) {
        rows.push(json!({
            "maps": n, "psnr_db": f.amplitude_psnr, "ssim": f.amplitude_ssim,
            "stack_psnr_db": f.focal_psnr, "stack_ssim": f.focal_ssim, "natural": natural, "brightness": f.brightness,
        }));
        text += &format!(
            "\n{n:3} maps: {:.2} dB, SSIM {:.3}, over the stack {:.2} dB, {:.3}, natural {:.2} dB, {:.3}, brightness {:.2}",
            f.amplitude_psnr, f.amplitude_ssim, f.focal_psnr, f.focal_ssim, natural.psnr, natural.ssim, f.brightness
        );
    }
    Ok((rows, text))
}
