//! Chooses instruction sets: each gives the same holograms, and a name that this processor lacks is refused.

use crate::folder::Folder;
use serde_json::Value;
use std::collections::BTreeSet;
use std::process::{Command, Output};

/// Runs the command with at most the instruction set `kernels`.
fn run(folder: &Folder, kernels: &str, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_phasefront"))
        .args(arguments)
        .current_dir(folder.0.path())
        .env("PHASEFRONT_KERNELS", kernels)
        .output()
        .unwrap()
}

/// Returns the names of this processor's int8 and f32 kernels.
fn kernels(folder: &Folder) -> [Vec<String>; 2] {
    let report: Value = serde_json::from_str(&folder.succeeds(&["doctor", "--json"])).unwrap();
    ["int8_kernels", "f32_kernels"].map(|kind| serde_json::from_value(report["machine"][kind].clone()).unwrap())
}

#[test]
fn every_instruction_set_makes_the_same_holograms() {
    let folder = Folder::new().with_frame();
    let names: BTreeSet<_> = kernels(&folder).into_iter().flatten().collect();
    for method in ["--network 8", "--method sweep --planes 8"] {
        let mut images = Vec::new();
        for name in &names {
            let call = format!("hologram --rgb rgb.png --depth depth.png {method} -o {name}.png");
            let output = run(&folder, name, &call.split(' ').collect::<Vec<_>>());
            assert!(output.status.success(), "{name}: {output:?}");
            images.push(std::fs::read(folder.path(&format!("{name}.png"))).unwrap());
        }
        assert!(images.iter().all(|image| *image == images[0]), "{method}, {names:?}");
    }
}

#[test]
fn the_bench_measures_the_named_instruction_set() {
    let folder = Folder::new();
    let [int8, f32] = kernels(&folder);
    for (precision, names) in [("int8", int8), ("f32", f32)] {
        for name in names {
            let call =
                format!("bench --layers 8 --precision {precision} --size 40x30 --seconds 0 --kernels {name} --json");
            let text = folder.succeeds(&call.split(' ').collect::<Vec<_>>());
            let report: Value = serde_json::from_str(&text).unwrap();
            assert_eq!(report["rows"][0]["kernels"], name.as_str(), "{report}");
        }
    }
}

#[test]
fn instruction_sets_that_this_processor_lacks_are_refused_in_one_line() {
    let folder = Folder::new();
    let by_variable = String::from_utf8(run(&folder, "sse9", &["networks"]).stderr).unwrap();
    let by_flag = folder.fails(&["bench", "--kernels", "sse9"], 2);
    for (errors, source) in [(by_variable, "PHASEFRONT_KERNELS"), (by_flag, "--kernels")] {
        assert_eq!(errors.lines().count(), 1, "{errors}");
        for word in [source, "sse9", "portable"] {
            assert!(errors.contains(word), "{errors}");
        }
    }
    let call = ["bench", "--kernels", "portable", "--backend", "gpu"];
    assert!(folder.fails(&call, 2).contains("--backend cpu"));
}
