//! The hologram network. It is loaded from ONNX, checked to be the paper's residual chain, and run on frames of any
//! size.
//!
//! [`Network`] describes a file. [`Network::plan`] prepares it for one frame size. [`NetworkPlan::field`] turns the
//! rows of a [`Source`] into rows of a complex field. [`NetworkPlan::run`] turns input planes into output planes, which
//! [`Head::field`] turns into a field. [`chain`] defines the chain; [`mod@reference`] runs it naively and is the oracle
//! of every fast path. The fast path is the crate `phasefront-kernels`. Chains that it does not support run on stock
//! tract; [`NetworkPlan::engine`] reports the path. A file of any other form that declares its inputs and output (the
//! module `own`) runs on tract too.

pub mod bounds;
pub mod chain;
mod filter;
mod fused;
#[cfg(feature = "tract")]
pub(crate) mod graph;
mod head;
mod metadata;
mod onnx;
#[cfg(feature = "tract")]
mod operator;
#[cfg(feature = "tract")]
mod own;
mod proto;
pub mod reference;
mod rgbd;
#[cfg(feature = "tract")]
mod stock;
mod tensor;

use crate::Size;
pub use chain::Precision;
pub use filter::{FilterPlan, FilterScratch};
pub use head::Head;
use metadata::{Description, Served};
pub use metadata::{InputKind, TrainedDisplay};

use crate::display::Display;
use crate::method::standing::Changes;
use crate::runtime::cancel::Cancel;
use crate::runtime::error::Error;
use crate::runtime::error::Result;
use chain::Chain;
use fused::{FieldOf, FusedChain, FusedScratch};
pub use fused::{Int8Layers, int8_layers};
use num_complex::Complex32;
pub use phasefront_kernels::Isa;
use prost::Message;
#[cfg(feature = "tract")]
use stock::StockPlan;

/// The largest number of pixels of a frame on tract, which keeps several layers in memory at once: about 500 bytes for
/// each pixel.
#[cfg(feature = "tract")]
const MAX_STOCK_PIXELS: usize = 1 << 24;
/// The largest number of pixels of a frame on any path.
pub const MAX_PIXELS: usize = 1 << 28;

/// Input planes of a network, read in runs of a row's pixels. Their layout in memory can differ from the network's.
pub trait Source: Sync {
    /// Writes pixels of `row` of `plane`, starting at column `from`, into `into`. Planes are numbered as in
    /// [`InputKind`].
    fn read(&self, plane: usize, row: usize, from: usize, into: &mut [f32]);
}

/// The input planes for another display: depth, from which ½ is already subtracted, is multiplied by a scale.
struct Stretched<'a, S: ?Sized> {
    source: &'a S,
    input: InputKind,
    depth_scale: f32,
}

impl<S: Source + ?Sized> Source for Stretched<'_, S> {
    #[inline(always)]
    fn read(&self, plane: usize, row: usize, from: usize, into: &mut [f32]) {
        self.source.read(plane, row, from, into);
        if self.depth_scale != 1.0 && self.input.is_depth(plane) {
            into.iter_mut().for_each(|d| *d *= self.depth_scale);
        }
    }
}

/// A network read from an ONNX file, with its input and output formats and the display it was trained for.
pub struct Network {
    form: Form,
    display: TrainedDisplay,
}

/// What a network computes.
enum Form {
    Chain(Box<OfChain>),
    #[cfg(feature = "tract")]
    Own(Box<own::OwnNetwork>),
}

/// A chain, which the kernels run.
struct OfChain {
    chain: Chain,
    input: InputKind,
    head: Head,
    seed_planes: Option<usize>,
    #[cfg(feature = "tract")]
    onnx: Box<[u8]>,
}

impl std::fmt::Debug for Network {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (layers, filters) = (self.layers(), self.filters());
        let (input, precision) = (self.input(), self.precision());
        write!(f, "Network({input}, {layers} layers of {filters} filters, {precision})")
    }
}

