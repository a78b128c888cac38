//! Compares the network with its naive oracle, and checks that invalid files are rejected.
use crate::network_models;
use phasefront_core::Size;

use network_models::{Model, frame, int, ints};
use num_complex::Complex32;
use phasefront_core::display::Display;
use phasefront_core::method::network::Network;
use phasefront_core::method::network::{Head, InputKind, Isa, Source, reference};
use prost::Message;
use tract_onnx::pb::{ModelProto, NodeProto};

const SIZES: [Size; 4] = [
    Size { width: 1, height: 1 },
    Size { width: 5, height: 7 },
    Size { width: 33, height: 2 },
    Size { width: 47, height: 61 },
];

fn largest_difference(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// Returns `size`. For a model at half the resolution, which tract runs only with even sides, returns the next even
/// sides.
fn even(Size { width, height }: Size, model: &Model) -> Size {
    let side = |side: usize| if model.halved { side.next_multiple_of(2) } else { side };
    Size {
        width: side(width),
        height: side(height),
    }
}

fn run_stock(network: &Network, input: &[f32], size: Size) -> Vec<f32> {
    let Size { width, height } = size;
    let plan = network.plan_on_stock_tract(size).unwrap();
    let mut output = vec![f32::NAN; 6 * height * width];
    plan.run(input, &mut output, &mut plan.scratch()).unwrap();
    output
}

#[test]
fn stock_tract_agrees_with_the_definition_in_f32() {
    let models = [
        Model::new(2, 8),
        Model {
            tanh: true,
            head: "amplitude-phase",
            ..Model::new(3, 5)
        },
        Model::new(4, 24),
        Model {
            inputs: 20,
            input: "ldi5",
            ..Model::new(8, 16)
        },
        Model::new(5, 16).halved(),
        Model {
            tanh: true,
            head: "amplitude-phase",
            ..Model::new(3, 5).halved()
        },
    ];
    for model in models {
        let network = Network::from_onnx(&model.bytes()).unwrap();
        for Size { width, height } in SIZES.map(|size| even(size, &model)) {
            let input = frame(model.inputs, Size { width, height }, 7);
            let expected = reference::run(network.chain().unwrap(), &input, Size { width, height });
            let output = run_stock(&network, &input, Size { width, height });
            let worst = largest_difference(&output, &expected);
            assert!(worst < 2e-5, "{} layers, {width}×{height}: {worst}", model.layers);
        }
    }
}

#[test]
fn stock_tract_agrees_with_the_definition_in_int8() {
    for layers in [2, 3, 4, 5, 8] {
        for inner_roundings in [false, true] {
            let model = Model {
                inner_roundings,
                ..Model::int8(layers, 8)
            };
            let network = Network::from_onnx(&model.bytes()).unwrap();
            assert_eq!(network.precision(), "int8");
            for Size { width, height } in SIZES {
                let input = frame(4, Size { width, height }, 7);
                let expected = reference::run(network.chain().unwrap(), &input, Size { width, height });
                let output = run_stock(&network, &input, Size { width, height });
                // A value on the other side of a rounding changes its neighbours by a step.
                let off = output
                    .iter()
                    .zip(&expected)
                    .filter(|(a, b)| (*a - *b).abs() > 1e-4)
                    .count();
                assert!(
                    off * 50 <= output.len(),
                    "{layers} layers, {width}×{height}: {off} of {}",
                    output.len()
                );
                assert!(largest_difference(&output, &expected) < 0.1);
            }
        }
    }
}

/// Returns the kernels of a network's precision that this processor supports.
fn kernels(network: &Network) -> Vec<Isa> {
    match network.precision() {
        "int8" => Isa::int8(),
        _ => Isa::f32(),
    }
}

#[test]
fn the_fused_chain_agrees_with_the_definition_on_every_instruction_set() {
    let tanh = Model {
        tanh: true,
        head: "amplitude-phase",
        ..Model::new(5, 8)
    };
    let models = [
        Model::new(2, 8),
        tanh.clone(),
        Model {
            inputs: 6,
            input: "field",
            ..tanh.clone()
        },
        Model {
            inputs: 20,
            input: "ldi5",
            ..Model::new(8, 24)
        },
        Model::int8(2, 8),
        Model::int8(3, 24),
        Model::int8(4, 16),
        Model {
            int8: true,
            ..tanh.clone()
        },
        Model {
            inner_roundings: false,
            ..Model::int8(5, 8)
        },
        Model {
            inner_roundings: false,
            ..Model::int8(8, 8)
        },
        Model::int8(8, 24),
        Model::new(4, 48).halved(),
        Model::int8(4, 48).halved(),
        Model { halved: true, ..tanh },
        Model {
            inner_roundings: false,
            ..Model::int8(5, 8).halved()
        },
    ];
    for model in models {
        let network = Network::from_onnx(&model.bytes()).unwrap();
        for Size { width, height } in SIZES {
            let input = frame(model.inputs, Size { width, height }, 7);
            let expected = reference::run(network.chain().unwrap(), &input, Size { width, height });
            let mut first: Option<Vec<f32>> = None;
            for isa in kernels(&network) {
                let plan = network.plan_on(isa, Size { width, height }).unwrap();
                assert_eq!(plan.engine().name, isa.name());
                let mut output = vec![f32::NAN; 6 * height * width];
                plan.run(&input, &mut output, &mut plan.scratch()).unwrap();
                let worst = largest_difference(&output, &expected);
                let case = format!("{isa}, {} layers, {width}×{height}", model.layers);
                if model.int8 {
                    let off = output
                        .iter()
                        .zip(&expected)
                        .filter(|(a, b)| (*a - *b).abs() > 1e-4)
                        .count();
                    assert!(off * 50 <= output.len() && worst < 0.1, "{case}: {off} off, {worst}");
                    assert!(*first.get_or_insert(output.clone()) == output, "{case}: other bits");
                } else {
                    assert!(worst < 2e-5, "{case}: {worst}");
                }
            }
        }
    }
}

/// Planes in memory as a network's source.
struct Planes<'a> {
    values: &'a [f32],
    size: Size,
}

