//! Photographs by a program of the user, which drives the modulator and the camera.
//!
//! For each photograph, the program reads a line of JSON from its standard input (`Request`), shows the levels of the
//! PNG `show`, and writes the photograph to `photo`, a PNG. Then it writes a line to its standard output: `{"done": …}`
//! with any settings, for example the exposure, or `{"error": "the reason"}`. Settings come back with later requests,
//! also in another run. Other lines are messages for the user. The program ends when its input ends.
//!
//! A photograph that fails its check is asked for again. Only one that passes gets its name, so that a run that was cut
//! off can be resumed. One run at a time takes photographs in a folder.

use crate::camera::photograph::Photograph;
use ndarray::ArrayView2;
use phasefront_io::{Error, Result};
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs::{File, TryLockError};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::{Duration, Instant};

/// The name of the photograph that is not checked yet.
const INCOMING: &str = "incoming.png";
/// The name of the levels that are shown.
const SHOWN: &str = "show.png";
/// The name of the program's settings.
const SETTINGS: &str = "settings.json";
/// The name of the file that keeps other runs out of a folder.
const LOCK: &str = ".phasefront-capture";
/// The maximum length of a line of the program, in bytes.
const MOST_LINE: u64 = 1 << 16;
/// The number of answers that wait. More make the program wait.
const MOST_ANSWERS: usize = 4;
/// The time that the program has to end after its input ended.
const LAST: Duration = Duration::from_secs(5);

/// One request to the program.
#[derive(Debug, Clone, Serialize)]
struct Request<'a> {
    /// The levels to show, a grey PNG with one pixel for each pixel of the modulator.
    show: &'a Path,
    /// The photograph to write.
    photo: &'a Path,
    /// The name of the laser to switch on: red, green, blue or laser.
    colour: &'a str,
    wavelength_nm: f64,
    /// The z that the camera focuses on.
    z_mm: f64,
    /// Whether the exposure may change. Otherwise it is that of the photograph before.
    expose: bool,
    /// What the program answered to an earlier request for the same folder.
    settings: Option<&'a Value>,
    /// The reason why the photograph before was not good enough.
    again: Option<&'a str>,
}

/// A photograph to take.
#[derive(Debug, Clone, Copy)]
pub struct Shot<'a> {
    /// The levels to show, (H, W).
    pub levels: ArrayView2<'a, u8>,
    /// The name of the laser's colour.
    pub colour: &'a str,
    /// The wavelength of the laser, in metres.
    pub wavelength_m: f64,
    /// The z that the camera focuses on, in metres.
    pub z_m: f64,
    /// Whether the exposure may change.
    pub may_expose: bool,
}

/// A running program.
#[derive(Debug)]
pub struct CaptureProgram {
    name: String,
    child: Child,
    input: Option<ChildStdin>,
    answers: Receiver<Answer>,
    tries: usize,
    timeout: Duration,
    /// The folders that other runs are kept out of.
    claimed: BTreeMap<PathBuf, ClaimedFolder>,
}

/// What the program wrote.
#[derive(Debug)]
enum Answer {
    Done(Value),
    Failed(String),
    /// A line over [`MOST_LINE`].
    Endless,
}

/// A folder in which only this run takes photographs, as long as this value lives.
#[derive(Debug)]
pub struct ClaimedFolder {
    /// The system releases the lock of a killed run.
    _lock: File,
}

impl ClaimedFolder {
    /// Keeps other runs out of `folder`.
    ///
    /// # Errors
    /// Returns an error if another run takes photographs there, or if the folder is not writable.
    pub fn new(folder: &Path) -> Result<Self> {
        let path = folder.join(LOCK);
        let file = File::options().write(true).create(true).truncate(false).open(&path);
        let file = file.map_err(|e| Error::file(&path, format!("cannot be written: {e}")))?;
        // A file system without locks keeps no run out.
        if matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
            return Err(Error::file(
                folder,
                "another run takes photographs there; wait for it, or give another folder",
            ));
        }
        Ok(ClaimedFolder { _lock: file })
    }
}

