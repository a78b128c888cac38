//! The hologram network: loaded from ONNX, checked to be the paper's residual chain, run on frames of any size.
//!
//! [`Network`] says what a file holds; [`Network::plan`] prepares it for one frame size; [`NetworkPlan::field`] takes
//! rows of a [`Source`] to rows of a complex field; [`NetworkPlan::run`] takes planes to planes, which [`Head::field`]
//! turns into a field. What the chain is, stands
//! in [`chain`]; [`mod@reference`] runs it naively and is the oracle of every fast path. The fast path is the crate
//! `phasefront-kernels`; chains that it does not take run on stock tract, and [`NetworkPlan::engine`] says so.

pub mod bounds;
pub mod chain;
mod filter;
mod fused;
mod head;
mod metadata;
mod onnx;
#[cfg(feature = "tract")]
mod operator;
mod proto;
pub mod reference;
mod rgbd;
#[cfg(feature = "tract")]
mod stock;
mod tensor;

pub use chain::Precision;
pub use filter::{FilterPlan, FilterScratch};
pub use head::Head;
use metadata::{Description, Served};
pub use metadata::{InputKind, TrainedDisplay};

use crate::display::Display;
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

/// Most pixels of a frame on tract, which holds several layers at once: some 500 bytes a pixel.
#[cfg(feature = "tract")]
const MAX_STOCK_PIXELS: usize = 1 << 24;
/// Most pixels of a frame at all.
pub const MAX_PIXELS: usize = 1 << 28;

/// Planes that a network reads, a run of a row's pixels at a time: they need not lie in memory as the network takes
/// them.
pub trait Source: Sync {
    /// Writes pixels of `row` of `plane`, from column `from` on, into `into`; planes as [`InputKind`] counts them.
    fn read(&self, plane: usize, row: usize, from: usize, into: &mut [f32]);
}

/// What a network reads of another display: depth, which comes minus ½, times a scale.
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

/// A network read from an ONNX file: its chain, what it takes and gives, and the display it was trained for.
pub struct Network {
    chain: Chain,
    input: InputKind,
    head: Head,
    display: TrainedDisplay,
    seed_planes: Option<usize>,
    #[cfg(feature = "tract")]
    onnx: Box<[u8]>,
}

impl std::fmt::Debug for Network {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (layers, filters) = (self.layers(), self.filters());
        let (input, precision) = (self.input, self.precision());
        write!(f, "Network({input}, {layers} layers of {filters} filters, {precision})")
    }
}

