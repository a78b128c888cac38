//! Calibration of the optics: the laser's amplitude over the modulator, and aberrations from a focused spot.

pub mod laser;
pub mod pupil;
pub mod spot;
