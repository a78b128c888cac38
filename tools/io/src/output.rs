//! The outputs of a command. They are checked before work begins, and files are written whole or not at all.
//!
//! A command calls [`file()`] or [`folder`] for each of its outputs before it computes anything. Readers call
//! [`reading`] for each file that they open. A file that is both an input and an output is refused, whichever call
//! comes first, even under another name or through a symbolic or hard link. [`write_atomically`] writes a temporary
//! file beside the target and renames it.

use crate::{Error, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{File, Metadata};
use std::io::{BufWriter, IsTerminal, Write, stdout};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tempfile::NamedTempFile;

/// The permitted contents of an output folder before the command writes into it. Hidden files do not count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Holding<'a> {
    /// The folder must be empty.
    Nothing,
    /// Any contents are allowed. Files with the same names are replaced and others stay.
    Anything,
    /// The folder must be empty or hold an earlier run, identified by a file of this name.
    RunOf(&'a str),
}

impl Holding<'_> {
    /// Converts the flag `--overwrite`.
    pub fn by_flag(overwrite: bool) -> Self {
        if overwrite { Self::Anything } else { Self::Nothing }
    }
}

/// Declares `path` as an output of this command: an absent or regular file in a writable folder, or `-` for stdout. A
/// file's extension must be one of `extensions`, unless that list is empty.
///
/// # Errors
/// Returns an error if the name has another extension, if the path is a folder, a device, a pipe, a dangling link, an
/// input or another output, or if its folder does not exist or is not writable.
pub fn file(path: &Path, extensions: &[&str]) -> Result<()> {
    if is_stdout(path) {
        return take_stdout(path);
    }
    extension(path, extensions)?;
    let place = Place::of_file(path)?;
    place.check_writable()?;
    places().add_output(place)
}

/// Whether an output file takes stdout.
static STDOUT: AtomicBool = AtomicBool::new(false);

/// Checks whether `path` stands for stdout.
pub fn is_stdout(path: &Path) -> bool {
    path.as_os_str() == "-"
}

/// Checks whether an output file takes stdout.
pub fn takes_stdout() -> bool {
    STDOUT.load(Ordering::Relaxed)
}

fn take_stdout(path: &Path) -> Result<()> {
    if stdout().is_terminal() {
        return Err(Error::file(
            path,
            "would write a file into the terminal; redirect stdout, or give a name",
        ));
    }
    match STDOUT.swap(true, Ordering::Relaxed) {
        true => Err(Error::file(path, "is an output already; stdout takes one file")),
        false => Ok(()),
    }
}

/// Checks that `path` has one of the extensions in `extensions`, unless that list is empty or the path is stdout.
///
/// # Errors
/// Returns an error if the extension is another.
pub fn extension(path: &Path, extensions: &[&str]) -> Result<()> {
    if is_stdout(path) || extensions.is_empty() || extensions.iter().any(|extension| has_extension(path, extension)) {
        return Ok(());
    }
    let right = alternatives(extensions);
    Err(Error::file(path, format!("the name must end in {right}")))
}

/// Checks that `path` can be a file that this command reads and changes.
///
/// # Errors
/// Returns an error if the path is a folder, a device, a pipe or a dangling link, or if its folder does not exist or is
/// not writable.
pub fn check_file(path: &Path) -> Result<()> {
    Place::of_file(path)?.check_writable()
}

/// Declares `path` as an output file of this command that must not exist yet, unless `overwrite` is set.
///
/// # Errors
/// Returns the errors of [`file()`], and an error if the file exists.
pub fn new_file(path: &Path, extensions: &[&str], overwrite: bool) -> Result<()> {
    file(path, extensions)?;
    if path.exists() && !overwrite {
        return Err(Error::file(path, "exists already; --overwrite replaces it"));
    }
    Ok(())
}

