//! Where a command writes: its outputs are checked before work begins, and files are written whole or not at all.
//!
//! A command calls [`file()`] or [`folder`] for each of its outputs before it computes anything. Readers call
//! [`reading`] for each file that they open. Whichever comes first, a file that is both an input and an output is
//! refused, also by another name, a link or a hard link. [`write_atomically`] writes beside the place and renames.

use crate::{Error, Result};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{File, Metadata};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;
use tempfile::NamedTempFile;

/// What an output folder may hold before the command writes into it. Hidden files do not count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Holding<'a> {
    /// Nothing.
    Nothing,
    /// Anything: files of the same names are replaced, others stay.
    Anything,
    /// Nothing, or an earlier run, which the file of this name belongs to.
    RunOf(&'a str),
}

impl Holding<'_> {
    /// What `--overwrite` says.
    pub fn by_flag(overwrite: bool) -> Self {
        if overwrite { Self::Anything } else { Self::Nothing }
    }
}

/// Declares `path` an output of this command: a file that is absent or regular, in a folder that can be written to. Its
/// name ends in one of `extensions`, or in anything where there are none.
///
/// # Errors
/// Another name; a folder, a device, a pipe, a link to nothing; an input; another output; no such folder, or no right
/// to write there.
pub fn file(path: &Path, extensions: &[&str]) -> Result<()> {
    extension(path, extensions)?;
    let place = Place::of_file(path)?;
    place.check_writable()?;
    places().add_output(place)
}

/// Checks that the name of `path` ends in one of `extensions`, where there are any.
///
/// # Errors
/// Another name.
pub fn extension(path: &Path, extensions: &[&str]) -> Result<()> {
    if extensions.is_empty() || extensions.iter().any(|extension| has_extension(path, extension)) {
        return Ok(());
    }
    let right = alternatives(extensions);
    Err(Error::file(path, format!("the name must end in {right}")))
}

/// Checks that `path` may be a file that this command changes, and reads for that.
///
/// # Errors
/// A folder, a device, a pipe, a link to nothing; no such folder, or no right to write there.
pub fn check_file(path: &Path) -> Result<()> {
    Place::of_file(path)?.check_writable()
}

/// Declares `path` an output file of this command that must not exist yet, unless `overwrite` is set.
///
/// # Errors
/// Those of [`file()`]; a file that is there.
pub fn new_file(path: &Path, extensions: &[&str], overwrite: bool) -> Result<()> {
    file(path, extensions)?;
    if path.exists() && !overwrite {
        return Err(Error::file(path, "exists already; --overwrite replaces it"));
    }
    Ok(())
}

/// Declares `path` a folder that this command fills. It is made by [`make_folder`], when there is something to write.
///
/// # Errors
/// A file; a folder that holds more than `holding` allows; an input; a parent that is a file, or no right to write
/// there.
pub fn folder(path: &Path, holding: Holding) -> Result<()> {
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

/// Notes that this command reads `path`.
///
/// # Errors
/// An output of this command.
pub fn reading(path: &Path) -> Result<()> {
    places().add_input(path)
}

/// Notes that this command reads the files of the folder at `path`; some may not be read before much work is done.
///
/// # Errors
/// Those of [`reading`]. A folder that cannot be read is left to whoever reads it.
pub fn reading_folder(path: &Path) -> Result<()> {
    reading(path)?;
    let entries = std::fs::read_dir(path).into_iter().flatten().flatten();
    entries.map(|entry| entry.path()).try_for_each(|path| reading(&path))
}

/// Makes the folder at `path` and those that it lies in, where they are not there.
///
/// # Errors
/// What the system refuses.
pub fn make_folder(path: &Path) -> Result<()> {
    std::fs::create_dir_all(path).map_err(|e| Error::file(path, format!("cannot be made: {e}")))
}

/// Lets `write` fill a temporary file beside `path`, waits until it is on the disk, and renames it to `path`.
///
/// # Errors
/// Whatever goes wrong, naming `path`; what was there is left as it was.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> std::io::Result<()>,
) -> Result<()> {
    Pending::write(path, write)?.place()
}

/// As [`write_atomically`], where `write` is another program, which fills a file by its name.
///
/// # Errors
/// Whatever goes wrong; what was there is left as it was.
pub(crate) fn write_by_name(path: &Path, write: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
    let pending = Pending::begin(path)?;
    write(pending.file.path())?;
    pending.synced()?.place()
}

