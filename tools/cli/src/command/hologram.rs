//! `phasefront hologram`: makes a phase-only hologram of an RGB-D image or a layered depth image.

mod stills;

use crate::flags::frame::Picture;
use crate::flags::outputs::OutputFlags;
use crate::given::{self, Flag};
use crate::limits;
use crate::make::HologramRequest;
use crate::record::{Before, RunRecord};
use clap::Args;
use phasefront_io::input::decode::{COLOUR_FORMATS, DEPTH_FORMATS};
use phasefront_io::{Error, Result, output};
use std::path::PathBuf;

/// Make a phase-only hologram of an RGB-D image or a layered depth image
#[derive(Args)]
#[command(
    mut_arg("rgb", |rgb| rgb.help(format!("Colour image: {COLOUR_FORMATS}; or a folder of them"))),
    mut_arg("depth", |depth| depth.help(format!("Depth image: {DEPTH_FORMATS}; or a folder of them, with the names of those of --rgb"))),
    mut_arg("photo", |photo| photo.help("A phone's JPEG with depth inside (GDepth or Dynamic Depth); or a folder of them"))
)]
pub(crate) struct Hologram {
    /// A picture without a flag, which is refused with advice.
    #[arg(hide = true)]
    picture: Option<PathBuf>,
    #[command(flatten)]
    request: HologramRequest,
    #[command(flatten)]
    outputs: OutputFlags,
    /// Output: a PNG of modulator levels; for folders of pictures, a folder that gets NAME.png for each picture NAME
    #[arg(short, long, value_name = "OUT.png|DIR")]
    output: PathBuf,
    /// For folders of pictures: keep the holograms of an earlier run with the same flags
    #[arg(long, conflicts_with = "overwrite")]
    resume: bool,
    /// For folders of pictures: replace existing holograms
    #[arg(long)]
    overwrite: bool,
}

impl Hologram {
    pub(crate) fn run(mut self, json: bool, flags: &[Flag]) -> Result<()> {
        if let Some(picture) = &self.picture {
            return Err(Error::file(
                picture,
                "needs a flag that says what it is: --photo for a photo with depth inside, --rgb with --depth or --depth-network for other pictures",
            ));
        }
        if let Some(pictures) = self.request.image.frame.pictures()? {
            return self.stills(json, pictures, flags);
        }
        if self.resume || self.overwrite {
            return Err(Error::Usage(
                "--resume and --overwrite go with folders of pictures, as --rgb DIR --depth DIR; a file is replaced"
                    .into(),
            ));
        }
        output::file(&self.output, &["png"])?;
        let display = self.request.display()?;
        self.outputs.declare(&display)?;
        self.request.keeps_field = self.outputs.need_field();
        let (image, shown) = self.request.image(&display)?;
        let made = self.request.make(&display, &image)?;
        self.outputs
            .finish(&self.output, &display, &made, image.picture(), shown, json)?;
        if display.lens.is_none() {
            limits::warn_of_volume(&display.target.display);
        }
        Ok(())
    }

    fn stills(self, json: bool, pictures: Vec<Picture>, flags: &[Flag]) -> Result<()> {
        let outputs = given::ids::<OutputFlags>();
        if let Some(Flag { name, .. }) = flags.iter().find(|flag| flag.is_given && outputs.contains(&flag.id)) {
            return Err(Error::Usage(format!(
                "{name} goes with one picture, not with a folder of them"
            )));
        }
        let before = Before::of_flags(self.resume, self.overwrite);
        let record = RunRecord::new("hologram", flags)?;
        stills::run(self.request, pictures, &self.output, before, record, json)
    }
}