impl Network {
    /// Reads the bytes of an ONNX file and checks that they hold a hologram network: the residual chain of [`chain`],
    /// in f32 or quantised to int8 with QuantizeLinear/DequantizeLinear pairs, with `phasefront.*` metadata. A graph of
    /// any other form, whose metadata has `phasefront.output`, runs on tract.
    ///
    /// # Errors
    /// Returns [`Error::Network`] with the name of the wrong node, tensor or metadata and the expected value, or if the
    /// file has more than 2²⁸ bytes or 2¹⁷ parts. Reading a chain allocates at most 4 times the file size plus 200 MB.
    pub fn from_onnx(bytes: &[u8]) -> Result<Network> {
        bounds::check(bytes)?;
        let model = proto::Model::decode(bytes)
            .map_err(|why| Error::Network(format!("not an ONNX file, or a truncated one: {why}")))?;
        let graph = model
            .graph
            .as_ref()
            .ok_or_else(|| Error::Network("not an ONNX file: it holds no graph".into()))?;
        if metadata::is_own(&model.metadata_props) {
            return Self::own(bytes, &model);
        }
        let chain = onnx::chain(graph).map_err(|why| match why {
            Error::Network(why) if metadata::found(&model.metadata_props, "head").is_none() => Error::Network(format!(
                "{why}; a network of another form needs metadata 'phasefront.output' (docs/own-networks.md)"
            )),
            other => other,
        })?;
        let Description {
            input,
            head,
            display,
            seed_planes,
        } = metadata::read(&model.metadata_props)?;
        if chain.inputs != input.channels() {
            return Err(Error::Network(format!(
                "phasefront.input is '{input}' with {} channels, but the graph's input has {}",
                input.channels(),
                chain.inputs
            )));
        }
        if chain.outputs() != 6 {
            return Err(Error::Network(format!(
                "{} output channels; 6 are right, two a colour",
                chain.outputs()
            )));
        }
        if chain.halved && input.is_field() {
            return Err(Error::Network(format!(
                "a network for '{input}' is a pre-filter, which runs at the whole resolution: no SpaceToDepth is right"
            )));
        }
        match (head, chain.tanh) {
            (Head::AmplitudePhase, false) => {
                return Err(Error::Network(
                    "phasefront.head 'amplitude-phase' needs a Tanh as the last node".into(),
                ));
            }
            (Head::RealImaginary, true) => {
                return Err(Error::Network(
                    "phasefront.head 'real-imaginary' takes no Tanh as the last node".into(),
                ));
            }
            _ => {}
        }
        Ok(Network {
            form: Form::Chain(Box::new(OfChain {
                chain,
                input,
                head,
                seed_planes,
                #[cfg(feature = "tract")]
                onnx: bytes.into(),
            })),
            display,
        })
    }

    /// Reads a graph of any form, which the metadata of `model` describes.
    #[cfg(feature = "tract")]
    fn own(bytes: &[u8], model: &proto::Model) -> Result<Network> {
        let (contract, display) = own::contract::read(&model.metadata_props)?;
        let graph = own::OwnNetwork::new(bytes, model.graph.as_ref(), contract)?;
        Ok(Network {
            form: Form::Own(Box::new(graph)),
            display,
        })
    }

    #[cfg(not(feature = "tract"))]
    fn own(_: &[u8], _: &proto::Model) -> Result<Network> {
        Err(Error::Network(
            "tract would run a network of this form, but this library was built without its feature 'tract'".into(),
        ))
    }

    fn of_chain(&self) -> Option<&OfChain> {
        match &self.form {
            Form::Chain(of_chain) => Some(of_chain),
            #[cfg(feature = "tract")]
            Form::Own(_) => None,
        }
    }

    /// Returns the chain that the kernels run.
    fn needed(&self) -> Result<&OfChain> {
        self.of_chain().ok_or_else(|| {
            Error::Network("it has a form that tract alone runs; a chain of 3×3 convolutions is right here".into())
        })
    }

