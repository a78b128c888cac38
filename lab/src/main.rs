//! The command `phasefront`.

fn main() {}
