//! The parts of the command `phasefront` other than making holograms: pages and screens that show them, links to
//! modulators, time multiplexing, and measurements of a machine.

pub mod bench;
pub mod doctor;
pub mod frame_statistics;
pub mod gpu;
pub mod modulator;
pub mod viewer;
