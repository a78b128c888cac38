//! Frames on a screen: full screen, unscaled, each pixel as in the file.
//!
//! A modulator is a screen to the computer. The link between the two can still change pixels; `phasefront link` detects
//! this.

use phasefront::Size;
use phasefront_io::hologram::packed::{Image, Kind};
use phasefront_io::{Error, Result};
use softbuffer::{Context, Surface};
use std::num::NonZeroU32;
use std::rc::Rc;
use std::time::{Duration, Instant};
use winit::application::ApplicationHandler;
use winit::dpi::{PhysicalPosition, PhysicalSize};
use winit::event::{ElementState, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::keyboard::{Key, NamedKey};
use winit::monitor::MonitorHandle;
use winit::window::{Fullscreen, Window, WindowId};

/// A screen of this computer.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Screen {
    /// The screen's number, counted from 1.
    pub number: usize,
    /// The system's name for the screen.
    pub name: String,
    /// The width in pixels.
    pub width: u32,
    /// The height in pixels.
    pub height: u32,
    /// The position of the upper left pixel on the desktop.
    pub at: [i32; 2],
    /// The frames per second, if the system reports them.
    pub rate_hz: Option<f64>,
    /// The scale factor of the desktop. At 1, its pixels are the screen's own; otherwise the system enlarges them.
    pub scale: f64,
}

/// The options for showing frames.
#[derive(Debug, Clone)]
pub struct Showing {
    /// The screen's number, counted from 1.
    pub screen: usize,
    /// The frames per second, or `None` for the screen's own rate.
    pub rate_hz: Option<f64>,
    /// The time after which to stop, or `None` to show frames until Escape is pressed.
    pub length: Option<Duration>,
}

/// The result of showing frames.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Shown {
    /// The screen that showed the frames.
    pub screen: Screen,
    /// The number of frames that were shown.
    pub frames: u64,
    /// The number of frames that were not shown because their time had passed.
    pub late: u64,
    /// The frames per second that were asked for.
    pub rate_hz: f64,
}

/// Returns the screens of this computer.
///
/// # Errors
/// Returns an error if there is no desktop.
pub fn screens() -> Result<Vec<Screen>> {
    let mut list = List::default();
    run(&mut list)?;
    Ok(list.0)
}

/// Shows `frames` one after another in a loop, until the length has passed or Escape or Q is pressed.
///
/// # Errors
/// Returns an error if the screen does not exist, if the frames are larger than it or have pixels of 16 bits, or if
/// there is no desktop.
pub fn show(frames: &[Image], showing: &Showing) -> Result<Shown> {
    let first = frames
        .first()
        .ok_or_else(|| Error::Input("there is no frame to show".into()))?;
    if let Some(other) = frames.iter().find(|frame| frame.size != first.size) {
        return Err(Error::Input(format!(
            "frames of {}×{} and {}×{} in one sequence; all must be of one size",
            first.size.width, first.size.height, other.size.width, other.size.height
        )));
    }
    let frames = frames.iter().map(pixels).collect::<Result<Vec<_>>>()?;
    let mut player = Player {
        frames,
        size: first.size,
        showing: showing.clone(),
        window: None,
        start: Instant::now(),
        shown: None,
        failure: None,
    };
    run(&mut player)?;
    match (player.failure, player.shown) {
        (Some(error), _) => Err(error),
        (None, Some(shown)) => Ok(shown),
        (None, None) => Err(Error::Input("the window was closed before it was open".into())),
    }
}

fn run(app: &mut impl ApplicationHandler) -> Result<()> {
    let refuse = |e: winit::error::EventLoopError| {
        let why = e.to_string();
        // winit puts the place in its source first: "os error at FILE:LINE: ".
        let told = why.strip_prefix("os error at ").and_then(|why| why.split_once(": "));
        let told = told.map_or(&*why, |(_, told)| told);
        Error::Input(format!("there is no desktop to show on: {told}"))
    };
    EventLoop::new().map_err(refuse)?.run_app(app).map_err(refuse)
}