impl CaptureProgram {
    /// Starts `command`, its name and its arguments. A photograph is asked for at most `tries` times, and may take as
    /// long as `timeout`.
    ///
    /// # Errors
    /// Returns an error if the program cannot be started.
    pub fn start(command: &[String], tries: usize, timeout: Duration) -> Result<Self> {
        let refuse = |why: String| Error::Input(format!("--capture {}: {why}", command.join(" ")));
        let [program, arguments @ ..] = command else {
            return Err(refuse("names no program".into()));
        };
        let mut command = Command::new(program);
        command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped());
        // The processes that the program starts are ended with it.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn().map_err(|e| refuse(format!("cannot be started: {e}")))?;
        #[cfg(unix)]
        interrupt::pass_on(rustix::process::Pid::from_child(&child));
        let (Some(input), Some(output)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(refuse("has no standard input and output".into()));
        };
        let (sender, answers) = sync_channel(MOST_ANSWERS);
        let name = program.clone();
        std::thread::spawn(move || listen(output, &name, &sender));
        Ok(CaptureProgram {
            name: program.clone(),
            child,
            input: Some(input),
            answers,
            tries,
            timeout,
            claimed: BTreeMap::new(),
        })
    }

    /// Takes a photograph that passes `check`, writes it to `path`, and returns what `check` returned. `check` gives
    /// the reason, in one line, why a photograph is not good enough.
    ///
    /// # Errors
    /// Returns an error if the last photograph asked for is not good enough, if the program reports an error that
    /// often, ends or takes too long, if another run takes photographs in the folder, or if a file cannot be written.
    pub fn take<T>(
        &mut self,
        shot: &Shot<'_>,
        path: &Path,
        mut check: impl FnMut(&Path) -> std::result::Result<T, String>,
    ) -> Result<T> {
        let folder = path.parent().unwrap_or(Path::new("."));
        let folder = std::path::absolute(folder).map_err(|e| Error::file(folder, e))?;
        let (show, photo, kept) = (folder.join(SHOWN), folder.join(INCOMING), folder.join(SETTINGS));
        if !self.claimed.contains_key(&folder) {
            self.claimed.insert(folder.clone(), ClaimedFolder::new(&folder)?);
        }
        write_levels(shot.levels, &show)?;
        let mut settings = read_settings(&kept)?;
        let mut again: Option<String> = None;
        for _ in 0..self.tries {
            remove(&photo)?;
            let request = Request {
                show: &show,
                photo: &photo,
                colour: shot.colour,
                wavelength_nm: (shot.wavelength_m * 1e15).round() / 1e6,
                z_mm: (shot.z_m * 1e9).round() / 1e6,
                expose: shot.may_expose,
                settings: settings.as_ref(),
                again: again.as_deref(),
            };
            let why = match self.ask(&request)? {
                Err(why) => why,
                Ok(done) => match check(&photo) {
                    Ok(result) => {
                        if done.is_object() && settings.as_ref() != Some(&done) {
                            phasefront_io::output::write_atomically(&kept, |file| writeln!(file, "{done}"))?;
                        }
                        std::fs::rename(&photo, path).map_err(|e| Error::file(path, e))?;
                        remove(&show)?;
                        return Ok(result);
                    }
                    Err(why) => {
                        settings = Some(done).filter(Value::is_object).or(settings);
                        why
                    }
                },
            };
            log::warn!("{}: {why}", path.display());
            again = Some(why);
        }
        let why = again.unwrap_or_default();
        Err(Error::file(
            path,
            format!(
                "{why}; no good photograph in {} tries; those before are kept, and the same command resumes",
                self.tries
            ),
        ))
    }

    /// Sends a request and returns the settings of the answer or its error.
    fn ask(&mut self, request: &Request<'_>) -> Result<std::result::Result<Value, String>> {
        let line = serde_json::to_string(request).map_err(|e| Error::Input(e.to_string()))?;
        // Nobody asked for these.
        while let Ok(answer) = self.answers.try_recv() {
            if matches!(answer, Answer::Endless) {
                return Err(self.endless());
            }
        }
        let sent = self.input.as_mut().map(|input| {
            writeln!(input, "{line}")?;
            input.flush()
        });
        if !matches!(sent, Some(Ok(()))) {
            return Err(self.ended());
        }
        match self.answers.recv_timeout(self.timeout) {
            Ok(Answer::Done(done)) => Ok(Ok(done)),
            Ok(Answer::Failed(why)) => Ok(Err(why)),
            Ok(Answer::Endless) => Err(self.endless()),
            Err(RecvTimeoutError::Disconnected) => Err(self.ended()),
            Err(RecvTimeoutError::Timeout) => {
                let seconds = self.timeout.as_secs_f64();
                // It hangs, and would not notice the end of its input.
                let _ = self.kill();
                Err(self.refuse(&format!(
                    "no answer in {seconds} seconds; --capture-timeout-s gives it more"
                )))
            }
        }
    }

    fn refuse(&self, why: &str) -> Error {
        Error::Input(format!("--capture {}: {why}", self.name))
    }

    /// Ends a program that wrote a line over [`MOST_LINE`].
    fn endless(&mut self) -> Error {
        let _ = self.kill();
        self.refuse(&format!("it wrote a line of over {MOST_LINE} bytes"))
    }

    fn ended(&mut self) -> Error {
        self.input = None;
        let status = self.finish();
        self.refuse(&format!("it ended ({status}); what was taken is kept"))
    }

    /// Waits for the program's end, or ends it, and describes its status.
    fn finish(&mut self) -> String {
        let end = Instant::now() + LAST;
        while Instant::now() < end {
            match self.child.try_wait() {
                Ok(None) => std::thread::sleep(Duration::from_millis(10)),
                Ok(Some(status)) => return status.to_string(),
                Err(e) => return e.to_string(),
            }
        }
        let ended = self.kill().and_then(|()| self.child.wait());
        ended.map_or_else(|e| e.to_string(), |status| status.to_string())
    }

    /// Ends the program and, on Unix, the processes that it started.
    fn kill(&mut self) -> std::io::Result<()> {
        #[cfg(unix)]
        {
            use rustix::process::{Pid, Signal, kill_process_group};
            kill_process_group(Pid::from_child(&self.child), Signal::KILL)?;
        }
        self.child.kill()
    }
}

