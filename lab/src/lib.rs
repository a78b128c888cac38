//! Ground truth, data sets, evaluation: what prepares a display or a network for the phone.

pub mod bench;
pub mod calibrate;
pub mod ceiling;
pub mod corrected;
pub mod dataset;
pub mod depth_network;
pub mod depth_study;
pub mod error;
pub mod evaluate;
pub mod files;
pub mod film;
pub mod fit;
pub mod flicker;
pub mod gpu;
pub mod ldi;
pub mod metrics;
pub mod models;
mod npy;
pub mod occlusion;
pub mod photo;
pub mod pictures;
pub mod plot;
pub mod point_based;
pub mod reconstruct;
pub mod rgbd;
pub mod scene;
pub mod seeds;
pub mod sequence;
pub mod simulated_display;
pub mod sm_lbm;
pub mod study;
pub mod sweep_study;
pub mod video;
pub mod viewer;

pub use error::{Error, Result};