/// Converts an image to the words of a screen's pixels: 0, red, green, blue.
fn pixels(image: &Image) -> Result<Vec<u32>> {
    let word = |[r, g, b]: [u8; 3]| u32::from_be_bytes([0, r, g, b]);
    Ok(match image.kind {
        Kind::Rgb => image.bytes.as_chunks().0.iter().map(|pixel| word(*pixel)).collect(),
        Kind::Grey => image.bytes.iter().map(|grey| word([*grey; 3])).collect(),
        Kind::Grey16 => {
            return Err(Error::Input(
                "a screen has 8 bits a colour; grey of 16 bits goes to the modulator by its maker's software".into(),
            ));
        }
    })
}

fn screen(number: usize, monitor: &MonitorHandle) -> Screen {
    let (size, at) = (monitor.size(), monitor.position());
    Screen {
        number,
        name: monitor.name().unwrap_or_default(),
        width: size.width,
        height: size.height,
        at: [at.x, at.y],
        rate_hz: monitor.refresh_rate_millihertz().map(|mhz| f64::from(mhz) / 1e3),
        scale: monitor.scale_factor(),
    }
}

#[derive(Default)]
struct List(Vec<Screen>);

impl ApplicationHandler for List {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        let monitors = event_loop.available_monitors().enumerate();
        self.0 = monitors.map(|(n, monitor)| screen(n + 1, &monitor)).collect();
        event_loop.exit();
    }

    fn window_event(&mut self, _: &ActiveEventLoop, _: WindowId, _: WindowEvent) {}
}

/// The rate of a screen that reports none.
const DEFAULT_RATE_HZ: f64 = 60.0;

struct Player {
    frames: Vec<Vec<u32>>,
    /// The size of a frame.
    size: Size,
    showing: Showing,
    window: Option<Open>,
    start: Instant,
    shown: Option<Shown>,
    failure: Option<Error>,
}

struct Open {
    window: Rc<Window>,
    surface: Surface<Rc<Window>, Rc<Window>>,
    /// The number of the frame that was drawn last.
    current: Option<u64>,
}

impl Player {
    fn open(&mut self, event_loop: &ActiveEventLoop) -> Result<()> {
        let monitors: Vec<MonitorHandle> = event_loop.available_monitors().collect();
        let number = self.showing.screen;
        let monitor = number.checked_sub(1).and_then(|at| monitors.get(at)).ok_or_else(|| {
            Error::Input(format!(
                "there is no screen {number}; there are {} (phasefront screens lists them)",
                monitors.len()
            ))
        })?;
        let screen = screen(number, monitor);
        let Size { width, height } = self.size;
        if width > screen.width as usize || height > screen.height as usize {
            return Err(Error::Input(format!(
                "frames of {width}×{height} do not fit screen {number} of {}×{}; they are not scaled",
                screen.width, screen.height
            )));
        }
        let attributes = Window::default_attributes()
            .with_title("phasefront")
            .with_decorations(false)
            .with_position(PhysicalPosition::new(screen.at[0], screen.at[1]))
            .with_inner_size(PhysicalSize::new(screen.width, screen.height))
            .with_fullscreen(Some(Fullscreen::Borderless(Some(monitor.clone()))));
        let refuse = |e: &dyn std::fmt::Display| Error::Input(format!("a window cannot be opened: {e}"));
        let window = Rc::new(event_loop.create_window(attributes).map_err(|e| refuse(&e))?);
        window.set_cursor_visible(false);
        let context = Context::new(window.clone()).map_err(|e| refuse(&e))?;
        let surface = Surface::new(&context, window.clone()).map_err(|e| refuse(&e))?;
        self.window = Some(Open {
            window,
            surface,
            current: None,
        });
        self.start = Instant::now();
        self.shown = Some(Shown {
            rate_hz: self.showing.rate_hz.or(screen.rate_hz).unwrap_or(DEFAULT_RATE_HZ),
            screen,
            frames: 0,
            late: 0,
        });
        Ok(())
    }