/// Passes on the answers among the lines of `output` until it ends, and logs the others. Messages take no memory, and
/// no time of the answer.
fn listen(output: ChildStdout, name: &str, answers: &SyncSender<Answer>) {
    let mut output = BufReader::new(output);
    let mut line = Vec::new();
    loop {
        line.clear();
        let answer = match (&mut output).take(MOST_LINE).read_until(b'\n', &mut line) {
            Err(_) | Ok(0) => return,
            Ok(_) if line.len() as u64 == MOST_LINE && !line.ends_with(b"\n") => Some(Answer::Endless),
            Ok(_) => answer(&line),
        };
        match answer {
            None => log::info!("{name}: {}", String::from_utf8_lossy(&line).trim_end()),
            Some(answer) => {
                let is_last = matches!(answer, Answer::Endless);
                if answers.send(answer).is_err() || is_last {
                    return;
                }
            }
        }
    }
}

/// Returns the answer in a line, or `None` if the line is a message.
fn answer(line: &[u8]) -> Option<Answer> {
    let mut value = serde_json::from_slice::<Value>(line).ok()?;
    if let Some(done) = value.get_mut("done") {
        return Some(Answer::Done(done.take()));
    }
    let why = value.get("error")?;
    let why = why.as_str().map_or_else(|| why.to_string(), str::to_owned);
    Some(Answer::Failed(why.lines().collect::<Vec<_>>().join(" ")))
}

/// Interrupts. A terminal sends them to this process only, because the program has a process group of its own.
#[cfg(unix)]
mod interrupt {
    use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process_group, waitid};
    use signal_hook::consts::{SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;
    use signal_hook::low_level::emulate_default_handler;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::sync::{Mutex, Once, PoisonError};
    use std::time::{Duration, Instant};

    /// The time that the program has to end after an interrupt.
    const LAST: Duration = Duration::from_secs(2);

    /// Whether an interrupt is ending this process.
    static IS_ENDING: AtomicBool = AtomicBool::new(false);

    /// The program that runs.
    static PROGRAM: Mutex<Option<Pid>> = Mutex::new(None);

    /// Lets an interrupt of this process end the process group of `program` too.
    pub(super) fn pass_on(program: Pid) {
        static BEGUN: Once = Once::new();
        *PROGRAM.lock().unwrap_or_else(PoisonError::into_inner) = Some(program);
        BEGUN.call_once(|| match Signals::new([SIGINT, SIGTERM]) {
            Err(e) => log::warn!("an interrupt will not reach the program of --capture: {e}"),
            Ok(mut signals) => {
                std::thread::spawn(move || {
                    for signal in signals.forever() {
                        IS_ENDING.store(true, Ordering::SeqCst);
                        end(signal);
                        let _ = emulate_default_handler(signal);
                    }
                });
            }
        });
    }

    /// Forgets the program, which has ended. If an interrupt ended it, this leaves it to the interrupt to end this
    /// process too, so that the process does not end with a status of its own before.
    pub(super) fn forget() {
        if IS_ENDING.load(Ordering::SeqCst) {
            std::thread::sleep(2 * LAST);
        }
        *PROGRAM.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    fn end(signal: i32) {
        let Some(program) = *PROGRAM.lock().unwrap_or_else(PoisonError::into_inner) else {
            return;
        };
        let passed = if signal == SIGINT { Signal::INT } else { Signal::TERM };
        let _ = kill_process_group(program, passed);
        let end = Instant::now() + LAST;
        // It is not reaped here, because others may wait for it.
        let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
        while Instant::now() < end && matches!(waitid(WaitId::Pid(program), options), Ok(None)) {
            std::thread::sleep(Duration::from_millis(10));
        }
        let _ = kill_process_group(program, Signal::KILL);
    }
}

impl Drop for CaptureProgram {
    fn drop(&mut self) {
        self.input = None;
        self.finish();
        #[cfg(unix)]
        interrupt::forget();
    }
}

/// Writes levels, (H, W), as a grey PNG of 8 bits.
///
/// # Errors
/// Returns an error if the file cannot be written.
pub fn write_levels(levels: ArrayView2<'_, u8>, path: &Path) -> Result<()> {
    let (height, width) = levels.dim();
    let photograph = Photograph {
        height,
        width,
        values: levels.iter().map(|level| u16::from(*level)).collect(),
        full: 255,
    };
    photograph.write(path)
}

fn remove(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::file(path, e)),
        _ => Ok(()),
    }
}

fn read_settings(path: &Path) -> Result<Option<Value>> {
    if !path.is_file() {
        return Ok(None);
    }
    let text = phasefront_io::input::text(path)?;
    serde_json::from_str(&text)
        .map(Some)
        .map_err(|e| Error::file(path, format!("{e}; remove the file")))
}
