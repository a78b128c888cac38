//! The flags for an RGB-D image: from two files, from a photo with depth inside, or from any picture by a network that
//! estimates depth. Further flags place the image on the modulator.

use crate::flags::colours::ColourFlags;
use crate::flags::depth::DepthFlags;
use crate::given::SOURCE;
use clap::{ArgGroup, Args, ValueEnum, ValueHint};
use ndarray::{Array2, Array3};
use phasefront::Size;
use phasefront::input::{ColourScale, DepthNetwork};
use phasefront::{Display, RgbdFrame};
use phasefront_core::stage;
use phasefront_io::film::sequence::{self, Shows};
use phasefront_io::frame::fit::{Fit, Placement};
use phasefront_io::frame::{Captured, ShownDepth};
use phasefront_io::input::decode::{COLOUR_FORMATS, DEPTH_FORMATS};
use phasefront_io::input::quiet;
use phasefront_io::picture::colours::{self, Colours};
use phasefront_io::picture::photo;
use phasefront_io::{Error, Result, frame, output};
use serde_json::json;
use std::path::{Path, PathBuf};

/// The value of --depth for a picture on one plane.
const FLAT: &str = "flat";

/// An RGB-D image, the meaning of its depth, and its placement on the modulator.
#[derive(Default, Args)]
#[command(next_help_heading = "Input", group = ArgGroup::new(SOURCE).multiple(true))]
pub(crate) struct FrameFlags {
    #[arg(long, value_name = "FILE", group = SOURCE, conflicts_with = "photo", help = format!("Colour image: {COLOUR_FORMATS}"))]
    rgb: Option<PathBuf>,
    #[arg(
        long,
        value_name = "FILE",
        group = SOURCE,
        requires = "rgb",
        conflicts_with = "depth_network",
        help = format!("Depth image: {DEPTH_FORMATS}; or `flat` for a picture on one plane, at --z-mm")
    )]
    depth: Option<PathBuf>,
    /// Depth of the plane of --depth flat, mm from the middle of the volume, positive toward the viewer [default: 0]
    #[arg(long, value_name = "X", allow_negative_numbers = true, requires = "depth")]
    z_mm: Option<f64>,
    /// A phone's photo with depth inside: JPEG (GDepth, Dynamic Depth) or HEIC; with --depth-network any picture
    #[arg(long, value_name = "FILE", group = SOURCE, conflicts_with_all = ["depth_unit", "depth_scale"])]
    photo: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) colours: ColourFlags,
    #[command(flatten)]
    seen: SeenDepthFlags,
    /// Placement of the image on the modulator, which makes the hologram as large as the modulator [default: contain
    /// with --photo and for a picture that is wider and higher than the modulator; otherwise unchanged]. A warning
    /// appears if the image's size differs from that of the --display, or, without --display, if the image is larger
    /// than the default display
    #[arg(long, value_enum, help_heading = "Display")]
    fit: Option<FitName>,
    #[command(flatten)]
    depth_numbers: DepthFlags,
}

/// Depth that a network estimates, and the direction of depth.
#[derive(Clone, Default, Args)]
#[command(next_help_heading = "Depth")]
pub(crate) struct SeenDepthFlags {
    /// ONNX file of a network that estimates relative inverse depth from colour alone (docs/depth.md)
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath, conflicts_with_all = ["depth_unit", "depth_scale", "near", "far"])]
    depth_network: Option<PathBuf>,
    /// Scaling of the colours for --depth-network
    #[arg(long, value_enum, default_value_t = ColoursName::Imagenet, requires = "depth_network", help_heading = "Expert")]
    depth_network_colours: ColoursName,
    /// Swap near and far: for depth that is larger where it is nearer, and for --depth-network that gives distance
    #[arg(long)]
    invert: bool,
}

impl SeenDepthFlags {
    pub(crate) fn network(&self) -> Option<&Path> {
        self.depth_network.as_deref()
    }

    pub(crate) fn invert(&self) -> bool {
        self.invert
    }