impl Network {
    /// Reads an ONNX file's bytes and checks that they hold a hologram network: the residual chain of [`chain`], in
    /// f32 or quantised to int8 with QuantizeLinear/DequantizeLinear pairs, with `phasefront.*` metadata.
    ///
    /// # Errors
    /// [`Error::Network`] naming the node, tensor or metadata that is not so, and what would be right; a file of over
    /// 2²⁸ bytes or 2¹⁷ parts. What is allocated is at most 4 times the file and 200 MB.
    pub fn from_onnx(bytes: &[u8]) -> Result<Network> {
        bounds::check(bytes)?;
        let model = proto::Model::decode(bytes)
            .map_err(|why| Error::Network(format!("not an ONNX file, or a truncated one: {why}")))?;
        let graph = model
            .graph
            .as_ref()
            .ok_or_else(|| Error::Network("not an ONNX file: it holds no graph".into()))?;
        let chain = onnx::chain(graph)?;
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
            chain,
            input,
            head,
            display,
            seed_planes,
            #[cfg(feature = "tract")]
            onnx: bytes.into(),
        })
    }

    /// The chain itself: layers, filters, weights, quantisation.
    #[doc(hidden)]
    pub fn chain(&self) -> &Chain {
        &self.chain
    }

    /// How many convolutions.
    pub fn layers(&self) -> usize {
        self.chain.layers.len()
    }

    /// Filters of each hidden layer.
    pub fn filters(&self) -> usize {
        self.chain.filters()
    }

    /// The numbers that the file's layers compute in.
    #[doc(hidden)]
    pub fn precision(&self) -> Precision {
        self.chain.precision
    }

    /// What the input planes are.
    #[doc(hidden)]
    pub fn input(&self) -> InputKind {
        self.input
    }

    /// What the output planes are.
    #[doc(hidden)]
    pub fn head(&self) -> Head {
        self.head
    }

    /// The display it was trained for; another needs another network.
    #[doc(hidden)]
    pub fn display(&self) -> &TrainedDisplay {
        &self.display
    }

    /// What depths of frames for `display` are stretched by about the middle of the volume for this network to give
    /// their hologram, from 0 to 1: (λ·V/p²) over that of the display it was trained for. To the paraxial order a
    /// hologram without its carrier depends on λ·z/p² alone.
    ///
    /// # Errors
    /// [`Error::Network`] for a display of a larger λ·V/p², or one whose lasers differ by over 5 % from one stretch.
    #[doc(hidden)]
    pub fn depth_scale(&self, display: &Display) -> Result<f32> {
        Ok(depth_scale(self.display.serve(display)?))
    }

    /// The colour whose output is the field of a `display` of one laser, 0 red, 1 green, 2 blue: the nearest of those
    /// whose depths were trained as far as the display's reach. None for a display of three.
    ///
    /// # Errors
    /// As [`Self::depth_scale`].
    #[doc(hidden)]
    pub fn colour(&self, display: &Display) -> Result<Option<usize>> {
        Ok(self.display.serve(display)?.colour)
    }

    /// Checks that it serves `display`.
    ///
    /// # Errors
    /// As [`Self::depth_scale`].
    pub fn check_display(&self, display: &Display) -> Result<()> {
        self.depth_scale(display).map(|_| ())
    }

    /// Checks that this pre-filter serves `display`, its offset included: λ·offset/p² is the one it was trained for.
    ///
    /// # Errors
    /// As [`Self::depth_scale`], or an offset that differs by over 20 µm at the pitch it was trained for.
    #[doc(hidden)]
    pub fn check_prefilter(&self, display: &Display) -> Result<()> {
        self.display.check_offset(display)
    }

    /// Planes of the sweep whose field a seeded network was trained to correct, where its file says so.
    pub fn seed_planes(&self) -> Option<usize> {
        self.seed_planes
    }

    /// [`Self::plan`] for frames whose depth is for `display`, and for its colours: for one laser the network reads its
    /// amplitude as red, green and blue, and [`Self::colour`] is kept of what it gives.
    ///
    /// # Errors
    /// As [`Self::plan`] and [`Self::depth_scale`].
    #[doc(hidden)]
    pub fn plan_for(&self, height: usize, width: usize, display: &Display) -> Result<NetworkPlan> {
        let served = self.display.serve(display)?;
        Ok(NetworkPlan {
            depth_scale: depth_scale(served),
            colour: served.colour,
            ..self.plan(height, width)?
        })
    }

    /// Prepares the network for frames of `height` × `width` pixels, whose depth is for the display it was trained for,
    /// on the fastest path that runs it.
    ///
    /// # Errors
    /// [`Error::Setting`] for an empty frame or one too large; [`Error::Network`] when the path refuses the graph.
    #[doc(hidden)]
    pub fn plan(&self, height: usize, width: usize) -> Result<NetworkPlan> {
        match FusedChain::new(&self.chain, None) {
            Ok(chain) => self.fused_plan(height, width, chain),
            #[cfg(feature = "tract")]
            Err(why) => {
                let mut plan = self.plan_on_stock_tract(height, width)?;
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
    /// As [`Network::plan`]; [`Error::Setting`] where this processor or those kernels cannot.
    #[doc(hidden)]
    pub fn plan_on(&self, isa: Isa, height: usize, width: usize) -> Result<NetworkPlan> {
        let chain = FusedChain::new(&self.chain, Some(isa));
        self.fused_plan(
            height,
            width,
            chain.map_err(|why| Error::Setting(format!("network: {why}")))?,
        )
    }

    fn fused_plan(&self, height: usize, width: usize, chain: FusedChain) -> Result<NetworkPlan> {
        check_size(height, width, MAX_PIXELS)?;
        let engine = self.fused_engine(&chain);
        Ok(NetworkPlan {
            input: self.input,
            head: self.head,
            depth_scale: 1.0,
            colour: None,
            height,
            width,
            path: Path::Fused(chain),
            engine,
        })
    }

    /// Prepares a network for fields to be run in place on (3, `height`, `width`) ones, on the fastest kernels. A blur
    /// that it asks for ([`InputKind::is_blurred`]) is the caller's.
    ///
    /// # Errors
    /// [`Error::Network`] for a network that takes no field or that the kernels do not take; [`Error::Setting`] for an
    /// empty field or one too large.
    #[doc(hidden)]
    pub fn filter_plan(&self, height: usize, width: usize) -> Result<FilterPlan> {
        if !self.input.is_field() {
            return Err(Error::Network(format!(
                "a pre-filter takes 'field', this network '{}'",
                self.input
            )));
        }
        let chain =
            FusedChain::new(&self.chain, None).map_err(|why| Error::Network(format!("as a pre-filter: {why}")))?;
        check_size(height, width, MAX_PIXELS)?;
        Ok(FilterPlan {
            engine: self.fused_engine(&chain),
            chain,
            input: self.input,
            head: self.head,
            colour: None,
            size: (height, width),
        })
    }

    /// [`Self::filter_plan`] for the colours of `display`: for one laser in place on a (1, `height`, `width`) field, as
    /// [`Self::plan_for`].
    ///
    /// # Errors
    /// As [`Self::filter_plan`] and [`Self::depth_scale`].
    #[doc(hidden)]
    pub fn filter_plan_for(&self, height: usize, width: usize, display: &Display) -> Result<FilterPlan> {
        Ok(FilterPlan {
            colour: self.colour(display)?,
            ..self.filter_plan(height, width)?
        })
    }

    fn fused_engine(&self, chain: &FusedChain) -> Engine {
        let isa = chain.isa();
        Engine {
            name: isa.name(),
            isa: Some(isa),
            why: format!(
                "{} layers of {} filters in {}{}: one fused chain",
                self.layers(),
                self.filters(),
                self.precision(),
                if self.chain.halved {
                    " at half the resolution"
                } else {
                    ""
                }
            ),
        }
    }

    /// The network as a tract graph of any frame size, its chain one fused operator: for graphs built around it.
    /// [`Network::plan`] runs the same kernels on the caller's memory, without tract's copies.
    ///
    /// # Errors
    /// [`Error::Network`] when the kernels do not take the chain, or tract refuses the graph.
    #[cfg(feature = "tract")]
    pub fn tract_model(&self) -> Result<tract_onnx::prelude::TypedModel> {
        let chain = FusedChain::new(&self.chain, None).map_err(Error::Network)?;
        operator::model(&self.input.to_string(), chain, self.chain.inputs)
    }

    /// Prepares the network on stock tract whatever the fast path could do: the independent check of that path.
    ///
    /// # Errors
    /// As [`Network::plan`].
    #[cfg(feature = "tract")]
    pub fn plan_on_stock_tract(&self, height: usize, width: usize) -> Result<NetworkPlan> {
        check_size(height, width, MAX_STOCK_PIXELS)?;
        if self.chain.halved && (height % 2 == 1 || width % 2 == 1) {
            return Err(Error::Network(format!(
                "a network at half the resolution takes frames of even sides on tract, not {width}×{height}"
            )));
        }
        let plan = StockPlan::new(&self.onnx, [1, self.chain.inputs, height, width])?;
        Ok(NetworkPlan {
            input: self.input,
            head: self.head,
            depth_scale: 1.0,
            colour: None,
            height,
            width,
            path: Path::Stock(plan),
            engine: Engine {
                name: "tract",
                isa: None,
                why: "stock tract".into(),
            },
        })
    }
}

/// What depths are stretched by: a little over the trained range is taken as that.
fn depth_scale(served: Served) -> f32 {
    served.scale.min(1.0) as f32
}

/// Refuses an empty frame, and one of more than `most` pixels.
pub fn check_size(height: usize, width: usize, most: usize) -> Result<()> {
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

/// Which path runs a plan, and why that one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Engine {
    /// The kernels' name, or "tract".
    pub name: &'static str,
    /// The instruction set; none on tract.
    pub isa: Option<Isa>,
    /// Why this path was taken.
    pub why: String,
}

enum Path {
    Fused(FusedChain),
    #[cfg(feature = "tract")]
    Stock(StockPlan),
}

/// A network prepared for one frame size. Immutable; one plan serves many threads, each with its own scratch.
pub struct NetworkPlan {
    input: InputKind,
    head: Head,
    /// What depths are stretched by about the middle.
    depth_scale: f32,
    /// Of a display of one laser, the output that is its field.
    colour: Option<usize>,
    height: usize,
    width: usize,
    path: Path,
    engine: Engine,
}

/// Working memory of [`NetworkPlan::run`], from [`NetworkPlan::scratch`].
///
/// It is filled in the first frame, a few megabytes for each thread of the pool and independent of the frame's height.
#[derive(Debug, Default)]
pub struct NetworkScratch {
    fused: FusedScratch,
    /// Input and output as planes, for stock tract.
    #[cfg(feature = "tract")]
    planes: [Vec<f32>; 2],
}

impl NetworkScratch {
    /// Has runs end where `cancel` is requested; those on tract go on to their end.
    pub fn set_cancel(&mut self, cancel: &Cancel) {
        self.fused.cancel = cancel.clone();
    }

    /// Bytes held between frames.
    pub fn bytes(&self) -> usize {
        #[cfg(feature = "tract")]
        let planes: usize = self.planes.iter().map(Vec::capacity).sum();
        #[cfg(not(feature = "tract"))]
        let planes = 0;
        self.fused.bytes() + planes * size_of::<f32>()
    }
}

impl NetworkPlan {
    /// Working memory for one run at a time.
    pub fn scratch(&self) -> NetworkScratch {
        NetworkScratch::default()
    }

    /// The frame's height and width in pixels.
    pub fn size(&self) -> (usize, usize) {
        (self.height, self.width)
    }

    /// Channels of the input and of the output.
    pub fn channels(&self) -> (usize, usize) {
        (self.input.channels(), phasefront_kernels::OUTPUTS)
    }

    /// Which path runs this plan, and why.
    pub fn engine(&self) -> &Engine {
        &self.engine
    }

    /// Runs the network on one frame, on the current rayon pool. After the first frame the fused path allocates
    /// nothing.
    ///
    /// `input` is planar (C, H, W), RGB-D minus 0.5; `output` receives (6, H, W) as [`Head::field`] reads it.
    ///
    /// # Errors
    /// [`Error::Frame`] when a length is wrong.
    pub fn run(&self, input: &[f32], output: &mut [f32], scratch: &mut NetworkScratch) -> Result<()> {
        let (inputs, outputs) = self.channels();
        self.check("input", input.len(), inputs)?;
        self.check("output", output.len(), outputs)?;
        match &self.path {
            Path::Fused(chain) => {
                chain.run(input, output, self.size(), &scratch.fused);
                Ok(())
            }
            #[cfg(feature = "tract")]
            Path::Stock(plan) => plan.run(input, output),
        }
    }

    /// Runs the network on the rows of `source` and writes the complex field that its head makes of them, (C, H, W), on
    /// the current rayon pool. On the fused path neither input nor output lies in memory as planes, and after the first
    /// frame nothing is allocated.
    ///
    /// # Errors
    /// [`Error::Frame`] when `field` has not C·H·W values.
    pub fn field<S: Source + ?Sized>(
        &self,
        source: &S,
        field: &mut [Complex32],
        scratch: &mut NetworkScratch,
    ) -> Result<()> {
        match self.colour {
            None => self.field_of([0, 1, 2], source, field, scratch),
            Some(colour) => self.field_of([colour], source, field, scratch),
        }
    }

    /// The field of some colours of the output.
    fn field_of<S: Source + ?Sized, const C: usize>(
        &self,
        colours: [usize; C],
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
            Path::Fused(chain) => {
                let into = FieldOf {
                    kind: self.input,
                    head: self.head,
                    colours,
                };
                chain.field(source, into, field, size, &scratch.fused);
                Ok(())
            }
            #[cfg(feature = "tract")]
            Path::Stock(plan) => {
                let area = size.0 * size.1;
                let (inputs, outputs) = self.channels();
                let [input, output] = &mut scratch.planes;
                input.resize(inputs * area, 0.0);
                output.resize(outputs * area, 0.0);
                for (row, into) in input.chunks_exact_mut(size.1).enumerate() {
                    source.read(row / size.0, row % size.0, 0, into);
                }
                plan.run(input, output)?;
                self.head.field_of(self.input, &colours, output, input, field)
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
