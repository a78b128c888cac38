//! The request for a hologram: the flags for its image and its method.

use crate::flags::backend::BackendFlags;
use crate::flags::colours::ColourFlags;
use crate::flags::encoder::EncoderFlags;
use crate::flags::frame::{FrameFlags, IMAGE_FLAGS, Picture};
use crate::flags::method::CoreMethod;
use crate::record::RunRecord;
use clap::builder::PossibleValue;
use clap::{Args, ValueEnum, ValueHint};
use phasefront::{Brightness, EncoderOptions, RgbdFrame};
use phasefront_command::flags::{DisplayFlags, PrecisionName, check_used};
use phasefront_core::view::colours::ViewColours;
use phasefront_exact::point_based::Occlusion;
use phasefront_io::display::DisplayFile;
use phasefront_io::frame::ShownDepth;
use phasefront_io::ldi::Ldi;
use phasefront_io::{Error, Result};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// The flags for a method, for flags that conflict with them. clap makes no group of a struct that holds others.
pub(crate) const METHOD_FLAGS: [&str; 10] = [
    "ldi",
    "method",
    "network",
    "precision",
    "planes",
    "taps",
    "occlusion",
    "scale",
    "EncoderFlags",
    "BackendFlags",
];

/// The flags for a hologram's image and method.
#[derive(Default, Args)]
#[command(next_help_heading = "Method")]
pub(crate) struct HologramRequest {
    #[command(flatten)]
    pub(super) frame: FrameFlags,
    /// Folder of a layered depth image, for --method layers and points, and for a --network that takes layers
    #[arg(long, value_name = "DIR", conflicts_with_all = IMAGE_FLAGS, help_heading = "Input")]
    pub(super) ldi: Option<PathBuf>,
    /// Method for the midpoint hologram [default: auto; network with --network or --encoder deep, layers with --ldi and
    /// no --network]
    #[arg(long, value_enum, help_heading = "Method")]
    pub(super) method: Option<Method>,
    /// A bundled network (`phasefront networks` lists them), or an ONNX file [default: 8]
    #[arg(long, value_name = "NAME|FILE", value_hint = ValueHint::FilePath, help_heading = "Method")]
    pub(super) network: Option<String>,
    /// Number type of a bundled network [default: int8]
    #[arg(long, value_enum, help_heading = "Expert")]
    pub(super) precision: Option<PrecisionName>,
    /// Number of planes for --method layers and points [default: 256] and sweep [default: chosen for the display]
    #[arg(long, value_name = "N", help_heading = "Expert")]
    pub(super) planes: Option<usize>,
    /// Number of taps of the filter from plane to plane, for --method sweep [default: chosen for planes and display]
    #[arg(long, value_name = "N", help_heading = "Expert")]
    pub(super) taps: Option<usize>,
    /// Treatment of occlusion for --method points [default: geometric]
    #[arg(long, value_enum, help_heading = "Expert")]
    pub(super) occlusion: Option<OcclusionName>,
    #[command(flatten)]
    pub(super) encoder: EncoderFlags,
    /// Amplitude that full light stands for [default: the largest of the image]
    #[arg(long, value_name = "A", help_heading = "Expert")]
    pub(super) scale: Option<f32>,
    #[command(flatten)]
    pub(super) backend: BackendFlags,
    #[command(flatten)]
    pub(crate) display: DisplayFlags,
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
pub(super) enum OcclusionName {
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

impl HologramRequest {
    /// Creates a request for `display` without flags for an image.
    pub(crate) fn new(display: DisplayFlags) -> Self {
        HologramRequest {
            display,
            ..Self::default()
        }
    }

    /// Changes the method, network and encoder for the same image.
    pub(crate) fn set_method(&mut self, method: Method, network: Option<String>, encoder: EncoderFlags) {
        (self.method, self.network, self.encoder) = (Some(method), network, encoder);
        (self.planes, self.precision) = (None, None);
    }

    /// Sets the meaning of the image's colours, in which views show it.
    pub(crate) fn set_colours(&mut self, colours: ColourFlags) {
        self.frame.set_colours(colours);
    }

    /// Records the meaning of the image's colours.
    pub(crate) fn record_colours(&self, record: &mut RunRecord) {
        self.frame.colours().record(record);
    }

    /// Returns how views of the holograms of `image` become pictures. Layered depth images have amplitudes.
    pub(crate) fn view_colours(&self, display: &phasefront::Display, image: &Image) -> ViewColours {
        match image {
            Image::Rgbd(_) => ViewColours::new(self.frame.colours().viewed(), display),
            Image::Layers(_) => ViewColours::Amplitude,
        }
    }

    /// Sets the number of planes.
    pub(crate) fn with_planes(&mut self, planes: usize) {
        self.planes = Some(planes);
    }

    /// Selects floating point for the network.
    pub(crate) fn in_float32(&mut self) {
        self.precision = Some(PrecisionName::F32);
    }

    pub(crate) fn display(&self) -> Result<DisplayFile> {
        match self.ldi {
            Some(_) => self.display.read(),
            None => self.frame.colours().display(&self.display),
        }
    }

    /// Returns the pictures of the folders, or `None` if the flags name no folders.
    pub(crate) fn pictures(&self) -> Result<Option<Vec<Picture>>> {
        self.frame.pictures()
    }

    /// Returns the folders of the pictures.
    pub(crate) fn folders(&self) -> impl Iterator<Item = &Path> {
        self.frame.folders()
    }

    /// Selects one picture of a folder.
    pub(crate) fn take(&mut self, picture: &Picture) {
        self.frame.take(picture);
    }

    pub(crate) fn is_for_a_display(&self) -> bool {
        self.display.is_given()
    }

    pub(crate) fn display_if_given(&self) -> Result<Option<DisplayFile>> {
        self.display.read_if_given()
    }

    /// Returns the file of the image.
    pub(crate) fn source(&self) -> Option<&Path> {
        self.ldi.as_deref().or(self.frame.source())
    }

    /// Returns the method that the flags select.
    pub(super) fn method(&self) -> Method {
        if let Some(method) = self.method {
            return method;
        }
        match (&self.ldi, self.network.as_deref()) {
            (Some(_), None) => Method::Layers,
            (Some(_), Some(_)) => Method::Core(CoreMethod::Network),
            (None, network) => Method::Core(CoreMethod::or_default(None, network, &self.encoder)),
        }
    }

    /// Refuses flags that the method does not take.
    fn check_flags(&self) -> Result<()> {
        use CoreMethod::{Auto, Network, Sweep};
        let method = self.method();
        let any = |of: &[CoreMethod]| matches!(method, Method::Core(core) if of.contains(&core));
        let (sweeps, trained) = (any(&[Sweep, Auto]), any(&[Network, Auto]));
        let planes = sweeps || matches!(method, Method::Layers | Method::Points);
        let network = "--method network or auto";
        check_used(&[
            ("--network", self.network.is_some(), trained, network),
            ("--precision", self.precision.is_some(), trained, network),
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
        if let (Some(Method::Core(method)), Some(_)) = (self.method, &self.ldi)
            && method != CoreMethod::Network
        {
            return Err(Error::Input(
                "--method sweep and auto take --rgb and --depth; for a layered depth image use --method layers or points, or a --network for layers"
                    .into(),
            ));
        }
        match &self.ldi {
            Some(dir) => {
                let ldi = Ldi::read(dir)?.for_display(&display.target.display).into_owned();
                Ok((Image::Layers(ldi), None))
            }
            None => {
                let (frame, shown) = self.frame.read(&display.target.display, self.display.is_given())?;
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
