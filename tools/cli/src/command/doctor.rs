//! `phasefront doctor`: reports what this machine offers and which of it is used, and tests its results.

use crate::flags::encoder::EncoderFlags;
use clap::Args;
use phasefront::Size;
use phasefront::{Display, Method};
use phasefront_cli::doctor::{self, Check, Machine};
use phasefront_cli::gpu;
use phasefront_command::flags::DisplayFlags;
use phasefront_command::{networks, terminal};
use phasefront_io::Result;
use phasefront_models::default_network;
use serde::Serialize;
use serde_json::json;

/// Report what this machine offers and which of it is used, and test whether it computes correctly
///
/// Exits with 1 if the self-test fails. Attach the output to bug reports.
#[derive(Args)]
pub(crate) struct Doctor {
    /// Part of the name of the GPU to test [default: the fastest; drivers in software are taken by name only]
    #[arg(long, value_name = "NAME")]
    gpu: Option<String>,
    #[command(flatten)]
    display: DisplayFlags,
}

/// The defaults of `phasefront hologram`.
#[derive(Serialize)]
struct Chosen {
    display: String,
    method: String,
    kernels: Option<String>,
    encoder: String,
    backend: &'static str,
}

impl Doctor {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        let display = self.display.read()?.target.display;
        let machine = Machine::this();
        let chosen = Chosen::of(&display)?;
        let mut checks = doctor::self_test()?;
        checks.push(doctor::test_gpu(&gpu::options(self.gpu.as_deref())));
        let threads = rayon::current_num_threads();
        terminal::print(
            json,
            &json!({
                "version": env!("CARGO_PKG_VERSION"), "machine": machine, "threads": threads, "chosen": chosen,
                "self_test": checks,
            }),
            lines(&machine, threads, &chosen, &checks).join("\n"),
        );
        doctor::verdict(&checks)
    }
}

impl Chosen {
    fn of(display: &Display) -> Result<Self> {
        let Size { width, height } = display.size();
        let network = default_network(display);
        let method = match &network {
            Some(network) => format!(
                "auto: the network of {} layers where the edges of depth are soft, the plane sweep otherwise",
                network.layers()
            ),
            None => {
                let why = networks::network("8", None)?.check_display(display);
                let why = why.map_or_else(|why| why.to_string(), |()| "none is bundled".into());
                format!("auto: the plane sweep, for no network suits the display ({why})")
            }
        };
        let kernels = match network {
            Some(network) => {
                let plan = phasefront_core::method::MethodPlan::new(display.size(), Method::Network(network), display)?;
                plan.engine().map(|engine| format!("{}: {}", engine.name, engine.why))
            }
            None => None,
        };
        let lasers: Vec<_> = (display.wavelengths_m().iter())
            .map(|lambda| (lambda * 1e9).round().to_string())
            .collect();
        Ok(Chosen {
            display: format!(
                "{width}×{height} of {} µm, {} nm, {} mm deep, modulator at {} mm",
                display.pitch_m() * 1e6,
                lasers.join("/"),
                display.volume_depth_m() * 1e3,
                display.offset_m() * 1e3
            ),
            method,
            kernels,
            encoder: format!(
                "{}: the default, for any display and offset",
                EncoderFlags::default().read()?.describe()
            ),
            backend: "cpu: the default; --backend gpu asks for a GPU",
        })
    }
}

fn lines(machine: &Machine, threads: usize, chosen: &Chosen, checks: &[Check]) -> Vec<String> {
    let mut lines = Vec::new();
    let mut say = |name: &str, value: String| lines.push(format!("{name:14} {value}"));
    say("phasefront", env!("CARGO_PKG_VERSION").into());
    say("system", machine.system.clone());
    say("cpu", machine.cpu.clone());
    say("cores", format!("{}, of which {threads} compute", machine.cores));
    let mib = |size: Option<u64>| size.map_or("not told by the system".into(), |size| format!("{size} MiB"));
    say("memory", mib(machine.memory_mib));
    if machine.memory_limit_mib.is_some() {
        say("memory limit", mib(machine.memory_limit_mib));
    }
    say("int8 kernels", machine.int8_kernels.join(", "));
    say("f32 kernels", machine.f32_kernels.join(", "));
    for gpu in &machine.gpus {
        let kind = if gpu.software {
            ", in software: taken by name only"
        } else {
            ""
        };
        say(
            "gpu",
            format!("{} ({}, driver {}){kind}", gpu.name, gpu.backend, gpu.driver),
        );
    }
    if machine.gpus.is_empty() {
        say("gpu", "no driver of Vulkan, Metal or DirectX 12 answers".into());
    }
    say("display", chosen.display.clone());
    say("method", chosen.method.clone());
    if let Some(kernels) = &chosen.kernels {
        say("kernels", kernels.clone());
    }
    say("encoder", chosen.encoder.clone());
    say("backend", chosen.backend.into());
    for check in checks {
        let word = match check.passed {
            Some(true) => "passed",
            Some(false) => "FAILED",
            None => "skipped",
        };
        say(word, format!("{}: {}", check.name, check.says));
    }
    lines
}
