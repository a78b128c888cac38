//! Ground truth: scenes, data sets for training, the evaluation of holograms and the paper's studies.

pub mod dataset;
pub mod evaluate;
pub mod scene;
pub mod seeds;
pub mod study;