    /// Draws the frame that is due, unless the window already shows it.
    fn draw(&mut self, again: bool) -> Result<()> {
        let (Some(open), Some(shown)) = (&mut self.window, &mut self.shown) else {
            return Ok(());
        };
        let due = (self.start.elapsed().as_secs_f64() * shown.rate_hz) as u64;
        let still = self.frames.len() == 1 && open.current.is_some();
        if !again && (open.current == Some(due) || still) {
            return Ok(());
        }
        let refuse = |e: softbuffer::SoftBufferError| Error::Input(format!("the window cannot be drawn: {e}"));
        let size = open.window.inner_size();
        let (Some(width), Some(height)) = (NonZeroU32::new(size.width), NonZeroU32::new(size.height)) else {
            return Ok(());
        };
        open.surface.resize(width, height).map_err(refuse)?;
        let mut buffer = open.surface.buffer_mut().map_err(refuse)?;
        let frame = &self.frames[(due % self.frames.len() as u64) as usize];
        place(
            frame,
            self.size,
            &mut buffer,
            Size {
                width: size.width as usize,
                height: size.height as usize,
            },
        );
        buffer.present().map_err(refuse)?;
        if open.current != Some(due) {
            shown.frames += 1;
            shown.late += open.current.map_or(0, |before| (due - before).saturating_sub(1));
        }
        open.current = Some(due);
        Ok(())
    }

    fn fail(&mut self, event_loop: &ActiveEventLoop, result: Result<()>) {
        if let Err(error) = result {
            self.failure = Some(error);
            event_loop.exit();
        }
    }
}

/// Draws a `frame` of that size in the middle of a window, with black around it. Cuts off what does
/// not fit.
fn place(frame: &[u32], Size { width, height }: Size, window: &mut [u32], window_size: Size) {
    let Size {
        width: columns,
        height: rows,
    } = window_size;
    window.fill(0);
    let (top, left) = (rows.saturating_sub(height) / 2, columns.saturating_sub(width) / 2);
    let (lines, run) = (height.min(rows), width.min(columns));
    for y in 0..lines {
        window[(top + y) * columns + left..][..run].copy_from_slice(&frame[y * width..][..run]);
    }
}

impl ApplicationHandler for Player {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.window.is_none() {
            let opened = self.open(event_loop);
            self.fail(event_loop, opened);
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        match event {
            WindowEvent::CloseRequested => event_loop.exit(),
            WindowEvent::KeyboardInput { event, .. } if event.state == ElementState::Pressed => {
                match event.logical_key.as_ref() {
                    Key::Named(NamedKey::Escape) | Key::Character("q") => event_loop.exit(),
                    _ => {}
                }
            }
            WindowEvent::RedrawRequested | WindowEvent::Resized(_) => {
                let drawn = self.draw(true);
                self.fail(event_loop, drawn);
            }
            _ => {}
        }
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        let passed = self.start.elapsed();
        if self.failure.is_some() || self.showing.length.is_some_and(|length| passed >= length) {
            event_loop.exit();
            return;
        }
        let drawn = self.draw(false);
        self.fail(event_loop, drawn);
        let rate = self.shown.as_ref().map_or(DEFAULT_RATE_HZ, |shown| shown.rate_hz);
        let next = ((passed.as_secs_f64() * rate).floor() + 1.0) / rate;
        event_loop.set_control_flow(ControlFlow::WaitUntil(self.start + Duration::from_secs_f64(next)));
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn frames_stand_in_the_middle_unscaled() {
        let mut window = vec![9; 5 * 4];
        place(
            &[1, 2, 3, 4],
            Size { width: 2, height: 2 },
            &mut window,
            Size { width: 5, height: 4 },
        );
        assert_eq!(window, [0, 0, 0, 0, 0, 0, 1, 2, 0, 0, 0, 3, 4, 0, 0, 0, 0, 0, 0, 0]);
        let mut small = vec![9; 2];
        place(
            &[1, 2, 3, 4],
            Size { width: 2, height: 2 },
            &mut small,
            Size { width: 1, height: 2 },
        );
        assert_eq!(small, [1, 3]);
    }

    #[test]
    fn pixels_are_words_and_deep_grey_is_refused() {
        let image = |kind, bytes: &[u8]| Image {
            size: Size { width: 1, height: 1 },
            bytes: bytes.to_vec(),
            kind,
        };
        assert_eq!(pixels(&image(Kind::Rgb, &[1, 2, 3])).unwrap(), [0x0001_0203]);
        assert_eq!(pixels(&image(Kind::Grey, &[7])).unwrap(), [0x0007_0707]);
        assert!(pixels(&image(Kind::Grey16, &[7, 7])).is_err());
    }
}
