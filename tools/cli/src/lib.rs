//! What the command `phasefront` does besides making holograms: pages and screens to look at them on, links to
//! modulators, time multiplexing, depth from a network, and measurements of a machine.

pub mod bench;
pub mod depth_network;
pub mod doctor;
pub mod gpu;
pub mod modulator;
pub mod viewer;
