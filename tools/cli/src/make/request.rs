//! The request for a hologram: the flags for its image and its method.

use crate::flags::backend::BackendFlags;
use crate::flags::frame::FrameFlags;
use crate::flags::method::{CoreMethod, HologramFlags};
use crate::given::{self, SOURCE};
use clap::builder::PossibleValue;
use clap::{Args, ValueEnum};
use phasefront::{Brightness, EncoderOptions, RgbdFrame};
use phasefront_command::flags::{DisplayFlags, check_used};
use phasefront_core::view::colours::ViewColours;
use phasefront_exact::point_based::Occlusion;
use phasefront_io::display::DisplayFile;
use phasefront_io::frame::ShownDepth;
use phasefront_io::ldi::Ldi;
use phasefront_io::{Error, Result};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// The flags for an image with depth: an RGB-D image or a layered depth image.
#[derive(Default, Args)]
#[command(next_help_heading = "Input")]
pub(crate) struct ImageFlags {
    #[command(flatten)]
    pub(crate) frame: FrameFlags,
    /// Folder of a layered depth image, for --method layers and points, and for a --network that takes layers
    #[arg(long, value_name = "DIR", group = SOURCE, conflicts_with_all = given::ids::<FrameFlags>(), help_heading = "Input")]
    pub(crate) ldi: Option<PathBuf>,
}

impl ImageFlags {
    /// Reads the display on which the image is shown. A layered depth image has amplitudes, no colours. In the focal
    /// plane of a lens the image is as large as the modulator.
    pub(crate) fn display(&mut self, flags: &DisplayFlags) -> Result<DisplayFile> {
        if self.ldi.is_some() {
            return flags.read();
        }
        let file = self.frame.colours.display_with_lens(flags)?;
        if file.lens.is_some() {
            self.frame.contain_by_default();
        }
        Ok(file)
    }

    /// Returns the file of the image.
    pub(crate) fn source(&self) -> Option<&Path> {
        self.ldi.as_deref().or(self.frame.source())
    }
}

/// The flags for a hologram's image and method.
#[derive(Default, Args)]
#[command(next_help_heading = "Method")]
pub(crate) struct HologramRequest {
    #[command(flatten)]
    pub(crate) image: ImageFlags,
    /// Method for the midpoint hologram [default: auto; network with --network or --encoder deep, layers with --ldi and
    /// no --network]
    #[arg(long, value_enum, help_heading = "Method")]
    pub(crate) method: Option<Method>,
    /// Number of planes for --method layers and points [default: 256] and sweep [default: chosen for the display]
    #[arg(long, value_name = "N", help_heading = "Expert")]
    pub(crate) planes: Option<usize>,
    /// Number of taps of the filter from plane to plane, for --method sweep [default: chosen for planes and display]
    #[arg(long, value_name = "N", help_heading = "Expert")]
    pub(crate) taps: Option<usize>,
    /// Treatment of occlusion for --method points [default: geometric]
    #[arg(long, value_enum, help_heading = "Expert")]
    pub(crate) occlusion: Option<OcclusionName>,
    #[command(flatten)]
    pub(crate) hologram: HologramFlags,
    /// Amplitude that full light stands for [default: the largest of the image]
    #[arg(long, value_name = "A", help_heading = "Expert")]
    pub(crate) scale: Option<f32>,
    #[command(flatten)]
    pub(crate) backend: BackendFlags,
    /// Whether the result keeps the field.
    #[arg(skip)]
    pub(crate) keeps_field: bool,
}

#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Method {
    Core(CoreMethod),
    Layers,
    Points,
}

impl ValueEnum for Method {
    fn value_variants<'a>() -> &'a [Self] {
        static ALL: LazyLock<Vec<Method>> = LazyLock::new(|| {
            let core = CoreMethod::value_variants().iter().map(|method| Method::Core(*method));
            core.chain([Method::Layers, Method::Points]).collect()
        });
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        match self {
            Method::Core(method) => method.to_possible_value(),
            Method::Layers => Some(PossibleValue::new("layers").help("Silhouette-mask layers: exact waves, slow")),
            Method::Points => Some(PossibleValue::new("points").help("A sub-hologram for each point (Maimone et al.)")),
        }
    }
}

