//! Light and aberrations: the laser's amplitude over the modulator, and the aberration of a focused spot.

pub mod laser;
pub mod pupil;
pub mod spot;