    /// Opens the network that the flags name, if there is one, and plans it for pictures of `size`.
    pub(crate) fn open(&self, size: Size) -> Result<Option<DepthNetwork>> {
        let Some(path) = self.network() else {
            return Ok(None);
        };
        output::reading(path)?;
        if !path.exists() {
            return Err(Error::file(
                path,
                "there is no such file; --depth-network takes an ONNX file",
            ));
        }
        // tract panics on files that it does not expect. The network keeps the plan.
        let opened = quiet::caught(|| {
            let mut network = DepthNetwork::open(path)?;
            network.colours = self.depth_network_colours.scale();
            network.gives_distance = self.invert;
            network.estimator(size).map(|_| network)
        });
        let network = opened.map_err(|why| Error::file(path, why))?;
        network.map(Some).map_err(|why| Error::file(path, why))
    }
}

#[derive(Clone, Copy, Default, ValueEnum)]
enum ColoursName {
    #[default]
    /// By ImageNet's mean and spread: MiDaS, DPT, Depth Anything
    Imagenet,
    /// From 0 to 1
    Unit,
    /// From -1 to 1
    Signed,
}

impl ColoursName {
    fn scale(self) -> ColourScale {
        match self {
            ColoursName::Imagenet => ColourScale::Imagenet,
            ColoursName::Unit => ColourScale::Unit,
            ColoursName::Signed => ColourScale::Signed,
        }
    }
}

#[derive(Clone, Copy, ValueEnum)]
enum FitName {
    /// The whole image, in the middle, with black around it
    Contain,
    /// The part of the image that fills the modulator
    Cover,
    /// Pixel for pixel, in the middle
    Centre,
}

impl FitName {
    fn fit(self) -> Fit {
        match self {
            FitName::Contain => Fit::Contain,
            FitName::Cover => Fit::Cover,
            FitName::Centre => Fit::Centre,
        }
    }
}

/// A picture in a folder.
pub(crate) struct Picture {
    /// The file's name without its last extension.
    pub name: String,
    /// The colour file, and the depth file if depth is separate. If one of them is missing, only the other.
    pub(crate) files: Vec<PathBuf>,
    pub(crate) is_whole: bool,
}

fn of_one_folder(folder: &Path) -> Result<Vec<Picture>> {
    let found = sequence::images(folder, Shows::Colour)?
        .into_iter()
        .map(|(name, path)| Picture {
            name: name.text,
            files: vec![path],
            is_whole: true,
        });
    Ok(found.collect())
}

fn of_two_folders(colour: &Path, depth: &Path) -> Result<Vec<Picture>> {
    let found = sequence::by_name(colour, depth)?;
    let pairs = found.pairs.into_iter().map(|(name, colour, depth)| Picture {
        name,
        files: vec![colour, depth],
        is_whole: true,
    });
    let alone = found.alone.into_iter().map(|path| Picture {
        name: path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        files: vec![path],
        is_whole: false,
    });
    Ok(pairs.chain(alone).collect())
}

/// Warns if a hologram of `size` does not have the size of its modulator, and suggests `flag`. If no display was
/// `named`, the default display stands in, and any smaller hologram may lie in its middle.
pub(crate) fn warn_of_size(size: Size, display: &Display, named: bool, flag: &str) {
    let modulator = display.size();
    let larger = size.height > modulator.height || size.width > modulator.width;
    if larger || named && size != modulator {
        let whose = if named { "modulator" } else { "default modulator" };
        log::warn!(
            "the hologram is {size} as the image is, the {whose} {modulator}: {flag} makes the whole modulator's"
        );
    }
}

/// Returns the distances that depth shows as JSON.
pub(crate) fn shown_json(shown: Option<ShownDepth>) -> serde_json::Value {
    let rounded = |value: f64| (value * 1e6).round() / 1e6;
    json!(shown.map(|shown| json!({
        "near_m": rounded(shown.near_m.into()), "far_m": rounded(shown.far_m.into()), "holes": rounded(shown.holes),
    })))
}

/// Returns the distances that depth shows as the end of a line.
pub(crate) fn shown_text(shown: Option<ShownDepth>) -> String {
    shown.map_or(String::new(), |shown| format!("; {shown}"))
}

