//! Runs a live session's thread, queue and locks under shuttle, which runs one thread at a time and chooses at each
//! lock which one continues. A schedule that deadlocks fails and is printed so that it can be replayed.
#![allow(dead_code)]

mod session;

fn main() {
    let schedules = std::env::var("PHASEFRONT_SCHEDULES").map_or(40_000, |count| count.parse().expect("a number"));
    session::check(schedules);
    println!("{schedules} schedules of each situation: every frame is reported exactly once, and nobody waits for ever");
}
