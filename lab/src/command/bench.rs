//! `phasefront bench`: how fast a frame is on this machine, stage by stage.

use super::flags::{DisplayFlags, parse_size, progress_bar};
use super::hologram::PrecisionName;
use clap::Args;
use phasefront::{Method, Sweep};
use phasefront_lab::bench::{self, Case, Machine, Row};
use phasefront_lab::models::{self, BUILT_IN, Built};
use phasefront_lab::{Error, Result};
use serde_json::json;
use std::time::Duration;

/// Measure how fast a frame is, stage by stage; all combinations of what is not given
#[derive(Args)]
pub(crate) struct Bench {
    /// Layers of the network; 0 is the plane sweep
    #[arg(long, value_name = "L")]
    layers: Option<usize>,
    /// Its numbers
    #[arg(long, value_enum)]
    precision: Option<PrecisionName>,
    /// An ONNX file instead of the networks that come along
    #[arg(long, value_name = "FILE", conflicts_with_all = ["layers", "precision"])]
    network: Option<String>,
    /// Width and height [default: 384x384, 960x540 and 1920x1080]
    #[arg(long, value_name = "WxH", value_parser = parse_size)]
    size: Option<(usize, usize)>,
    /// Seconds to spend on each combination; five frames at least
    #[arg(long, value_name = "S", default_value_t = 2.0)]
    seconds: f64,
    #[command(flatten)]
    display: DisplayFlags,
}

impl Bench {
    pub(crate) fn run(self, threads: Option<usize>, json: bool) -> Result<()> {
        let display = self.display.read()?.display;
        let budget = Duration::try_from_secs_f64(self.seconds)
            .map_err(|_| Error::Input("--seconds must be a number of seconds, 0 or more".into()))?;
        let wanted = |built: &&Built| {
            self.layers.is_none_or(|layers| layers == built.layers)
                && self.precision.is_none_or(|p| p.is_int8() == built.int8)
        };
        let mut methods: Vec<_> = match &self.network {
            Some(file) => vec![Method::trained(models::network(file, false)?)],
            None => (BUILT_IN.iter().filter(wanted))
                .map(|built| Ok(Method::trained(models::built_in(built)?)))
                .collect::<Result<_>>()?,
        };
        if self.network.is_none() && self.layers.is_none_or(|layers| layers == 0) {
            methods.push(Method::Sweep(Sweep::for_display(&display)));
        }
        if methods.is_empty() {
            return Err(Error::Input(
                "no network of that many layers comes along; `phasefront bench` without --layers shows which do".into(),
            ));
        }
        let sizes = self
            .size
            .map_or(vec![(384, 384), (960, 540), (1920, 1080)], |size| {
                vec![size]
            });
        let machine = Machine::this();
        let threads = threads.map_or_else(
            || match machine.cores {
                1 => vec![1],
                cores => vec![1, cores],
            },
            |threads| vec![threads],
        );
        let mut cases = Vec::new();
        for method in &methods {
            for &size in &sizes {
                cases.extend(threads.iter().map(|&threads| Case {
                    method,
                    size,
                    threads,
                }));
            }
        }
        let bar = progress_bar(cases.len() as u64, "combinations");
        let mut rows = Vec::new();
        for case in &cases {
            rows.push(bench::measure(case, &display, budget)?);
            bar.inc(1);
        }
        bar.finish_and_clear();
        super::print(
            json,
            &json!({"machine": machine, "rows": rows}),
            table(&machine, &rows),
        );
        Ok(())
    }
}

fn table(machine: &Machine, rows: &[Row]) -> String {
    let mut text = format!("{}, {} cores\n\n", machine.cpu, machine.cores);
    text += "| method | layers | precision | kernels | size | threads | method ms | propagate ms | encode ms | frame ms (least–most) | GMAC/s | % of peak | memory MB |\n";
    text += "|---|---|---|---|---|---|---|---|---|---|---|---|---|";
    for row in rows {
        let stage = |name| row.stage_ms.get(name).copied().unwrap_or(0.0);
        text += &format!(
            "\n| {} | {} | {} | {} | {}×{} | {} | {:.1} | {:.1} | {:.1} | {:.1} ({:.1}–{:.1}) | {} | {} | {} |",
            row.method,
            row.layers,
            row.precision,
            row.kernels,
            row.width,
            row.height,
            row.threads,
            stage(row.method),
            stage("propagate"),
            stage("encode"),
            row.total_ms,
            row.spread_ms[0],
            row.spread_ms[1],
            whole(row.gmac_per_s),
            whole(row.peak_percent),
            whole(row.peak_memory_mb),
        );
    }
    text
}

fn whole(value: Option<f64>) -> String {
    value.map_or("–".into(), |value| format!("{value:.0}"))
}
