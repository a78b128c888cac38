//! The options of sessions: `video` and `bench --session` share them.

use crate::flags::backend::BackendFlags;
use crate::flags::encoder::Encoder;
use crate::flags::method::{CoreMethod, HologramFlags};
use phasefront::session::{Backend, Quality};
use phasefront::{SessionOptions, Size, Sweep, Target};
use phasefront_core::display::panel::Panel;
use phasefront_io::display::DisplayFile;
use phasefront_io::{Error, Result};
use std::num::NonZeroUsize;

/// Returns the options of a session that makes holograms of `size` for the display in `file`, at one quality level, and
/// the encoder. The method is `asked`, or the default of `flags`.
pub(crate) fn options(
    flags: &HologramFlags,
    asked: Option<CoreMethod>,
    (file, size): (&DisplayFile, Size),
    backend: &BackendFlags,
    threads: Option<NonZeroUsize>,
) -> Result<(SessionOptions, Encoder)> {
    let target = target(file, size)?;
    let display = &target.display;
    let (method, encoder) = flags.read(flags.method(asked), display, Sweep::for_display(display))?;
    let mut options = SessionOptions::new(target, method);
    options.encoder = encoder.options.clone();
    if let Some(device) = backend.device()? {
        options.backend = Backend::Gpu;
        options.gpu.device = device;
    }
    options.threads = threads;
    options.quality = Quality::Fixed(0);
    Ok((options, encoder))
}

/// Returns the middle of the display, of `size`.
fn target(file: &DisplayFile, size: Size) -> Result<Target> {
    let modulator = file.target.display.size();
    if let Some(light) = &file.target.illumination
        && size != modulator
    {
        let (rows, columns) = light.nodes();
        return Err(Error::Input(format!(
            "the display's laser map ({columns}×{rows} nodes) is for {modulator} pixels, the frames are {size}; give --size or leave the map out"
        )));
    }
    let target = file.corrected()?;
    Ok(Target {
        display: target.display.with_size(size)?,
        response: target.response.centred(size)?,
        panel: Panel {
            flatness: (target.panel.flatness.as_ref())
                .map(|map| map.centred(size))
                .transpose()?,
            ..target.panel
        },
        ..target
    })
}