impl Source for Planes<'_> {
    fn read(&self, plane: usize, row: usize, from: usize, into: &mut [f32]) {
        let at = (plane * self.size.height + row) * self.size.width + from;
        into.copy_from_slice(&self.values[at..][..into.len()]);
    }
}

#[test]
fn rows_to_a_field_are_the_same_bits_as_planes_and_then_the_head() {
    let tanh = Model {
        tanh: true,
        head: "amplitude-phase",
        ..Model::new(5, 8)
    };
    let field = Model {
        inputs: 6,
        input: "field",
        ..Model::new(4, 8)
    };
    let models = [
        Model::new(5, 8),
        Model::int8(8, 24),
        Model {
            inputs: 20,
            input: "ldi5",
            ..Model::int8(3, 8)
        },
        Model {
            int8: true,
            ..field.clone()
        },
        field,
        Model {
            inputs: 6,
            input: "field",
            ..tanh.clone()
        },
        Model::int8(3, 48).halved(),
        tanh.clone().halved(),
        tanh,
    ];
    for model in models {
        let network = Network::from_onnx(&model.bytes()).unwrap();
        // The last size is cut into bands, and into strips if there are few threads.
        for (height, width) in [(1, 1), (7, 5), (61, 47), (150, 300)] {
            let values = frame(model.inputs, Size { width, height }, 7);
            let source = Planes {
                values: &values,
                size: Size { width, height },
            };
            let size = Size { width, height };
            let stock_too = even(size, &model) == size;
            for stock in [false, true].into_iter().take(1 + usize::from(stock_too)) {
                let plan = if stock {
                    network.plan_on_stock_tract(Size { width, height })
                } else {
                    network.plan(Size { width, height })
                };
                let plan = plan.unwrap();
                let mut scratch = plan.scratch();
                let mut output = vec![f32::NAN; 6 * height * width];
                plan.run(&values, &mut output, &mut scratch).unwrap();
                let mut expected = vec![Complex32::ZERO; 3 * height * width];
                network
                    .head()
                    .unwrap()
                    .field(network.input(), &output, &values, &mut expected)
                    .unwrap();
                let mut field = vec![Complex32::ZERO; 3 * height * width];
                plan.field(&source, &mut field, &mut scratch).unwrap();
                assert_eq!(field, expected, "{width}×{height}, stock: {stock}");
                assert!(plan.field(&source, &mut field[1..], &mut scratch).is_err());
            }
        }
    }
}