#[derive(Clone, Copy, Default, ValueEnum)]
pub(crate) enum OcclusionName {
    /// None: every point of every layer lights its whole sub-hologram
    None,
    /// By the image: only points of the front layer shine
    Input,
    /// By rays: every point shines where no nearer surface is in the way
    #[default]
    Geometric,
}

impl OcclusionName {
    pub(super) fn occlusion(self) -> Occlusion {
        match self {
            OcclusionName::None => Occlusion::None,
            OcclusionName::Input => Occlusion::Input,
            OcclusionName::Geometric => Occlusion::Geometric,
        }
    }
}

/// The image of a hologram.
pub(crate) enum Image {
    /// An RGB-D image.
    Rgbd(RgbdFrame),
    /// A layered depth image.
    Layers(Ldi),
}

impl Image {
    /// Returns the RGB-D image, if it is one.
    pub(crate) fn picture(&self) -> Option<&RgbdFrame> {
        match self {
            Image::Rgbd(frame) => Some(frame),
            Image::Layers(_) => None,
        }
    }
}

impl HologramRequest {
    /// Returns how views of the holograms of `image` become pictures. Layered depth images have amplitudes.
    pub(crate) fn view_colours(&self, display: &phasefront::Display, image: &Image) -> ViewColours {
        match image {
            Image::Rgbd(_) => ViewColours::new(self.image.frame.colours.viewed(), display),
            Image::Layers(_) => ViewColours::Amplitude,
        }
    }

    /// Reads the display on which the image is shown.
    pub(crate) fn display(&mut self) -> Result<DisplayFile> {
        self.image.display(&self.hologram.display)
    }

    /// Returns the method that the flags select.
    pub(super) fn method(&self) -> Method {
        if let Some(method) = self.method {
            return method;
        }
        match (&self.image.ldi, &self.hologram.network) {
            (Some(_), None) => Method::Layers,
            (Some(_), Some(_)) => Method::Core(CoreMethod::Network),
            (None, _) => Method::Core(self.hologram.method(None)),
        }
    }

    /// Refuses flags that the method does not take.
    fn check_flags(&self) -> Result<()> {
        use CoreMethod::{Auto, Network, Sweep};
        let method = self.method();
        let any = |of: &[CoreMethod]| matches!(method, Method::Core(core) if of.contains(&core));
        let (sweeps, trained) = (any(&[Sweep, Auto]), any(&[Network, Auto]));
        let planes = sweeps || matches!(method, Method::Layers | Method::Points);
        self.hologram.check_network(trained)?;
        check_used(&[
            (
                "--planes",
                self.planes.is_some(),
                planes,
                "--method sweep, auto, layers or points",
            ),
            ("--taps", self.taps.is_some(), sweeps, "--method sweep or auto"),
            (
                "--occlusion",
                self.occlusion.is_some(),
                method == Method::Points,
                "--method points",
            ),
        ])
    }

    /// Reads the image for `display`, and the distances that its depth shows.
    pub(crate) fn image(&self, display: &DisplayFile) -> Result<(Image, Option<ShownDepth>)> {
        self.check_flags()?;
        if let (Some(Method::Core(method)), Some(_)) = (self.method, &self.image.ldi)
            && method != CoreMethod::Network
        {
            return Err(Error::Usage(
                "--method sweep and auto take --rgb and --depth; for a layered depth image use --method layers or points, or a --network for layers"
                    .into(),
            ));
        }
        match &self.image.ldi {
            Some(dir) => {
                let ldi = Ldi::read(dir)?.for_display(&display.target.display).into_owned();
                Ok((Image::Layers(ldi), None))
            }
            None => {
                let (frame, shown) = self
                    .image
                    .frame
                    .read(&display.target.display, self.hologram.display.is_given())?;
                Ok((Image::Rgbd(frame), shown))
            }
        }
    }

    pub(super) fn encoder_options(&self, default: &EncoderOptions) -> EncoderOptions {
        EncoderOptions {
            brightness: self.scale.map_or(Brightness::FrameMax, Brightness::Fixed),
            ..default.clone()
        }
    }
}