    /// Returns the chain: layers, filters, weights, quantisation. `None` for a network of another form.
    #[doc(hidden)]
    pub fn chain(&self) -> Option<&Chain> {
        self.of_chain().map(|of| &of.chain)
    }

    /// Returns the number of convolutions.
    pub fn layers(&self) -> usize {
        match &self.form {
            Form::Chain(of) => of.chain.layers.len(),
            #[cfg(feature = "tract")]
            Form::Own(own) => own.layers,
        }
    }

    /// Returns the number of filters of each hidden layer, or of the widest convolution of a network of another form.
    pub fn filters(&self) -> usize {
        match &self.form {
            Form::Chain(of) => of.chain.filters(),
            #[cfg(feature = "tract")]
            Form::Own(own) => own.filters,
        }
    }

    /// Returns the number format of the layers: `f32` or `int8`, or `own` for a network of another form, which runs in
    /// the formats that its file names.
    pub fn precision(&self) -> &'static str {
        self.of_chain().map_or("own", |of| of.chain.precision.name())
    }

    /// Returns the kind of the input planes. A network of another form than a chain takes RGB-D.
    #[doc(hidden)]
    pub fn input(&self) -> InputKind {
        self.of_chain().map_or(InputKind::Rgbd, |of| of.input)
    }

    /// Returns whether the output is the modulator's phase, which no encoding may change.
    #[doc(hidden)]
    pub fn gives_phase(&self) -> bool {
        match &self.form {
            Form::Chain(_) => false,
            #[cfg(feature = "tract")]
            Form::Own(own) => own.gives_phase(),
        }
    }

    /// Returns how the network supports `display`.
    fn serve(&self, display: &Display) -> Result<Served> {
        match &self.form {
            Form::Chain(_) => self.display.serve(display),
            #[cfg(feature = "tract")]
            Form::Own(own) => own.serve(&self.display, display),
        }
    }

    /// Returns the kind of the output planes of a chain.
    #[doc(hidden)]
    pub fn head(&self) -> Option<Head> {
        self.of_chain().map(|of| of.head)
    }

    /// Returns the display that the network was trained for.
    #[doc(hidden)]
    pub fn display(&self) -> &TrainedDisplay {
        &self.display
    }

    /// Returns the factor, from 0 to 1, by which depths of frames for `display` are stretched about the middle of the
    /// volume so that this network computes their hologram. It is λ·V/p² divided by that of the trained display. To
    /// paraxial order, a hologram without its carrier depends on λ·z/p² alone.
    ///
    /// # Errors
    /// Returns [`Error::Network`] if the display has a larger λ·V/p², or if the factors of its lasers differ by more
    /// than 5 %.
    #[doc(hidden)]
    pub fn depth_scale(&self, display: &Display) -> Result<f32> {
        Ok(depth_scale(self.serve(display)?))
    }

    /// Returns the output colour that is the field of a `display` with one laser: 0 red, 1 green, 2 blue. It is the
    /// nearest colour whose trained depths cover the display's range. Returns `None` for a display with three lasers.
    ///
    /// # Errors
    /// Returns the same errors as [`Self::depth_scale`].
    #[doc(hidden)]
    pub fn colour(&self, display: &Display) -> Result<Option<usize>> {
        Ok(self.serve(display)?.colour)
    }

    /// Checks that the network supports `display`.
    ///
    /// # Errors
    /// Returns the same errors as [`Self::depth_scale`].
    pub fn check_display(&self, display: &Display) -> Result<()> {
        self.depth_scale(display).map(|_| ())
    }

    /// Checks that this pre-filter supports `display` and its offset, for which λ·offset/p² must equal the trained
    /// value.
    ///
    /// # Errors
    /// Returns the same errors as [`Self::depth_scale`], and an error if the offset differs by more than 20 µm at the
    /// trained pitch.
    #[doc(hidden)]
    pub fn check_prefilter(&self, display: &Display) -> Result<()> {
        self.display.check_offset(display)
    }

    /// Returns the number of planes of the sweep that a seeded network was trained to correct, if its file gives it.
    pub fn seed_planes(&self) -> Option<usize> {
        self.of_chain().and_then(|of| of.seed_planes)
    }

    /// Plans like [`Self::plan`] for the depths and colours of `display`. For one laser, the network reads its
    /// amplitude as red, green and blue, and only the output of [`Self::colour`] is kept.
    ///
    /// # Errors
    /// Returns the same errors as [`Self::plan`] and [`Self::depth_scale`].
    #[doc(hidden)]
    pub fn plan_for(&self, size: Size, display: &Display) -> Result<NetworkPlan> {
        let served = self.serve(display)?;
        Ok(NetworkPlan {
            depth_scale: depth_scale(served),
            colour: served.colour,
            ..self.plan(size)?
        })
    }

    /// Prepares the network for frames of `size` whose depth is for the trained display, on the
    /// fastest path that supports the network.
    ///
    /// # Errors
    /// Returns [`Error::Setting`] if a frame is empty or too large, and [`Error::Network`] if the path rejects the
    /// graph.
    #[doc(hidden)]
    pub fn plan(&self, size: Size) -> Result<NetworkPlan> {
        Isa::of_variable().map_err(Error::Setting)?;
        match &self.form {
            Form::Chain(of) => self.chain_plan(size, of),
            #[cfg(feature = "tract")]
            Form::Own(own) => self.own_plan(size, own),
        }
    }

    /// Prepares a chain on the kernels, or on tract if they do not support it.
    fn chain_plan(&self, size: Size, of: &OfChain) -> Result<NetworkPlan> {
        match FusedChain::new(&of.chain, None) {
            Ok(chain) => self.fused_plan(size, of, chain),
            #[cfg(feature = "tract")]
            Err(why) => {
                let mut plan = self.plan_on_stock_tract(size)?;
                plan.engine.why = why;
                Ok(plan)
            }
            #[cfg(not(feature = "tract"))]
            Err(why) => Err(Error::Network(format!(
                "{why}; tract would run it, but this library was built without its feature 'tract'"
            ))),
        }
    }

    /// Prepares the network on the kernels of one instruction set.
    ///
    /// # Errors
    /// Returns the same errors as [`Network::plan`], and [`Error::Setting`] if the processor or the kernels do not
    /// support it.
    #[doc(hidden)]
    pub fn plan_on(&self, isa: Isa, size: Size) -> Result<NetworkPlan> {
        let of = self.needed()?;
        let chain = FusedChain::new(&of.chain, Some(isa));
        self.fused_plan(
            size,
            of,
            chain.map_err(|why| Error::Setting(format!("network: {why}")))?,
        )
    }

    /// Prepares a network of another form than a chain.
    #[cfg(feature = "tract")]
    fn own_plan(&self, size: Size, own: &own::OwnNetwork) -> Result<NetworkPlan> {
        check_size(size, MAX_STOCK_PIXELS)?;
        Ok(NetworkPlan {
            input: InputKind::Rgbd,
            depth_scale: 1.0,
            colour: own.only_colour(),
            z_m: self.display.offset_m,
            height: size.height,
            width: size.width,
            path: Path::Own(own.plan(size)?),
            engine: Engine {
                name: "tract",
                isa: None,
                why: format!(
                    "{} convolutions of another form than the kernels': tract runs them, on one thread and slowly",
                    own.layers
                ),
            },
        })
    }

    fn fused_plan(&self, size: Size, of: &OfChain, chain: FusedChain) -> Result<NetworkPlan> {
        let Size { width, height } = size;
        check_size(size, MAX_PIXELS)?;
        let engine = of.fused_engine(&chain);
        Ok(NetworkPlan {
            input: of.input,
            depth_scale: 1.0,
            colour: None,
            z_m: 0.0,
            height,
            width,
            path: Path::Fused(chain, of.head),
            engine,
        })
    }

    /// Prepares a network that filters fields of `size`, (3, H, W), in place, on the fastest kernels. The caller
    /// applies the blur that the input may require ([`InputKind::is_blurred`]).
    ///
    /// # Errors
    /// Returns [`Error::Network`] if the network does not take a field or the kernels do not support it, and
    /// [`Error::Setting`] if a field is empty or too large.
    #[doc(hidden)]
    pub fn filter_plan(&self, size: Size) -> Result<FilterPlan> {
        let of = self.needed()?;
        if !of.input.is_field() {
            return Err(Error::Network(format!(
                "a pre-filter takes 'field', this network '{}'",
                of.input
            )));
        }
        let chain =
            FusedChain::new(&of.chain, None).map_err(|why| Error::Network(format!("as a pre-filter: {why}")))?;
        check_size(size, MAX_PIXELS)?;
        Ok(FilterPlan {
            engine: of.fused_engine(&chain),
            chain,
            input: of.input,
            head: of.head,
            colour: None,
            size,
        })
    }

    /// Plans like [`Self::filter_plan`] for the colours of `display`. For one laser the field is (1, H, W),
    /// handled as in [`Self::plan_for`].
    ///
    /// # Errors
    /// Returns the same errors as [`Self::filter_plan`] and [`Self::depth_scale`].
    pub(crate) fn filter_plan_for(&self, size: Size, display: &Display) -> Result<FilterPlan> {
        Ok(FilterPlan {
            colour: self.colour(display)?,
            ..self.filter_plan(size)?
        })
    }

    /// Returns the network as a tract graph for any frame size, with its chain as one fused operator, for use in larger
    /// graphs. [`Network::plan`] runs the same kernels on the caller's memory, without tract's copies.
    ///
    /// # Errors
    /// Returns [`Error::Network`] if the kernels do not support the chain or tract rejects the graph.
    #[cfg(feature = "tract")]
    pub fn tract_model(&self) -> Result<tract_onnx::prelude::TypedModel> {
        let of = self.needed()?;
        let chain = FusedChain::new(&of.chain, None).map_err(Error::Network)?;
        operator::model(&of.input.to_string(), chain, of.chain.inputs)
    }

    /// Prepares the network on stock tract even if the fast path supports it, as an independent check of that path.
    ///
    /// # Errors
    /// Returns the same errors as [`Network::plan`].
    #[cfg(feature = "tract")]
    pub fn plan_on_stock_tract(&self, size: Size) -> Result<NetworkPlan> {
        let Size { width, height } = size;
        let of = self.needed()?;
        check_size(size, MAX_STOCK_PIXELS)?;
        if of.chain.halved && (height % 2 == 1 || width % 2 == 1) {
            return Err(Error::Network(format!(
                "a network at half the resolution takes frames of even sides on tract, not {width}×{height}"
            )));
        }
        let plan = StockPlan::new(&of.onnx, [1, of.chain.inputs, height, width])?;
        Ok(NetworkPlan {
            input: of.input,
            depth_scale: 1.0,
            colour: None,
            z_m: 0.0,
            height,
            width,
            path: Path::Stock(plan, of.head),
            engine: Engine {
                name: "tract",
                isa: None,
                why: "stock tract".into(),
            },
        })
    }
}

