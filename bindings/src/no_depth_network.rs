//! Depth networks without the feature `tract`, which runs them. Every language has the same calls, and they fail.

use phasefront::Error;

/// The scaling that a depth network expects for colour values from 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ColourScale {
    /// Normalized by the mean and the spread of ImageNet.
    #[default]
    Imagenet,
    /// From 0 to 1.
    Unit,
    /// From −1 to 1.
    Signed,
}

/// A depth network that no library without tract can read.
#[derive(Debug)]
pub(crate) struct DepthNetwork {
    pub(crate) colours: ColourScale,
    pub(crate) gives_distance: bool,
}

impl DepthNetwork {
    pub(crate) fn from_onnx(_: &[u8]) -> Result<Self, Error> {
        Err(Error::Network(
            "tract would run a depth network, but this library was built without its feature 'tract'; hand in depth, \
             for example the output of another runtime"
                .into(),
        ))
    }
}