#[test]
fn a_pre_filter_in_place_gives_the_same_bits_however_it_is_cut() {
    let residual = Model {
        inputs: 6,
        input: "field",
        ..Model::new(8, 8)
    };
    let models = [
        Model {
            int8: true,
            ..residual.clone()
        },
        Model {
            tanh: true,
            head: "amplitude-phase",
            layers: 3,
            ..residual.clone()
        },
        Model {
            int8: true,
            inputs: 12,
            input: "split-blurred-field",
            ..residual.clone()
        },
        residual,
    ];
    for model in models {
        let network = Network::from_onnx(&model.bytes()).unwrap();
        for (height, width) in [(1, 1), (7, 5), (150, 70)] {
            let values = frame(6, Size { width, height }, 3);
            let area = height * width;
            let planes = if model.inputs == 12 {
                let parts = values.iter().map(|v| {
                    let first = (v * 64.0).round_ties_even() / 64.0;
                    (first, 16.0 * (v - first))
                });
                let (first, second): (Vec<_>, Vec<_>) = parts.unzip();
                [first, second].concat()
            } else {
                values.clone()
            };
            let plan = network.plan(Size { width, height }).unwrap();
            let mut output = vec![0.0; 6 * area];
            plan.run(&planes, &mut output, &mut plan.scratch()).unwrap();
            let mut expected = vec![Complex32::ZERO; 3 * area];
            network
                .head()
                .unwrap()
                .field(network.input(), &output, &planes, &mut expected)
                .unwrap();
            let plan = network.filter_plan(Size { width, height }).unwrap();
            let mut scratch = plan.scratch();
            for threads in [1, 2, 5] {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
                let mut field: Vec<_> = (0..3 * area)
                    .map(|i| Complex32::new(values[i], values[3 * area + i]))
                    .collect();
                let filter = || plan.filter(&mut field, &mut scratch);
                pool.build().unwrap().install(filter);
                assert_eq!(field, expected, "{width}×{height} on {threads}");
            }
        }
    }
    let other = Network::from_onnx(&Model::new(3, 8).bytes()).unwrap();
    let why = other
        .filter_plan(Size { width: 4, height: 4 })
        .err()
        .unwrap()
        .to_string();
    assert!(why.contains("takes 'field', this network 'rgbd'"), "{why}");
    let odd = Model {
        inputs: 6,
        input: "field",
        ..Model::new(3, 5)
    };
    let odd = Network::from_onnx(&odd.bytes()).unwrap();
    let why = odd.filter_plan(Size { width: 4, height: 4 }).err().unwrap().to_string();
    assert!(why.contains("5 filters"), "{why}");
}

#[test]
fn the_operator_in_a_tract_graph_yields_the_same_bits_at_any_size() {
    use tract_onnx::prelude::*;
    for model in [
        Model::int8(5, 8),
        Model::int8(3, 8).halved(),
        Model {
            tanh: true,
            head: "amplitude-phase",
            ..Model::new(4, 8)
        },
    ] {
        let network = Network::from_onnx(&model.bytes()).unwrap();
        let graph = network.tract_model().unwrap();
        let operators: Vec<_> = graph.nodes().iter().map(|node| node.op.name().to_string()).collect();
        assert_eq!(operators, ["Source", "HologramChain"]);
        let graph = graph.into_runnable().unwrap();
        for Size { width, height } in SIZES {
            let input = frame(4, Size { width, height }, 5);
            let plan = network.plan(Size { width, height }).unwrap();
            let mut expected = vec![0.0; 6 * height * width];
            plan.run(&input, &mut expected, &mut plan.scratch()).unwrap();
            let tensor = Tensor::from_shape(&[1, 4, height, width], &input).unwrap();
            let output = graph.run(tvec!(tensor.into())).unwrap();
            assert_eq!(output[0].shape(), [1, 6, height, width]);
            let view = output[0].to_plain_array_view::<f32>().unwrap();
            assert!(view.iter().eq(&expected), "{width}×{height}");
        }
    }
}