impl OfChain {
    fn fused_engine(&self, chain: &FusedChain) -> Engine {
        let isa = chain.isa();
        Engine {
            name: isa.name(),
            isa: Some(isa),
            why: format!(
                "{} layers of {} filters in {}{}: one fused chain",
                self.chain.layers.len(),
                self.chain.filters(),
                self.chain.precision,
                if self.chain.halved {
                    " at half the resolution"
                } else {
                    ""
                }
            ),
        }
    }
}

/// Returns the factor that stretches depths. A value slightly above the trained range becomes 1.
fn depth_scale(served: Served) -> f32 {
    served.scale.min(1.0) as f32
}

/// Checks that a frame is not empty and has at most `most` pixels.
pub fn check_size(size: Size, most: usize) -> Result<()> {
    let Size { width, height } = size;
    match height.checked_mul(width) {
        Some(0) => Err(Error::Setting(format!(
            "network: a frame of {width}×{height} pixels is empty"
        ))),
        Some(pixels) if pixels <= most => Ok(()),
        _ => Err(Error::Setting(format!(
            "network: a frame of {width}×{height} pixels is too large; {most} pixels are the most"
        ))),
    }
}

/// The path that runs a plan, and the reason for the choice.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Engine {
    /// The name of the kernels, or "tract".
    pub name: &'static str,
    /// The instruction set. `None` on tract.
    pub isa: Option<Isa>,
    /// The reason for the choice.
    pub why: String,
}