/// Declares `path` as a folder that this command fills. [`make_folder`] creates it when there is something to write.
///
/// # Errors
/// Returns an error if the path is a file or an input, if the folder holds more than `holding` allows, or if its parent
/// is a file or not writable.
pub fn folder(path: &Path, holding: Holding) -> Result<()> {
    if is_stdout(path) {
        return Err(Error::file(
            path,
            "is stdout, which takes one file; the name of a folder is needed",
        ));
    }
    if path.exists() && !path.is_dir() {
        return Err(Error::file(path, "is a file; the name of a folder is needed"));
    }
    if path.is_symlink() && !path.exists() {
        return Err(Error::file(path, "is a link to a folder that does not exist"));
    }
    let place = Place::of_folder(path)?;
    place.check_writable()?;
    if !is_empty(path)? {
        match holding {
            Holding::Anything => {}
            Holding::Nothing => {
                return Err(Error::file(
                    path,
                    "holds files already; give a new or empty folder, or --overwrite to replace files of the same names",
                ));
            }
            Holding::RunOf(name) if path.join(name).is_file() => {}
            Holding::RunOf(name) => {
                return Err(Error::file(
                    path,
                    format!("holds files, but no {name} of an earlier run; give a new or empty folder"),
                ));
            }
        }
    }
    places().add_output(place)
}

/// Records that this command reads `path`.
///
/// # Errors
/// Returns an error if the path is an output of this command.
pub fn reading(path: &Path) -> Result<()> {
    places().add_input(path)
}

/// Records that this command reads the files in the folder at `path`, some of which it may open only later.
///
/// # Errors
/// Returns the errors of [`reading`]. A folder that cannot be listed is not reported here but by its reader.
pub fn reading_folder(path: &Path) -> Result<()> {
    reading(path)?;
    let entries = std::fs::read_dir(path).into_iter().flatten().flatten();
    entries.map(|entry| entry.path()).try_for_each(|path| reading(&path))
}

/// Creates the folder at `path` and its missing parents.
///
/// # Errors
/// Returns an error if the system refuses.
pub fn make_folder(path: &Path) -> Result<()> {
    std::fs::create_dir_all(path).map_err(|e| Error::file(path, format!("cannot be made: {e}")))
}

/// Lets `write` fill a temporary file beside `path`, waits until it is on the disk, and renames it to `path`.
///
/// # Errors
/// Returns an error that names `path` if a step fails. An existing file then stays unchanged.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> std::io::Result<()>,
) -> Result<()> {
    Pending::write(path, write)?.place()
}

/// Does the same as [`write_atomically`] with another program, which `write` runs with the name of the temporary file.
///
/// # Errors
/// Returns an error if a step fails. An existing file then stays unchanged.
pub(crate) fn write_by_name(path: &Path, write: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
    let pending = Pending::begin(path)?;
    write(pending.file.path())?;
    pending.synced()?.place()
}

/// The temporary files that this process is writing.
static WRITING: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn writing() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    WRITING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes the temporary files that this process is writing. While the result is held, none is created or put in place.
/// A process calls this before it ends in the middle of its work.
pub fn give_up() -> impl Sized {
    let writing = writing();
    for path in writing.iter() {
        let _ = std::fs::remove_file(path);
    }
    writing
}

/// An entry of [`WRITING`].
struct Written(PathBuf);

impl Drop for Written {
    fn drop(&mut self) {
        writing().remove(&self.0);
    }
}

/// A temporary file that is not in its place yet. Dropping it deletes it.
pub(crate) struct Pending {
    path: PathBuf,
    real: PathBuf,
    file: NamedTempFile,
    written: Written,
}

impl Pending {
    /// Performs [`write_atomically`] up to the renaming.
    pub(crate) fn write(
        path: &Path,
        write: impl FnOnce(&mut BufWriter<&mut File>) -> std::io::Result<()>,
    ) -> Result<Self> {
        let mut pending = Self::begin(path)?;
        let mut buffer = BufWriter::new(pending.file.as_file_mut());
        write(&mut buffer)
            .and_then(|()| buffer.flush())
            .map_err(|e| cannot_write(path, &e))?;
        drop(buffer);
        pending.synced()
    }

    /// Creates an empty temporary file.
    fn begin(path: &Path) -> Result<Self> {
        let real = if is_stdout(path) {
            std::env::temp_dir().join("stdout")
        } else {
            Place::of_file(path)?.real
        };
        let parent = real.parent().unwrap_or(Path::new("."));
        remove_left_over(parent);
        let mut all = writing();
        let file = temporary_in(parent).map_err(|e| cannot_write(path, &e))?;
        all.insert(file.path().to_owned());
        drop(all);
        let written = Written(file.path().to_owned());
        // The lock tells other runs that the file is in use. Writing also works on file systems without locks.
        let _ = file.as_file().try_lock();
        Ok(Self {
            path: path.to_owned(),
            real,
            file,
            written,
        })
    }

