//! Plants each cause on simulated displays, alone and in pairs, and prints how often a diagnosis finds it. Takes
//! minutes for each display.
//!
//!     cargo run --release --package phasefront-calibration --example planted [-- --tuned]
//!
//! By default on displays that the diagnosis was not tuned on, with `--tuned` on those that it was.
#![allow(clippy::unwrap_used)]

#[path = "../../tests/diagnose/displays.rs"]
mod displays;
mod held_out;
#[path = "../../tests/diagnose/plant.rs"]
mod plant;

use phasefront_io::dice::Dice;
use plant::{Bench, Plant, diagnosed, names};
use std::collections::BTreeMap;

/// The number of plants of each cause, found ones among them, and of causes that were named and not there.
#[derive(Default)]
struct Table {
    alone: BTreeMap<&'static str, [usize; 3]>,
    in_pairs: BTreeMap<&'static str, [usize; 2]>,
    pairs: [usize; 3],
    good: [usize; 2],
}

impl Table {
    fn add(&mut self, bench: &Bench, plants: &[Plant], shot: u64) {
        let diagnosis = diagnosed(bench, plants, shot);
        let found = names(&diagnosis);
        let hits = plants.iter().filter(|plant| found.contains(&plant.name())).count();
        let others = found.len() - hits;
        println!("{}: {plants:?}: {found:?}", bench.name);
        match plants {
            [] => {
                self.good[0] += 1;
                self.good[1] += usize::from(others > 0);
            }
            [plant] => {
                let row = self.alone.entry(plant.name()).or_default();
                *row = [row[0] + 1, row[1] + hits, row[2] + usize::from(others > 0)];
            }
            _ => {
                for plant in plants {
                    let row = self.in_pairs.entry(plant.name()).or_default();
                    *row = [row[0] + 1, row[1] + usize::from(found.contains(&plant.name()))];
                }
                self.pairs[0] += 1;
                self.pairs[1] += usize::from(hits == plants.len());
                self.pairs[2] += usize::from(others > 0);
            }
        }
    }

    fn print(&self) {
        println!("\n| cause | alone | with another name | in pairs |\n|---|---|---|---|");
        for (name, [planted, found, others]) in &self.alone {
            let [pairs, in_pairs] = self.in_pairs.get(name).copied().unwrap_or_default();
            println!("| {name} | {found} of {planted} | {others} | {in_pairs} of {pairs} |");
        }
        let sum = |at: usize| self.alone.values().map(|row| row[at]).sum::<usize>();
        println!("| all | {} of {} | {} | |", sum(1), sum(0), sum(2));
        let [planted, both, others] = self.pairs;
        println!("\npairs: both found in {both} of {planted}, another name in {others}");
        println!("good displays: {} of {} with a false alarm", self.good[1], self.good[0]);
    }
}

fn run(benches: &[Bench], pairs: usize, good: u64, seed: u64) {
    let mut table = Table::default();
    for bench in benches {
        let lasers = bench.display.colours();
        let mut dice = Dice::new(seed ^ bench.seed);
        for shot in 0..good {
            table.add(bench, &[], shot);
        }
        for (at, plant) in Plant::each(lasers, &mut dice).into_iter().enumerate() {
            table.add(bench, &[plant], 100 + at as u64);
        }
        for pair in 0..pairs {
            let [one, other] = loop {
                let (ones, others) = (Plant::each(lasers, &mut dice), Plant::each(lasers, &mut dice));
                let pair = [dice.pick(&ones), dice.pick(&others)];
                if pair[0].goes_with(&pair[1]) {
                    break pair;
                }
            };
            table.add(bench, &[one, other], 200 + pair as u64);
        }
    }
    table.print();
}

fn main() {
    if std::env::args().any(|argument| argument == "--tuned") {
        let benches = [
            displays::on_the_panel(),
            displays::three_lasers(),
            displays::one_laser(),
        ];
        run(&benches, 6, 2, 5);
    } else {
        run(&held_out::benches(), 5, 3, 2027);
    }
}