#[test]
fn chains_that_the_kernels_do_not_take_say_why_and_run_on_stock_tract() {
    let network = Network::from_onnx(&Model::new(3, 5).bytes()).unwrap();
    let plan = network.plan(Size { width: 6, height: 4 }).unwrap();
    assert_eq!(plan.engine().name, "tract");
    assert!(plan.engine().why.contains("5 filters"), "{}", plan.engine().why);
    assert!(network.plan_on(Isa::Portable, Size { width: 6, height: 4 }).is_err());
    assert!(network.tract_model().is_err());
    let input = frame(4, Size { width: 6, height: 4 }, 1);
    let mut output = vec![f32::NAN; 6 * 24];
    plan.run(&input, &mut output, &mut plan.scratch()).unwrap();
    assert!(
        largest_difference(
            &output,
            &reference::run(network.chain().unwrap(), &input, Size { width: 6, height: 4 })
        ) < 1e-5
    );
}

#[test]
fn a_network_tells_what_it_is() {
    let model = Model {
        tanh: true,
        head: "amplitude-phase",
        ..Model::int8(8, 24)
    };
    let network = Network::from_onnx(&model.bytes()).unwrap();
    assert_eq!((network.layers(), network.filters()), (8, 24));
    assert_eq!(
        (network.input(), network.head().unwrap()),
        (InputKind::Rgbd, Head::AmplitudePhase)
    );
    assert_eq!(network.precision(), "int8");
    assert_eq!(network.chain().unwrap().macs_per_pixel(), 33_480);
    assert!((network.display().pitch_m - 8e-6).abs() < 1e-12);
    assert!((network.display().wavelengths_m[1] - 520e-9).abs() < 1e-15);
    let plan = network.plan_on_stock_tract(Size { width: 9, height: 5 }).unwrap();
    assert_eq!(
        (plan.size(), plan.channels(), plan.engine().name),
        (Size { width: 9, height: 5 }, (4, 6), "tract")
    );
}

#[test]
fn a_network_at_half_the_resolution_tells_so() {
    let network = Network::from_onnx(&Model::int8(8, 48).halved().bytes()).unwrap();
    assert_eq!((network.layers(), network.filters()), (8, 48));
    let macs = 9 * (16 * 48 + 6 * 48 * 48 + (48 + 16) * 24) / 4;
    assert_eq!(network.chain().unwrap().macs_per_pixel(), macs);
    let plan = network.plan(Size { width: 9, height: 5 }).unwrap();
    assert_eq!((plan.size(), plan.channels()), (Size { width: 9, height: 5 }, (4, 6)));
    assert!(plan.engine().why.contains("half the resolution"));
    let why = network
        .plan_on_stock_tract(Size { width: 9, height: 5 })
        .err()
        .unwrap()
        .to_string();
    assert!(why.contains("even sides on tract, not 9×5"), "{why}");
    let prefilter = Model::prefilter("0").halved();
    let why = Network::from_onnx(&prefilter.bytes()).unwrap_err().to_string();
    assert!(why.contains("whole resolution"), "{why}");
}

#[test]
fn a_prefilter_serves_displays_whose_light_spreads_as_much() {
    let prefilter = Network::from_onnx(&Model::prefilter("6").bytes()).unwrap();
    let at = |toml: &str| prefilter.check_prefilter(&Display::from_toml(toml).unwrap());
    at("offset_mm = 6").unwrap();
    let fine = "pitch_um = 4\nvolume_depth_mm = 1.5\noffset_mm = ";
    at(&format!("{fine}1.5")).unwrap();
    let why = at(&format!("{fine}6")).unwrap_err().to_string();
    assert!(why.contains("1.500 mm on this display"), "{why}");
    assert!(at("offset_mm = 6.05").is_err());
}