    /// Waits until the file is on the disk.
    fn synced(self) -> Result<Self> {
        let synced = self.file.as_file().sync_all();
        synced.map_err(|e| cannot_write(&self.path, &e)).map(|()| self)
    }

    /// Renames the file to its final path, or copies it to stdout. A file that is replaced passes on its permissions.
    pub(crate) fn place(self) -> Result<()> {
        let Self {
            path,
            real,
            file,
            written: _written,
        } = self;
        if is_stdout(&path) {
            let mut file = File::open(file.path()).map_err(|e| cannot_write(&path, &e))?;
            let mut out = stdout().lock();
            let copied = std::io::copy(&mut file, &mut out).and_then(|_| out.flush());
            return copied.map_err(|e| cannot_write(&path, &e));
        }
        if let Ok(before) = std::fs::metadata(&real) {
            // Some file systems, such as FAT, have no permissions.
            let _ = file.as_file().set_permissions(before.permissions());
        }
        let _all = writing();
        file.persist(real).map_err(|e| cannot_write(&path, &e.error))?;
        Ok(())
    }
}

fn cannot_write(path: &Path, why: &std::io::Error) -> Error {
    Error::file(path, format!("cannot be written: {why}"))
}

/// The prefix of temporary files, which are named `.phasefront-`, 12 letters or digits, `.tmp`. No other file is ever
/// removed.
const PREFIX: &str = ".phasefront-";

const SUFFIX: &str = ".tmp";

const RANDOM: usize = 12;

/// The minimum age of an abandoned temporary file. A file in use is never unlocked for that long.
const LEFT_OVER: Duration = Duration::from_secs(60);

