//! Tests that `phasefront doctor` describes a machine and tests it.
use crate::driver;
use crate::folder;

use folder::Folder;
use serde_json::Value;

#[test]
fn every_fact_is_a_line_and_the_self_test_passes() {
    let folder = Folder::new();
    let text = folder.succeeds(&["--threads", "1", "doctor"]);
    for fact in [
        "phasefront",
        "system",
        "cpu",
        "cores",
        "memory",
        "int8 kernels",
        "f32 kernels",
        "gpu",
        "display",
        "method",
        "kernels",
        "encoder",
        "backend",
    ] {
        let told = text
            .lines()
            .any(|line| line.len() > 15 && line[..14].trim_end() == fact);
        assert!(told, "{fact}: {text}");
    }
    assert!(text.contains("of which 1 compute"), "{text}");
    for tested in [
        "int8 network",
        "f32 network",
        "plane sweep",
        "propagation",
        "whole frame",
    ] {
        assert!(text.contains(&format!("passed         {tested}: ")), "{text}");
    }
    assert!(!text.contains("FAILED"), "{text}");
}

#[test]
fn what_is_chosen_is_for_the_display_that_is_asked_for() {
    let folder = Folder::new();
    let told = |arguments: &[&str]| -> Value { serde_json::from_str(&folder.succeeds(arguments)).unwrap() };
    let default = told(&["doctor", "--json"]);
    assert_eq!(default["version"], env!("CARGO_PKG_VERSION"));
    let kernels = default["machine"]["int8_kernels"].as_array().unwrap();
    assert_eq!(kernels.last().unwrap(), "portable");
    let chosen = default["chosen"]["kernels"].as_str().unwrap();
    assert!(chosen.contains("fused chain"), "{chosen}");
    let tested = default["self_test"].as_array().unwrap();
    assert!(tested.iter().all(|check| check["passed"] != false), "{tested:?}");

    // No network was trained for this volume.
    std::fs::write(
        folder.path("deep.toml"),
        "width = 64\nheight = 48\nvolume_depth_mm = 20",
    )
    .unwrap();
    let deep = told(&["doctor", "--json", "--display", "deep.toml"]);
    let method = deep["chosen"]["method"].as_str().unwrap();
    assert!(
        method.contains("no network suits") && deep["chosen"]["kernels"].is_null(),
        "{deep}"
    );
    let errors = folder.fails(&["doctor", "--display", "nowhere.toml"], 1);
    assert!(errors.contains("nowhere.toml"), "{errors}");
}

#[test]
fn a_driver_in_software_is_tested_by_name() {
    let folder = Folder::new();
    let told: Value = serde_json::from_str(&folder.succeeds(&["doctor", "--json", "--gpu", "llvmpipe"])).unwrap();
    let software = |gpu: &Value| gpu["software"] == true && gpu["name"].as_str().unwrap().contains("llvmpipe");
    let there = told["machine"]["gpus"].as_array().unwrap().iter().any(software);
    driver::opened(there.then_some(()).ok_or("there is no llvmpipe"));
    let tests = told["self_test"].as_array().unwrap();
    let gpu = tests.iter().find(|check| check["name"] == "gpu").unwrap();
    assert_eq!(gpu["passed"], true, "{gpu}");
}
