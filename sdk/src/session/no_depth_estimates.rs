//! Depth networks without the feature `tract`, which runs them: there are none.

use super::options::SessionOptions;
use ndarray::Array2;
use phasefront_core::Size;
use phasefront_core::frame::Past;
use phasefront_core::runtime::cancel::Cancel;
use phasefront_core::runtime::error::Result;
use std::sync::Arc;

pub(super) enum DepthEstimates {}

impl DepthEstimates {
    pub(super) fn for_each_frame(_: &SessionOptions) -> Option<Self> {
        None
    }

    pub(super) fn on_own_thread(_: &SessionOptions) -> Result<Option<Self>> {
        Ok(None)
    }

    pub(super) fn estimate(&mut self, _: &[f32], _: Size, _: Option<Past>, _: &Cancel) -> Result<Arc<Array2<f32>>> {
        match *self {}
    }
}