/// A file that is written, but not in its place yet. Dropped, it goes.
pub(crate) struct Pending {
    path: PathBuf,
    real: PathBuf,
    file: NamedTempFile,
}

impl Pending {
    /// As [`write_atomically`], without the last step.
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

    /// An empty file.
    fn begin(path: &Path) -> Result<Self> {
        let real = Place::of_file(path)?.real;
        let parent = real.parent().unwrap_or(Path::new("."));
        remove_left_over(parent);
        let file = temporary_in(parent).map_err(|e| cannot_write(path, &e))?;
        // The lock tells other runs that the file is in use. A file system without locks writes all the same.
        let _ = file.as_file().try_lock();
        Ok(Self {
            path: path.to_owned(),
            real,
            file,
        })
    }

    /// Waits until the file is on the disk.
    fn synced(self) -> Result<Self> {
        let synced = self.file.as_file().sync_all();
        synced.map_err(|e| cannot_write(&self.path, &e)).map(|()| self)
    }

    /// Puts the file into its place.
    pub(crate) fn place(self) -> Result<()> {
        let Self { path, real, file } = self;
        file.persist(real).map_err(|e| cannot_write(&path, &e.error))?;
        Ok(())
    }
}

fn cannot_write(path: &Path, why: &std::io::Error) -> Error {
    Error::file(path, format!("cannot be written: {why}"))
}

/// Temporary files are named `.phasefront-`, 12 letters or digits, `.tmp`: no other file is ever removed.
const PREFIX: &str = ".phasefront-";

const SUFFIX: &str = ".tmp";

const RANDOM: usize = 12;

/// How old a temporary file must be to be thought left over: none is unlocked that long.
const LEFT_OVER: Duration = Duration::from_secs(60);

fn temporary_in(folder: &Path) -> std::io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(PREFIX).suffix(SUFFIX).rand_bytes(RANDOM);
    #[cfg(unix)]
    {
        // A temporary file is its owner's alone unless it is said; the umask takes from this as from any other file.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}

fn is_temporary(name: &str) -> bool {
    let random = name.strip_prefix(PREFIX).and_then(|rest| rest.strip_suffix(SUFFIX));
    random.is_some_and(|random| random.len() == RANDOM && random.bytes().all(|b| b.is_ascii_alphanumeric()))
}

/// Removes the temporary files in `folder` that killed runs left: regular files of [`temporary_in`]'s names that no
/// process holds. Once a folder, as far as it can be done.
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
        // This does not follow links. What is not a regular file is not opened: a pipe would wait for its writer.
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

/// What tells one file from another, whatever names it has.
#[cfg(unix)]
type Identity = (u64, u64);

#[cfg(not(unix))]
type Identity = PathBuf;

/// `None` where nothing is there.
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

/// Where an output goes.
#[derive(Debug, Clone)]
struct Place {
    /// As the user names it.
    path: PathBuf,
    /// Without links.
    real: PathBuf,
    identity: Option<Identity>,
    is_folder: bool,
}

impl Place {
    /// The place of a file. A link is followed, so that the file that it points to is replaced and the link stays.
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

    /// Tries whether files can be made here, or in the folder that this folder will lie in.
    fn check_writable(&self) -> Result<()> {
        let start = if self.is_folder {
            Some(&*self.real)
        } else {
            self.real.parent()
        };
        let nearest = start.and_then(|path| path.ancestors().find(|path| path.exists()));
        // On most systems this file has no name, and none is left behind.
        tempfile::tempfile_in(nearest.unwrap_or(Path::new("."))).map_err(|e| cannot_write(&self.path, &e))?;
        Ok(())
    }

    fn is_same(&self, other: &Self) -> bool {
        self.real == other.real || (self.identity.is_some() && self.identity == other.identity)
    }
}

/// The outputs and the inputs of this process's command.
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

/// Whether a folder is absent or holds nothing but hidden files.
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

/// `.png`, `.png or .webp`, `.png, .jpg or .webp`.
fn alternatives(extensions: &[&str]) -> String {
    let dotted: Vec<_> = extensions.iter().map(|extension| format!(".{extension}")).collect();
    match &dotted[..] {
        [rest @ .., last] if !rest.is_empty() => format!("{} or {last}", rest.join(", ")),
        _ => dotted.concat(),
    }
}

/// Whether the name of `path` ends in `.extension`.
pub fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension))
}