enum Path {
    Fused(FusedChain, Head),
    #[cfg(feature = "tract")]
    Stock(StockPlan, Head),
    #[cfg(feature = "tract")]
    Own(own::OwnPlan),
}

/// A network prepared for one frame size. It is immutable. Threads can share one plan, each with its own scratch.
pub struct NetworkPlan {
    input: InputKind,
    /// The factor that stretches depths about the middle of the volume.
    depth_scale: f32,
    /// The output that is the field of a display with one laser.
    colour: Option<usize>,
    /// The position of the field from the middle of the volume.
    z_m: f64,
    height: usize,
    width: usize,
    path: Path,
    engine: Engine,
}

/// The working memory of [`NetworkPlan::run`], from [`NetworkPlan::scratch`].
///
/// The first frame fills it. It takes a few megabytes for each thread of the pool, whatever the frame's height.
#[derive(Debug, Default)]
pub struct NetworkScratch {
    fused: FusedScratch,
    /// Input and output planes for stock tract.
    #[cfg(feature = "tract")]
    planes: [Vec<f32>; 2],
}

impl NetworkScratch {
    /// Makes runs stop early once `cancel` is requested. Runs on tract always finish.
    pub fn set_cancel(&mut self, cancel: &Cancel) {
        self.fused.cancel = cancel.clone();
    }

