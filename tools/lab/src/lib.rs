//! Ground truth for holograms: scenes, training data sets, simulated sensors, evaluation, and the studies of the
//! paper.

pub mod dataset;
pub mod evaluate;
pub mod scene;
pub mod seeds;
pub mod sensor;
pub mod stacks;
pub mod study;
