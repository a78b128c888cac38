//! A live session's thread, queue and locks under shuttle, which runs one thread at a time and chooses, again and again
//! anew, which one goes on at each lock. A schedule in which all wait for each other fails, and is printed to be run
//! again.
#![allow(dead_code)]

mod session;

fn main() {
    let schedules = std::env::var("PHASEFRONT_SCHEDULES").map_or(40_000, |count| count.parse().expect("a number"));
    session::check(schedules);
    println!("{schedules} schedules of each situation: every frame is reported exactly once, and nobody waits for ever");
}
