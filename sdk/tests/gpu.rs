//! What runs on the GPU against its twin on the CPU, on whatever device there is: Mesa's driver in software will do.
#![cfg(feature = "gpu")]
#![allow(clippy::unwrap_used)]

mod network_models;

use network_models::{Model, frame};
use phasefront::Network;
use phasefront::gpu::{ChainOptions, Device, DeviceOptions, Float, Fusion, NetworkPlan};
use phasefront::network::{Isa, reference};
use std::sync::{Arc, OnceLock};

/// The device of all tests; none where there is no driver, which the test says.
fn device() -> Option<Arc<Device>> {
    static DEVICE: OnceLock<Option<Arc<Device>>> = OnceLock::new();
    let opened = DEVICE.get_or_init(|| {
        let software = DeviceOptions {
            name: Some("llvmpipe".into()),
            ..Default::default()
        };
        let opened = Device::open(&DeviceOptions::default()).or_else(|_| Device::open(&software));
        opened.ok().map(Arc::new)
    });
    if opened.is_none() {
        println!("skipped: no GPU and no driver in software (mesa-vulkan-drivers)");
    }
    opened.clone()
}

fn largest_difference(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, |worst, d| if d > worst || d.is_nan() { d } else { worst })
}

fn run(network: &Network, options: ChainOptions, (h, w): (usize, usize), input: &[f32]) -> Vec<f32> {
    let device = device().unwrap();
    let plan = NetworkPlan::new(&device, network, h, w, options).unwrap();
    let mut output = vec![f32::NAN; 6 * h * w];
    plan.run(input, &mut output).unwrap();
    output
}

const SIZES: [(usize, usize); 3] = [(1, 1), (7, 33), (47, 61)];

#[test]
fn chains_in_f32_and_f16_agree_with_the_definition() {
    let Some(device) = device() else { return };
    let models = [
        Model::new(2, 8),
        Model {
            tanh: true,
            head: "amplitude-phase",
            ..Model::new(5, 24)
        },
        Model {
            inputs: 6,
            input: "field",
            tanh: true,
            head: "amplitude-phase",
            ..Model::new(4, 8)
        },
        Model {
            inputs: 20,
            input: "ldi5",
            ..Model::new(8, 16)
        },
        // Filters that fill no block of eight, and a width that fills no group.
        Model::new(7, 12),
        Model::new(6, 5),
    ];
    for model in models {
        let network = Network::from_onnx(&model.bytes()).unwrap();
        for size in SIZES {
            let input = frame(model.inputs, size.0, size.1, 7);
            let expected = reference::run(network.chain(), &input, size.0, size.1);
            let largest = expected.iter().fold(1.0f32, |most, v| most.max(v.abs()));
            let mut fused = Vec::new();
            for (float, fusion, tolerance) in [
                (Float::F32, Fusion::Layers, 1e-4),
                (Float::F32, Fusion::Pairs, 1e-4),
                (Float::F16, Fusion::Layers, 0.02),
                (Float::F16, Fusion::Pairs, 0.02),
            ] {
                if float == Float::F16 && !device.has_half() {
                    println!("skipped: {device:?} has no 16-bit floating point");
                    continue;
                }
                let options = ChainOptions { float, fusion };
                let output = run(&network, options, size, &input);
                let worst = largest_difference(&output, &expected) / largest;
                assert!(
                    worst < tolerance,
                    "{} layers, {size:?}, {options:?}: {worst}",
                    model.layers
                );
                fused.push(output);
            }
            for both in fused.chunks_exact(2) {
                assert!(both[0] == both[1], "{size:?}: fusion changes bits");
            }
        }
    }
}

#[test]
fn chains_in_int8_have_the_bits_of_the_cpu() {
    if device().is_none() {
        return;
    }
    let models = [
        Model::int8(2, 8),
        Model::int8(3, 24),
        Model::int8(4, 16),
        Model {
            tanh: true,
            head: "amplitude-phase",
            ..Model::int8(5, 8)
        },
        Model {
            inner_roundings: false,
            ..Model::int8(5, 8)
        },
        Model {
            inner_roundings: false,
            ..Model::int8(8, 8)
        },
        Model {
            inputs: 6,
            input: "field",
            tanh: true,
            head: "amplitude-phase",
            ..Model::int8(6, 8)
        },
        Model::int8(8, 24),
    ];
    for model in models {
        let network = Network::from_onnx(&model.bytes()).unwrap();
        for size in SIZES {
            let input = frame(model.inputs, size.0, size.1, 7);
            let plan = network.plan_on(Isa::Portable, size.0, size.1).unwrap();
            let mut expected = vec![0.0; 6 * size.0 * size.1];
            plan.run(&input, &mut expected, &mut plan.scratch()).unwrap();
            for fusion in [Fusion::Layers, Fusion::Pairs] {
                let options = ChainOptions {
                    float: Float::F32,
                    fusion,
                };
                let output = run(&network, options, size, &input);
                let what = format!("{} layers, {size:?}, {fusion:?}", model.layers);
                if model.tanh {
                    assert!(largest_difference(&output, &expected) < 1e-5, "{what}");
                } else {
                    assert!(output == expected, "{what}");
                }
            }
        }
    }
}
