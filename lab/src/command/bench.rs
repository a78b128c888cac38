//! `phasefront bench`: how fast a frame is on this machine, stage by stage.

use super::flags::{DisplayFlags, parse_size, progress_bar};
use super::hologram::PrecisionName;
use clap::Args;
use phasefront_lab::bench::{self, Case, Machine, Row};
use phasefront_lab::models::{self, BUILT_IN, Built};
use phasefront_lab::plot::{self, Bar};
use phasefront_lab::{Error, Result, files};
use serde_json::json;
use std::path::PathBuf;
use std::time::Duration;

/// Measure how fast a frame is, stage by stage; all combinations of what is not given
#[derive(Args)]
pub(crate) struct Bench {
    /// Layers of the network
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
    /// ONNX file of a pre-filter, for the deep encoding instead of AA-DPM
    #[arg(long, value_name = "FILE")]
    prefilter: Option<String>,
    /// Draw the stages' times there
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    display: DisplayFlags,
}

impl Bench {
    pub(crate) fn run(self, threads: Option<usize>, json: bool) -> Result<()> {
        if let Some(path) = &self.plot
            && !files::has_extension(path, "svg")
        {
            return Err(Error::file(path, "the name must end in .svg"));
        }
        let display = self.display.read()?.display;
        let prefilter = match &self.prefilter {
            Some(file) => Some(models::network(file, false)?),
            None => None,
        };
        let budget = Duration::try_from_secs_f64(self.seconds)
            .map_err(|_| Error::Input("--seconds must be a number of seconds, 0 or more".into()))?;
        let wanted = |built: &&Built| {
            self.layers.is_none_or(|layers| layers == built.layers)
                && self.precision.is_none_or(|p| p.is_int8() == built.int8)
        };
        let networks: Vec<_> = match &self.network {
            Some(file) => vec![models::network(file, false)?],
            None => (BUILT_IN.iter().filter(wanted))
                .map(models::built_in)
                .collect::<Result<_>>()?,
        };
        if networks.is_empty() {
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
        for network in &networks {
            for &size in &sizes {
                cases.extend(threads.iter().map(|&threads| Case {
                    network,
                    size,
                    threads,
                    prefilter: prefilter.as_ref(),
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
        if let Some(path) = &self.plot {
            plot::write_bars(path, &title(&machine, &rows[0]), &bars(&rows))?;
        }
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
    text += "| layers | precision | kernels | size | threads | network ms | propagate ms | encode ms | frame ms (least–most) | GMAC/s | % of peak | memory MB |\n";
    text += "|---|---|---|---|---|---|---|---|---|---|---|---|";
    for row in rows {
        let stage = |name| row.stage_ms.get(name).copied().unwrap_or(0.0);
        text += &format!(
            "\n| {} | {} | {} | {}×{} | {} | {:.1} | {:.1} | {:.1} | {:.1} ({:.1}–{:.1}) | {:.0} | {} | {} |",
            row.layers,
            row.precision,
            row.kernels,
            row.width,
            row.height,
            row.threads,
            stage("network"),
            stage("propagate"),
            stage("encode"),
            row.total_ms,
            row.spread_ms[0],
            row.spread_ms[1],
            row.gmac_per_s,
            whole(row.peak_percent),
            whole(row.peak_memory_mb),
        );
    }
    text
}

fn title(machine: &Machine, row: &Row) -> String {
    format!(
        "{}, {} cores: ms a frame, offset {} mm, {}",
        machine.cpu, machine.cores, row.offset_mm, row.encoder
    )
}

fn bars(rows: &[Row]) -> Vec<Bar> {
    let bar = |row: &Row| Bar {
        label: format!(
            "{} layers {} {}×{}, {} thr.",
            row.layers, row.precision, row.width, row.height, row.threads
        ),
        parts: ["network", "propagate", "encode"]
            .map(|stage| (stage, row.stage_ms.get(stage).copied().unwrap_or(0.0)))
            .to_vec(),
    };
    rows.iter().map(bar).collect()
}

fn whole(value: Option<f64>) -> String {
    value.map_or("–".into(), |value| format!("{value:.0}"))
}