impl FrameFlags {
    /// Returns the pictures of the folders that --rgb and --depth, or --photo, name, or `None` if they name files.
    pub(crate) fn pictures(&self) -> Result<Option<Vec<Picture>>> {
        let is_folder = |path: &Option<PathBuf>| path.as_ref().is_some_and(|path| path.is_dir());
        let (rgb, depth) = (is_folder(&self.rgb), is_folder(&self.depth));
        let flat = self.is_flat();
        if let Some(folder) = self.photo.as_deref().filter(|path| path.is_dir()) {
            return of_one_folder(folder).map(Some);
        }
        match (&self.rgb, &self.depth) {
            (Some(colour), Some(depths)) if rgb && depth => of_two_folders(colour, depths).map(Some),
            (Some(colour), None) if rgb => of_one_folder(colour).map(Some),
            (Some(colour), Some(_)) if rgb && flat => of_one_folder(colour).map(Some),
            (Some(_), Some(_)) if rgb || depth => Err(Error::Usage(
                "--rgb and --depth name two files, or two folders of files with equal names".into(),
            )),
            _ => Ok(None),
        }
    }

    /// Returns the files, or the folders that [`Self::pictures`] reads.
    pub(crate) fn folders(&self) -> impl Iterator<Item = &Path> {
        let depth = self.depth.as_deref().filter(|_| !self.is_flat());
        [self.rgb.as_deref(), depth, self.photo.as_deref()]
            .into_iter()
            .flatten()
    }

    /// Selects one picture of a folder.
    pub(crate) fn take(&mut self, picture: &Picture) {
        let mut files = picture.files.iter().cloned();
        if self.photo.is_some() {
            self.photo = files.next();
        } else {
            self.rgb = files.next();
            if !self.is_flat() {
                self.depth = files.next();
            }
        }
    }

    fn is_flat(&self) -> bool {
        self.depth.as_ref().is_some_and(|depth| depth.as_os_str() == FLAT)
    }

    /// Returns the file of the picture.
    pub(crate) fn source(&self) -> Option<&Path> {
        self.photo.as_deref().or(self.rgb.as_deref())
    }

    /// Reads the frame for `display`, in the colours of its lasers, and the distances that its depth shows. `named`
    /// tells whether the display was given by a flag.
    pub(crate) fn read(&self, display: &Display, named: bool) -> Result<(RgbdFrame, Option<ShownDepth>)> {
        if let Some(folder) = self.folders().find(|path| path.is_dir()) {
            return Err(Error::file(
                folder,
                "is a folder; name one picture. `phasefront hologram` takes folders of pictures",
            ));
        }
        let asked = self.colours.asked();
        let mut distances = None;
        let (frame, encoding) = match (&self.rgb, &self.depth, &self.photo) {
            (Some(rgb), Some(_), _) if self.is_flat() => {
                let (Colours { rgb, encoding }, _) = colours::read(rgb, asked)?;
                (self.flat(&rgb, display)?, encoding)
            }
            (Some(_), Some(_), _) if self.z_mm.is_some() => {
                return Err(Error::Usage(
                    "--z-mm is for --depth flat; a depth image has depths of its own".into(),
                ));
            }
            (Some(rgb), Some(depth), _) => {
                let options = self.depth_numbers.options(self.seen.invert)?;
                let Captured {
                    rgb,
                    encoding,
                    depth,
                    shown,
                } = frame::read(rgb, depth, options, asked)?;
                distances = shown;
                (self.conditioned(&rgb, depth, display)?, encoding)
            }
            (Some(rgb), None, _) => {
                let (Colours { rgb, encoding }, _) = colours::read(rgb, asked)?;
                (self.by_network(&rgb, display)?, encoding)
            }
            (None, _, Some(path)) if self.seen.network().is_some() => {
                let (Colours { rgb, encoding }, _) = colours::read(path, asked)?;
                (self.by_network(&rgb, display)?, encoding)
            }
            (None, _, Some(path)) => {
                let photo = photo::read(path, asked)?;
                (self.of_photo(path, &photo, display)?, photo.colours.encoding)
            }
            _ => {
                return Err(Error::Usage(
                    "an image is needed: --rgb with --depth, --depth flat or --depth-network, or --photo".into(),
                ));
            }
        };
        warn_of_size(frame.size(), display, named, "--fit contain, cover or centre");
        Ok((frame.decoded(encoding, display), distances))
    }