fn temporary_in(folder: &Path) -> std::io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX).suffix(SUFFIX).rand_bytes(RANDOM);
    #[cfg(unix)]
    {
        // Temporary files are private by default. This requests the mode of ordinary files, to which the umask applies.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}

fn is_temporary(name: &str) -> bool {
    let random = name.strip_prefix(PREFIX).and_then(|rest| rest.strip_suffix(SUFFIX));
    random.is_some_and(|random| random.len() == RANDOM && random.bytes().all(|b| b.is_ascii_alphanumeric()))
}

/// Removes the temporary files that killed runs left in `folder`: regular files named as by [`temporary_in`] that no
/// process has locked. This runs once per folder and ignores failures.
fn remove_left_over(folder: &Path) {
    static DONE: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
    if !DONE.lock().is_ok_and(|mut done| done.insert(folder.to_owned())) {
        return;
    }
    let Ok(entries) = std::fs::read_dir(folder) else {
        return;
    };
    for entry in entries.flatten() {
        if !entry.file_name().to_str().is_some_and(is_temporary) {
            continue;
        }
        // This call does not follow links. Only regular files are opened, because opening a pipe would wait for its
        // writer.
        let Some(about) = entry.metadata().ok().filter(Metadata::is_file) else {
            continue;
        };
        let age = about.modified().ok().and_then(|then| then.elapsed().ok());
        if age.is_some_and(|age| age >= LEFT_OVER) && File::open(entry.path()).is_ok_and(|file| file.try_lock().is_ok())
        {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// The identity of a file, independent of its names.
#[cfg(unix)]
type Identity = (u64, u64);

#[cfg(not(unix))]
type Identity = PathBuf;

/// Returns the identity of the file at `path`, or `None` if there is none.
#[cfg(unix)]
fn identity(path: &Path) -> Option<Identity> {
    use std::os::unix::fs::MetadataExt;
    let about = std::fs::metadata(path).ok()?;
    Some((about.dev(), about.ino()))
}

#[cfg(not(unix))]
fn identity(path: &Path) -> Option<Identity> {
    std::fs::canonicalize(path).ok()
}

/// The location of an output.
#[derive(Debug, Clone)]
struct Place {
    /// The path given by the user.
    path: PathBuf,
    /// The path with links resolved.
    real: PathBuf,
    identity: Option<Identity>,
    is_folder: bool,
}

impl Place {
    /// Creates the place of a file. A link is followed, so that its target is replaced and the link stays.
    fn of_file(path: &Path) -> Result<Self> {
        let place = |real| Self {
            path: path.to_owned(),
            real,
            identity: identity(path),
            is_folder: false,
        };
        match std::fs::metadata(path) {
            Ok(about) if about.is_dir() => return Err(Error::file(path, "is a folder; a file's name is needed")),
            Ok(about) if !about.is_file() => {
                return Err(Error::file(
                    path,
                    "is a device, pipe or socket; the name of a regular file is needed",
                ));
            }
            Ok(_) => {
                return std::fs::canonicalize(path)
                    .map(place)
                    .map_err(|e| cannot_write(path, &e));
            }
            Err(_) if path.is_symlink() => return Err(Error::file(path, "is a link to a file that does not exist")),
            Err(_) => {}
        }
        let Some(name) = path.file_name() else {
            return Err(Error::file(path, "is no name of a file"));
        };
        let parent = match path.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        if !parent.is_dir() {
            return Err(Error::file(
                path,
                format!("cannot be written: there is no folder {}", parent.display()),
            ));
        }
        let parent = std::fs::canonicalize(parent).map_err(|e| cannot_write(path, &e))?;
        Ok(place(parent.join(name)))
    }

    fn of_folder(path: &Path) -> Result<Self> {
        let absolute = std::path::absolute(path).map_err(|e| cannot_write(path, &e))?;
        Ok(Self {
            path: path.to_owned(),
            real: std::fs::canonicalize(path).unwrap_or(absolute),
            identity: identity(path),
            is_folder: true,
        })
    }

    /// Checks that files can be created here, or in the nearest existing parent of this folder.
    fn check_writable(&self) -> Result<()> {
        let start = if self.is_folder {
            Some(&*self.real)
        } else {
            self.real.parent()
        };
        let nearest = start.and_then(|path| path.ancestors().find(|path| path.exists()));
        // On most systems this file has no name, so nothing can be left behind.
        tempfile::tempfile_in(nearest.unwrap_or(Path::new("."))).map_err(|e| cannot_write(&self.path, &e))?;
        Ok(())
    }

    fn is_same(&self, other: &Self) -> bool {
        self.real == other.real || (self.identity.is_some() && self.identity == other.identity)
    }
}

/// The outputs and inputs of the command that this process runs.
#[derive(Default)]
struct Places {
    outputs: Vec<Place>,
    inputs: BTreeMap<Identity, PathBuf>,
}

fn places() -> std::sync::MutexGuard<'static, Places> {
    static PLACES: Mutex<Places> = Mutex::new(Places {
        outputs: Vec::new(),
        inputs: BTreeMap::new(),
    });
    PLACES.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Places {
    fn add_output(&mut self, place: Place) -> Result<()> {
        if let Some(input) = place.identity.as_ref().and_then(|identity| self.inputs.get(identity)) {
            return Err(both(&place.path, input));
        }
        // Several outputs may share a folder.
        let other = self.outputs.iter().find(|other| other.is_same(&place));
        if let Some(other) = other.filter(|other| !(other.is_folder && place.is_folder)) {
            return Err(Error::file(
                &place.path,
                format!(
                    "is an output already, as {}; each needs a name of its own",
                    other.path.display()
                ),
            ));
        }
        self.outputs.push(place);
        Ok(())
    }

    fn add_input(&mut self, path: &Path) -> Result<()> {
        let Some(identity) = identity(path) else {
            return Ok(());
        };
        if let Some(place) = (self.outputs.iter()).find(|place| place.identity.as_ref() == Some(&identity)) {
            return Err(both(&place.path, path));
        }
        self.inputs.entry(identity).or_insert_with(|| path.to_owned());
        Ok(())
    }
}

fn both(output: &Path, input: &Path) -> Error {
    Error::file(
        output,
        format!(
            "is the input {}, which is never replaced; give the output another name",
            input.display()
        ),
    )
}

/// Checks whether a folder is absent or contains only hidden files.
fn is_empty(folder: &Path) -> Result<bool> {
    if !folder.exists() {
        return Ok(true);
    }
    let refuse = |e| Error::file(folder, format!("cannot be read: {e}"));
    for entry in std::fs::read_dir(folder).map_err(refuse)? {
        let name = entry.map_err(refuse)?.file_name();
        if !name.to_string_lossy().starts_with('.') {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Formats extensions as `.png`, `.png or .webp`, or `.png, .jpg or .webp`.
fn alternatives(extensions: &[&str]) -> String {
    let dotted: Vec<_> = extensions.iter().map(|extension| format!(".{extension}")).collect();
    match &dotted[..] {
        [rest @ .., last] if !rest.is_empty() => format!("{} or {last}", rest.join(", ")),
        _ => dotted.concat(),
    }
}

/// Checks whether `path` has the extension `extension`, ignoring case.
pub fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension))
}
