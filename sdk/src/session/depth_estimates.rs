//! Depth of frames without depth, by the session's depth network. A live session runs it on its own thread, at the
//! network's own rate: each frame takes the newest estimate. Other sessions run it for each frame.

use super::guarded::lock;
use super::options::SessionOptions;
use ndarray::Array2;
use phasefront_core::Size;
use phasefront_core::depth_network::{DepthEstimator, DepthNetwork};
use phasefront_core::frame::Past;
use phasefront_core::runtime::cancel::Cancel;
use phasefront_core::runtime::error::{Error, Result};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::Builder;
use std::time::Duration;

/// The time after which a frame that waits for its estimate looks whether it was given up.
const PATIENCE: Duration = Duration::from_millis(20);

/// The estimates of a session.
pub(super) enum DepthEstimates {
    EachFrame(Box<Planned>),
    OwnThread(Arc<Exchange>),
}

/// A network, planned for the latest picture's shape.
pub(super) struct Planned {
    network: Arc<DepthNetwork>,
    latest: Option<(Size, DepthEstimator)>,
}

impl Planned {
    fn new(network: Arc<DepthNetwork>) -> Self {
        Planned { network, latest: None }
    }

    fn estimate(&mut self, rgb: &[f32], size: Size) -> Result<Arc<Array2<f32>>> {
        let latest = match self.latest.take() {
            Some(latest) if latest.0 == size => latest,
            _ => (size, self.network.estimator(size)?),
        };
        let (_, estimator) = self.latest.insert(latest);
        estimator.estimate(rgb).map(Arc::new)
    }
}

/// A picture to estimate, (3, H, W), and its (H, W).
struct Picture {
    rgb: Vec<f32>,
    size: Size,
}

#[derive(Default)]
struct Slots {
    picture: Option<Picture>,
    /// Memory for the next picture.
    spare: Vec<f32>,
    newest: Option<Result<Arc<Array2<f32>>>>,
    /// Whether the thread works on a picture.
    busy: bool,
    /// The number of times the past was forgotten. A picture from before gives no estimate.
    epoch: u64,
    ended: bool,
}

/// The hand-over between a session's frames and the thread of its depth network.
#[derive(Default)]
pub(super) struct Exchange {
    slots: Mutex<Slots>,
    changed: Condvar,
}

impl DepthEstimates {
    /// Returns estimates for each frame, or `None` if the options have no depth network.
    pub(super) fn for_each_frame(options: &SessionOptions) -> Option<Self> {
        let network = options.depth_network.clone()?;
        Some(DepthEstimates::EachFrame(Box::new(Planned::new(network))))
    }

    /// Starts the network's thread, or returns `None` if the options have no depth network.
    ///
    /// # Errors
    /// Returns an error if the thread cannot be started.
    pub(super) fn on_own_thread(options: &SessionOptions) -> Result<Option<Self>> {
        let Some(network) = options.depth_network.clone() else {
            return Ok(None);
        };
        let exchange = Arc::new(Exchange::default());
        let of = exchange.clone();
        Builder::new()
            .name("phasefront depth".into())
            .spawn(move || of.run(Planned::new(network)))
            .map_err(|e| Error::Threads(Arc::new(e)))?;
        Ok(Some(DepthEstimates::OwnThread(exchange)))
    }

    /// Returns the relative inverse depth for a frame with the picture `rgb`, (3, H, W), of `size`: that of
    /// the frame itself if it has no `past` or each frame has its own, otherwise the newest there is.
    ///
    /// # Errors
    /// Returns an error if the network does not estimate the picture, or if `cancel` is requested.
    pub(super) fn estimate(
        &mut self,
        rgb: &[f32],
        size: Size,
        past: Option<Past>,
        cancel: &Cancel,
    ) -> Result<Arc<Array2<f32>>> {
        match self {
            DepthEstimates::EachFrame(planned) => planned.estimate(rgb, size),
            DepthEstimates::OwnThread(exchange) => exchange.estimate(rgb, size, past, cancel),
        }
    }
}

impl Drop for DepthEstimates {
    /// Ends the thread without waiting for it: an estimate cannot be given up.
    fn drop(&mut self) {
        if let DepthEstimates::OwnThread(exchange) = self {
            lock(&exchange.slots).ended = true;
            exchange.changed.notify_all();
        }
    }
}

impl Exchange {
    fn estimate(&self, rgb: &[f32], size: Size, past: Option<Past>, cancel: &Cancel) -> Result<Arc<Array2<f32>>> {
        let mut slots = lock(&self.slots);
        if past.is_none() {
            slots.epoch += 1;
            slots.newest = None;
        }
        if !slots.busy || past.is_none() {
            let waiting = slots.picture.take().map(|picture| picture.rgb);
            let mut copy = waiting.unwrap_or_else(|| std::mem::take(&mut slots.spare));
            copy.clear();
            copy.extend_from_slice(rgb);
            slots.picture = Some(Picture { rgb: copy, size });
            self.changed.notify_all();
        }
        loop {
            match &slots.newest {
                Some(Ok(estimate)) => return Ok(estimate.clone()),
                // The next frame tries again.
                Some(Err(_)) => return slots.newest.take().expect("seen above"),
                None => {
                    cancel.check()?;
                    slots = (self.changed.wait_timeout(slots, PATIENCE))
                        .unwrap_or_else(PoisonError::into_inner)
                        .0;
                }
            }
        }
    }

    /// Estimates the pictures until the session ends.
    fn run(&self, mut planned: Planned) {
        let mut slots = lock(&self.slots);
        loop {
            if slots.ended {
                return;
            }
            let Some(picture) = slots.picture.take() else {
                slots = (self.changed.wait(slots)).unwrap_or_else(PoisonError::into_inner);
                continue;
            };
            slots.busy = true;
            let epoch = slots.epoch;
            drop(slots);
            let estimate = planned.estimate(&picture.rgb, picture.size);
            slots = lock(&self.slots);
            slots.busy = false;
            slots.spare = picture.rgb;
            if slots.epoch == epoch {
                slots.newest = Some(estimate);
                self.changed.notify_all();
            }
        }
    }
}