    /// Shows the whole picture as large as the modulator if the command line does not place it.
    pub(crate) fn contain_by_default(&mut self) {
        self.fit.get_or_insert(FitName::Contain);
    }

    fn placement(&self, picture: Size, display: &Display) -> Placement {
        let modulator = display.size();
        let is_larger = picture.width > modulator.width && picture.height > modulator.height;
        if self.fit.is_none() && is_larger {
            log::warn!(
                "the picture is {picture} and is fitted into the modulator's {modulator}; --fit cover or centre fills it, --display names a larger one"
            );
        }
        let default = (self.photo.is_some() || is_larger).then_some(Fit::Contain);
        match self.fit.map(FitName::fit).or(default) {
            Some(fit) => Placement::new(picture, display.size(), fit),
            None => Placement::as_is(picture),
        }
    }

    /// Makes the frame of normalized depth, which --invert turns over.
    fn conditioned(&self, rgb: &Array3<f32>, mut depth: Array2<f32>, display: &Display) -> Result<RgbdFrame> {
        if self.seen.invert {
            depth.mapv_inplace(|d| 1.0 - d);
        }
        let (_, height, width) = rgb.dim();
        let _stage = stage!("depth");
        frame::conditioned(rgb, &depth, &self.placement(Size { width, height }, display))
    }

    /// Makes the frame of a picture on one plane, at --z-mm.
    fn flat(&self, rgb: &Array3<f32>, display: &Display) -> Result<RgbdFrame> {
        if self.seen.invert {
            return Err(Error::Usage(
                "--invert has no meaning with --depth flat; --z-mm moves its plane".into(),
            ));
        }
        let (_, height, width) = rgb.dim();
        let (z_mm, half_mm) = (self.z_mm.unwrap_or(0.0), 500.0 * display.volume_depth_m());
        if !(-half_mm..=half_mm).contains(&z_mm) {
            return Err(Error::Usage(format!(
                "--z-mm {z_mm} lies outside the volume, from {} mm to {half_mm} mm",
                -half_mm
            )));
        }
        let placement = self.placement(Size { width, height }, display);
        let depth = (0.5 - z_mm / (2.0 * half_mm)) as f32;
        let depth = Array2::from_elem(placement.inner().shape(), depth);
        placement.frame(placement.colour(rgb.view()), depth)
    }

    /// Makes the frame of a photo: from its distances if --near or --far is given, else from d_n unchanged.
    fn of_photo(&self, path: &Path, photo: &photo::Photo, display: &Display) -> Result<RgbdFrame> {
        let options = self.depth_numbers.options(self.seen.invert)?;
        let depth = match (options.near_m, options.far_m, photo.metres()) {
            (None, None, _) => frame::relative(photo.depth.view(), None, None),
            (near, far, Some(metres)) => frame::relative(metres.view(), near, far),
            _ => {
                return Err(Error::file(
                    path,
                    "does not say its depth's range in metres; leave out --near and --far",
                ));
            }
        };
        let depth = depth.map_err(|e| Error::file(path, e))?;
        self.conditioned(&photo.colours.rgb, depth, display)
    }

    fn by_network(&self, rgb: &Array3<f32>, display: &Display) -> Result<RgbdFrame> {
        let (_, height, width) = rgb.dim();
        let (Some(path), Some(network)) = (self.seen.network(), self.seen.open(Size { width, height })?) else {
            return Err(Error::Usage(
                "--rgb needs --depth, --depth-network that estimates it (docs/depth.md says how to make one), or --depth flat for a picture on one plane"
                    .into(),
            ));
        };
        let colours = rgb.as_standard_layout();
        let nearer = quiet::caught(|| {
            let estimator = network.estimator(Size { width, height })?;
            estimator.estimate(colours.as_slice().expect("standard layout"))
        });
        let nearer = nearer
            .map_err(|why| Error::file(path, why))?
            .map_err(|why| Error::file(path, why))?;
        let depth = frame::relative(nearer.mapv(|v| -v).view(), None, None).map_err(|e| Error::file(path, e))?;
        frame::conditioned(rgb, &depth, &self.placement(Size { width, height }, display))
    }
}
