//! What could be wrong with a picture, as the free parameters of a model.

use num_complex::Complex64;

/// How a link shares the colours of neighbouring pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Chroma {
    /// Every pixel has its own.
    Own,
    /// 8-bit YCbCr (BT.709) whose colours `wide`×`high` pixels share.
    Shared { wide: usize, high: usize },
}

/// The state of a display and its camera. [`State::right`] is how they should be.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct State {
    /// The z that the camera focuses on, in metres.
    pub z_m: f64,
    /// The laser whose levels each laser shows.
    pub order: [usize; 3],
    /// Whether phases fall with rising levels.
    pub inverted: bool,
    /// The phase of all levels, relative to what it should be, for each laser.
    pub range: Vec<f64>,
    /// The exponent of a bent curve: level/most becomes (level/most)^tone.
    pub tone: f64,
    /// The light that is not modulated, relative to what is, for each laser.
    pub undiffracted: Vec<Complex64>,
    /// The light that is modulated with the opposite phase.
    pub conjugate: Vec<Complex64>,
    /// The light of a ghost image.
    pub ghost: Vec<Complex64>,
    /// How far the ghost image lies to the right and down, in pixels of the modulator.
    pub ghost_shift: [f64; 2],
    /// The longer way of the ghost image's light, in metres.
    pub ghost_path_m: f64,
    /// The outer weights of a filter of three pixels along x and y, through which levels come.
    pub taps: [f64; 2],
    /// The enlargement of the levels about the middle.
    pub zoom: f64,
    pub chroma: Chroma,
    /// The standard deviation of the camera's blur, in pixels of the modulator.
    pub blur: f64,
    /// The corners of the window in the photograph: top left, top right, bottom left, bottom right.
    pub corners: [[f64; 2]; 4],
}

impl State {
    /// Returns the state of a display of `lasers` that is as it should be.
    pub(super) fn right(lasers: usize, z_m: f64, corners: [[f64; 2]; 4]) -> Self {
        State {
            z_m,
            order: [0, 1, 2],
            inverted: false,
            range: vec![1.0; lasers],
            tone: 1.0,
            undiffracted: vec![Complex64::ZERO; lasers],
            conjugate: vec![Complex64::ZERO; lasers],
            ghost: vec![Complex64::ZERO; lasers],
            ghost_shift: [0.0; 2],
            ghost_path_m: 0.0,
            taps: [0.0; 2],
            zoom: 1.0,
            chroma: Chroma::Own,
            blur: 0.5,
            corners,
        }
    }
}
