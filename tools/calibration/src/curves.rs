//! Phase curves: fits, tables for each pixel, and reports.

pub mod chart;
pub mod curve;
pub mod lut;
pub mod report;
pub mod surface;