#[test]
fn one_plan_serves_many_threads() {
    let network = Network::from_onnx(&Model::new(4, 8).bytes()).unwrap();
    let plan = network.plan(Size { width: 13, height: 9 }).unwrap();
    let input = frame(4, Size { width: 13, height: 9 }, 3);
    let outputs: Vec<Vec<f32>> = std::thread::scope(|scope| {
        let run = || {
            let mut output = vec![0.0; 6 * 9 * 13];
            plan.run(&input, &mut output, &mut plan.scratch()).unwrap();
            output
        };
        let threads: Vec<_> = (0..4).map(|_| scope.spawn(run)).collect();
        threads.into_iter().map(|t| t.join().unwrap()).collect()
    });
    assert!(outputs.iter().all(|o| *o == outputs[0]));
}

#[test]
fn wrong_frames_are_refused() {
    let network = Network::from_onnx(&Model::new(2, 8).bytes()).unwrap();
    for (height, width) in [(0, 4), (4, 0), (usize::MAX, 2), (1 << 20, 1 << 20)] {
        assert!(network.plan(Size { width, height }).is_err(), "{width}×{height}");
        assert!(
            network.plan_on_stock_tract(Size { width, height }).is_err(),
            "{width}×{height}"
        );
    }
    let plan = network.plan(Size { width: 4, height: 4 }).unwrap();
    let mut scratch = plan.scratch();
    assert!(plan.run(&[0.0; 63], &mut [0.0; 96], &mut scratch).is_err());
    assert!(plan.run(&[0.0; 64], &mut [0.0; 95], &mut scratch).is_err());
}

fn refusal(proto: &ModelProto) -> String {
    let error = Network::from_onnx(&proto.encode_to_vec())
        .expect_err("must be refused")
        .to_string();
    assert!(!error.contains('\n'), "one line: {error}");
    error
}

fn node<'a>(proto: &'a mut ModelProto, name: &str) -> &'a mut NodeProto {
    proto
        .graph
        .as_mut()
        .unwrap()
        .node
        .iter_mut()
        .find(|n| n.name == name)
        .unwrap()
}

fn set_f32(proto: &mut ModelProto, tensor: &str, index: usize, value: f32) {
    let tensors = &mut proto.graph.as_mut().unwrap().initializer;
    let tensor = tensors.iter_mut().find(|t| t.name == tensor).unwrap();
    tensor.raw_data[4 * index..][..4].copy_from_slice(&value.to_le_bytes());
}

/// Corrupts a model and checks that the error message names the cause.
fn check(model: &Model, spoil: impl Fn(&mut ModelProto), speaks_of: &[&str]) {
    let mut proto = model.proto();
    Network::from_onnx(&proto.encode_to_vec()).unwrap();
    spoil(&mut proto);
    let message = refusal(&proto);
    for part in speaks_of {
        assert!(message.contains(part), "'{message}' should speak of '{part}'");
    }
}

fn attribute(name: &'static str, values: &'static [i64]) -> impl Fn(&mut ModelProto) {
    move |proto| {
        let conv = node(proto, "conv2");
        conv.attribute.retain(|a| a.name != name);
        conv.attribute.push(ints(name, values));
    }
}

#[test]
fn what_is_no_onnx_file_is_refused() {
    let whole = Model::new(3, 8).bytes();
    for bytes in [
        &b""[..],
        b"not a network",
        &whole[..whole.len() / 2],
        &whole[..whole.len() - 3],
        &[0xff; 100],
    ] {
        let error = Network::from_onnx(bytes).expect_err("must be refused").to_string();
        assert!(!error.contains('\n'), "{error}");
    }
}

/// Checks bounds on the memory that a small file can request.
#[test]
fn files_that_would_grow_in_memory_are_refused() {
    // The same scales, read repeatedly.
    let many = |proto: &mut ModelProto| {
        let graph = proto.graph.as_mut().unwrap();
        let scale = graph.initializer.iter_mut().find(|t| t.name == "w0_scale").unwrap();
        scale.dims = vec![250_000];
        scale.raw_data = 1f32.to_le_bytes().repeat(250_000);
    };
    check(&Model::int8(5, 8), many, &["250000 scales", "1024 are the most"]);
    let attributes = |proto: &mut ModelProto| {
        node(proto, "conv0").attribute = vec![Default::default(); 1 << 17];
    };
    check(&Model::new(5, 8), attributes, &["over 131072 parts"]);
    // A name of several megabytes with terminal control characters.
    let mut proto = Model::new(5, 8).proto();
    let name = "\u{1b}[2J\n".repeat(1 << 20);
    let conv = node(&mut proto, "conv1");
    conv.name = name.clone();
    conv.op_type = name;
    let message = refusal(&proto);
    assert!(
        message.len() < 3000 && !message.contains(char::is_control),
        "{}",
        message.len()
    );
    assert!(message.contains("not an operator of the residual chain"), "{message}");
}

