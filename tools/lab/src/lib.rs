//! Ground truth for holograms: scenes, training data sets, evaluation, and the studies of the paper.

pub mod dataset;
pub mod evaluate;
pub mod scene;
pub mod seeds;
pub mod study;