    /// Returns the number of bytes held between frames.
    pub fn bytes(&self) -> usize {
        #[cfg(feature = "tract")]
        let planes: usize = self.planes.iter().map(Vec::capacity).sum();
        #[cfg(not(feature = "tract"))]
        let planes = 0;
        self.fused.bytes() + planes * size_of::<f32>()
    }
}

impl NetworkPlan {
    /// Returns working memory for one run at a time.
    pub fn scratch(&self) -> NetworkScratch {
        NetworkScratch::default()
    }

    /// Returns the size of a frame.
    pub fn size(&self) -> Size {
        Size {
            width: self.width,
            height: self.height,
        }
    }

    /// Returns the number of input channels and of output channels.
    pub fn channels(&self) -> (usize, usize) {
        (self.input.channels(), phasefront_kernels::OUTPUTS)
    }

    /// Returns the position of the field in metres from the middle of the volume toward the viewer.
    pub(crate) fn z_m(&self) -> f64 {
        self.z_m
    }

    /// Returns whether the field is the modulator's phase.
    pub(crate) fn gives_phase(&self) -> bool {
        match &self.path {
            #[cfg(feature = "tract")]
            Path::Own(plan) => plan.gives_phase(),
            _ => false,
        }
    }

    /// Returns the path that runs this plan and the reason for the choice.
    pub fn engine(&self) -> &Engine {
        &self.engine
    }