#[test]
fn every_truncation_is_refused_or_read_without_panic() {
    let whole = Model::int8(2, 1).bytes();
    for length in 0..whole.len() {
        let _ = Network::from_onnx(&whole[..length]);
    }
}

#[test]
fn convolutions_of_another_kind_are_refused() {
    let model = Model::new(4, 8);
    check(
        &model,
        attribute("kernel_shape", &[5, 5]),
        &["'conv2' (Conv)", "kernel_shape [5, 5]", "[3, 3] is right"],
    );
    check(&model, attribute("strides", &[2, 2]), &["'conv2'", "strides"]);
    check(&model, attribute("dilations", &[1, 2]), &["'conv2'", "dilations"]);
    check(&model, attribute("pads", &[0, 0, 0, 0]), &["'conv2'", "pads"]);
    check(
        &model,
        |p| node(p, "conv2").attribute.retain(|a| a.name != "pads"),
        &["'conv2'", "padding"],
    );
    check(
        &model,
        |p| {
            node(p, "conv2")
                .attribute
                .iter_mut()
                .filter(|a| a.name == "group")
                .for_each(|a| a.i = 2)
        },
        &["'conv2'", "group 2"],
    );
}

#[test]
fn squares_of_pixels_in_another_place_are_refused() {
    let halved = Model::int8(6, 8).halved();
    check(
        &halved,
        |p| node(p, "squares").attribute[0].i = 4,
        &["'squares' (SpaceToDepth)", "blocksize 2 is right"],
    );
    check(
        &halved,
        |p| node(p, "squares_out/q").input[0] = "rgbd".into(),
        &["before SpaceToDepth; after it is right"],
    );
    check(
        &Model::new(6, 8).halved(),
        |p| {
            for (name, dims) in [("w5", vec![26, 24, 3, 3]), ("b5", vec![26])] {
                let tensors = &mut p.graph.as_mut().unwrap().initializer;
                let tensor = tensors.iter_mut().find(|t| t.name == name).unwrap();
                tensor.raw_data = vec![0; 4 * dims.iter().product::<i64>() as usize];
                tensor.dims = dims;
            }
        },
        &["'pixels' (DepthToSpace)", "reads 26 channels"],
    );
    check(
        &halved,
        |p| node(p, "pixels").op_type = "Identity".into(),
        &["'field' is not the last layer's", "the last layer's pixels or its tanh"],
    );
    check(
        &Model::new(6, 8),
        |p| node(p, "relu1").op_type = "DepthToSpace".into(),
        &["blocksize 2 is right"],
    );
}

#[test]
fn graphs_of_another_shape_are_refused() {
    let model = Model::new(6, 8);
    check(
        &model,
        |p| node(p, "relu1").op_type = "Sigmoid".into(),
        &["'relu1' (Sigmoid)", "not an operator"],
    );
    check(
        &model,
        |p| node(p, "relu1").op_type = "BatchNormalization".into(),
        &["fold batch normalisation"],
    );
    check(
        &model,
        |p| node(p, "relu1").domain = "com.example".into(),
        &["domain 'com.example'"],
    );
    check(
        &model,
        |p| node(p, "conv3").input[0] = "relu2_out".into(),
        &["'conv3'", "the skip is missing"],
    );
    check(
        &model,
        |p| node(p, "add3").input[1] = "relu1_out".into(),
        &["'add3'", "output[2] + input[1] is right"],
    );
    check(
        &model,
        |p| node(p, "conv2").input[0] = "relu0_out".into(),
        &["'conv2'", "layer 1's output is right"],
    );
    check(
        &model,
        |p| node(p, "relu2").input[0] = "nowhere".into(),
        &["'relu2'", "'nowhere'", "no earlier node"],
    );
    check(
        &model,
        |p| node(p, "conv5").input[0] = "sum5".into(),
        &["'conv5'", "concatenated"],
    );
    check(
        &model,
        |p| node(p, "concat").input.swap(0, 1),
        &["'concat'", "in this order"],
    );
    check(
        &model,
        |p| node(p, "concat").attribute = vec![int("axis", 2)],
        &["'concat'", "axis 1"],
    );
    check(
        &model,
        |p| node(p, "conv1").input[1] = "relu0_out".into(),
        &["'conv1'", "constant"],
    );
    check(
        &model,
        |p| p.graph.as_mut().unwrap().output[0].name = "sum3".into(),
        &["'sum3'", "last"],
    );
    check(&model, |p| p.graph.as_mut().unwrap().node.clear(), &["0 convolutions"]);
    check(&model, |p| p.graph = None, &["no graph"]);
    let reorder = |p: &mut ModelProto| p.graph.as_mut().unwrap().node.reverse();
    check(&model, reorder, &["no earlier node writes"]);
}

#[test]
fn impossible_shapes_are_refused() {
    let model = Model::new(3, 8);
    let shape = |tensor: &'static str, dims: &'static [i64]| {
        move |p: &mut ModelProto| {
            let tensors = &mut p.graph.as_mut().unwrap().initializer;
            tensors.iter_mut().find(|t| t.name == tensor).unwrap().dims = dims.to_vec();
        }
    };
    check(
        &model,
        shape("w1", &[8, 8, 9]),
        &["'conv1'", "(filters, 8, 3, 3) is right"],
    );
    check(&model, shape("w1", &[-8, 8, 3, 3]), &["'w1'", "negative"]);
    check(&model, shape("w1", &[1_000_000, 8, 3, 3]), &["'w1'", "values"]);
    check(&model, shape("w1", &[i64::MAX, i64::MAX, 3, 3]), &["'w1'", "values"]);
    check(&model, shape("b1", &[4]), &["'b1'", "values"]);
    let million = |p: &mut ModelProto| {
        let tensors = &mut p.graph.as_mut().unwrap().initializer;
        for (name, dims, count) in [
            ("w0", vec![1_000_000, 4, 3, 3], 36_000_000),
            ("b0", vec![1_000_000], 1_000_000),
        ] {
            let tensor = tensors.iter_mut().find(|t| t.name == name).unwrap();
            (tensor.dims, tensor.raw_data) = (dims, vec![0; 4 * count]);
        }
    };
    check(&model, million, &["'conv0'", "1000000 filters"]);
    let channels = |value: Option<i64>| {
        move |p: &mut ModelProto| {
            use tract_onnx::pb::{tensor_shape_proto::dimension::Value, type_proto};
            let input = &mut p.graph.as_mut().unwrap().input[0];
            let Some(type_proto::Value::TensorType(t)) = &mut input.r#type.as_mut().unwrap().value else {
                panic!()
            };
            t.shape.as_mut().unwrap().dim[1].value = value.map(Value::DimValue);
        }
    };
    check(&model, channels(Some(1_000_000)), &["'rgbd'", "1000000 channels"]);
    check(&model, channels(None), &["'rgbd'", "no channel count"]);
    check(&model, channels(Some(5)), &["'conv0'", "(filters, 5, 3, 3) is right"]);
    assert!(refusal(&Model { inputs: 5, ..model }.proto()).contains("4 channels"));
}