    /// Runs the network on one frame, on the current rayon pool. After the first frame the fused path allocates
    /// nothing.
    ///
    /// `input` is planar (C, H, W), RGB-D minus 0.5; `output` receives (6, H, W) in the format that [`Head::field`]
    /// reads.
    ///
    /// # Errors
    /// Returns [`Error::Frame`] if a length is wrong.
    pub fn run(&self, input: &[f32], output: &mut [f32], scratch: &mut NetworkScratch) -> Result<()> {
        let (inputs, outputs) = self.channels();
        self.check("input", input.len(), inputs)?;
        self.check("output", output.len(), outputs)?;
        match &self.path {
            Path::Fused(chain, _) => {
                chain.run(input, output, self.size(), &scratch.fused);
                Ok(())
            }
            #[cfg(feature = "tract")]
            Path::Stock(plan, _) => plan.run(input, output),
            #[cfg(feature = "tract")]
            Path::Own(_) => Err(Error::Network(
                "it has a form of its own and makes fields; NetworkPlan::field is right".into(),
            )),
        }
    }

    /// Runs the network on the rows of `source` and writes the complex field of its head, (C, H, W), on the current
    /// rayon pool. The fused path stores neither input nor output as planes and allocates nothing after the first
    /// frame.
    ///
    /// # Errors
    /// Returns [`Error::Frame`] if `field` does not have C·H·W values.
    pub fn field<S: Source + ?Sized>(
        &self,
        source: &S,
        field: &mut [Complex32],
        scratch: &mut NetworkScratch,
    ) -> Result<()> {
        self.field_where(None, source, field, scratch).map(|_| ())
    }

    /// Works like [`Self::field`], but if `changes` to the source are given, only what they affect is computed, which
    /// needs a [`Self::reach`]. Returns whether the run came to its end.
    pub(crate) fn field_where<S: Source + ?Sized>(
        &self,
        changes: Option<&Changes>,
        source: &S,
        field: &mut [Complex32],
        scratch: &mut NetworkScratch,
    ) -> Result<bool> {
        match self.colour {
            None => self.field_of([0, 1, 2], changes, source, field, scratch)?,
            Some(colour) => self.field_of([colour], changes, source, field, scratch)?,
        }
        Ok(!scratch.fused.cancel.requested())
    }

    /// Returns how far from a pixel the field depends on the source. `None` on tract, which computes whole frames.
    pub(crate) fn reach(&self) -> Option<usize> {
        match &self.path {
            Path::Fused(chain, _) => Some(chain.reach()),
            #[cfg(feature = "tract")]
            Path::Stock(..) | Path::Own(_) => None,
        }
    }

    /// Computes the field of some colours of the output.
    fn field_of<S: Source + ?Sized, const C: usize>(
        &self,
        colours: [usize; C],
        changes: Option<&Changes>,
        source: &S,
        field: &mut [Complex32],
        scratch: &mut NetworkScratch,
    ) -> Result<()> {
        self.check("field", field.len(), C)?;
        let size = self.size();
        let source = &Stretched {
            source,
            input: self.input,
            depth_scale: self.depth_scale,
        };
        match &self.path {
            Path::Fused(chain, head) => {
                let into = FieldOf {
                    kind: self.input,
                    head: *head,
                    colours,
                };
                chain.field(changes, source, into, field, size, &scratch.fused);
                Ok(())
            }
            #[cfg(feature = "tract")]
            Path::Own(plan) => plan.field(source, &colours, field),
            #[cfg(feature = "tract")]
            Path::Stock(plan, head) => {
                let area = size.height * size.width;
                let (inputs, outputs) = self.channels();
                let [input, output] = &mut scratch.planes;
                input.resize(inputs * area, 0.0);
                output.resize(outputs * area, 0.0);
                for (row, into) in input.chunks_exact_mut(size.width).enumerate() {
                    source.read(row / size.height, row % size.height, 0, into);
                }
                plan.run(input, output)?;
                head.field_of(self.input, &colours, output, input, field)
            }
        }
    }

    fn check(&self, what: &str, values: usize, planes: usize) -> Result<()> {
        if values == planes * self.height * self.width {
            return Ok(());
        }
        Err(Error::Frame(format!(
            "network {what} has {values} values; {planes} planes of {}×{} pixels are right",
            self.width, self.height
        )))
    }
}