#[test]
fn broken_numbers_are_refused() {
    let f32_model = Model::new(3, 8);
    for bad in [f32::NAN, f32::INFINITY] {
        check(&f32_model, |p| set_f32(p, "w1", 5, bad), &["'w1'", "finite"]);
        check(&f32_model, |p| set_f32(p, "b2", 0, bad), &["'b2'", "finite"]);
    }
    let model = Model::int8(5, 8);
    for bad in [0.0, -1.0, f32::NAN, f32::INFINITY, 1e-42] {
        check(&model, |p| set_f32(p, "w1_scale", 5, bad), &["scale"]);
        check(&model, |p| set_f32(p, "rgbd_scale", 0, bad), &["rgbd"]);
        check(&model, |p| set_f32(p, "b2_scale", 1, bad), &["b2"]);
    }
    check(&model, |p| set_f32(p, "w1_scale", 5, 1e-37), &["scale"]);
    check(
        &model,
        |p| set_f32(p, "b1_scale", 5, 1.0),
        &["'conv1'", "input scale × weight scale"],
    );
    let zero_point = |p: &mut ModelProto| {
        let tensors = &mut p.graph.as_mut().unwrap().initializer;
        tensors
            .iter_mut()
            .find(|t| t.name == "relu0_out_zero")
            .unwrap()
            .raw_data = vec![3];
    };
    check(&model, zero_point, &["zero point 3", "0 is right"]);
    let bias = |p: &mut ModelProto| {
        let tensors = &mut p.graph.as_mut().unwrap().initializer;
        tensors.iter_mut().find(|t| t.name == "b1_q").unwrap().raw_data[..4].copy_from_slice(&i32::MAX.to_le_bytes());
    };
    check(&model, bias, &["'conv1'", "overflows"]);
    check(
        &model,
        |p| node(p, "rgbd/dq").input[1] = "relu0_out_scale".into(),
        &["'rgbd/dq'", "differ"],
    );
    check(
        &model,
        |p| node(p, "conv1").input[0] = "relu0_out".into(),
        &["'conv1'", "rounded input"],
    );
    check(
        &model,
        |p| node(p, "add3").input[1] = "relu0_out".into(),
        &["'add3'", "after its DequantizeLinear"],
    );
    check(
        &model,
        |p| node(p, "w1/dq").attribute = vec![int("axis", 1)],
        &["'w1/dq'", "axis 0"],
    );
}

#[test]
fn a_seeded_network_may_say_the_planes_of_its_seed() {
    let of = |input: &'static str, inputs: usize, seed_planes: Option<usize>| {
        let model = Model {
            input,
            inputs,
            seed_planes,
            ..Model::new(3, 8)
        };
        Network::from_onnx(&model.bytes())
    };
    assert_eq!(of("seeded", 10, Some(80)).unwrap().seed_planes(), Some(80));
    assert_eq!(of("seeded", 10, None).unwrap().seed_planes(), None);
    assert_eq!(of("rgbd", 4, Some(80)).unwrap().seed_planes(), None);
    for wrong in [0, 1025] {
        let message = of("seeded", 10, Some(wrong)).unwrap_err().to_string();
        let right = format!("'phasefront.seed_planes' is '{wrong}'; a number from 1 to 1024");
        assert!(message.contains(&right), "{message}");
    }
}

#[test]
fn missing_or_wrong_metadata_is_refused() {
    let model = Model::new(3, 8);
    for key in [
        "input",
        "head",
        "pitch_um",
        "wavelengths_nm",
        "volume_depth_mm",
        "offset_mm",
    ] {
        let name = format!("phasefront.{key}");
        check(
            &model,
            |p| p.metadata_props.retain(|e| e.key != name),
            &[&name, "is missing", "is right"],
        );
        let spoil = |p: &mut ModelProto| {
            p.metadata_props
                .iter_mut()
                .filter(|e| e.key == name)
                .for_each(|e| e.value = "-1,nan".into());
        };
        check(&model, spoil, &[&name, "'-1,nan'", "is right"]);
    }
    assert!(
        refusal(
            &Model {
                tanh: true,
                ..model.clone()
            }
            .proto()
        )
        .contains("no Tanh")
    );
    assert!(
        refusal(
            &Model {
                head: "amplitude-phase",
                ..model.clone()
            }
            .proto()
        )
        .contains("needs a Tanh")
    );
    assert!(
        refusal(
            &Model {
                input: "ldi5",
                ..model.clone()
            }
            .proto()
        )
        .contains("20 channels")
    );
    assert!(
        refusal(
            &Model {
                input: "field",
                ..model
            }
            .proto()
        )
        .contains("'field' with 6 channels")
    );
}
