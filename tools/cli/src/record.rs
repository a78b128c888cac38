//! The record of a folder of holograms. It holds all flags that affect the folder's files and lies beside them, so that
//! --resume does not mix the holograms of two requests.

use crate::given::{Flag, Given};
use clap::ValueEnum;
use phasefront_io::fingerprint::Fingerprint;
use phasefront_io::output::Holding;
use phasefront_io::{Error, Result, display, input};
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt::Display;
use std::fs::{File, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};

/// The name of the record's file in its folder.
pub(crate) const FILE: &str = "request.json";
/// The largest size of the record's file in bytes. Flags are short.
const MOST_BYTES: u64 = 1 << 20;
/// The key of the version that wrote a record. It identifies the file as a record.
const VERSION: &str = "phasefront";

/// Flags by name, and their values: a text, or whether a switch is given. Null stands for a flag's default.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RunRecord(BTreeMap<String, Value>);

impl RunRecord {
    /// Records `command` with its flags, but for those that name the input or the output and those of all commands.
    pub(crate) fn new(command: &str, flags: &[Flag]) -> Result<Self> {
        let mut record = RunRecord(BTreeMap::new());
        record.set(VERSION, Some(env!("CARGO_PKG_VERSION")));
        record.set("command", Some(command));
        let decides = |flag: &&Flag| !flag.is_source && !["Output", "General"].contains(&&*flag.group);
        for Flag { name, value, .. } in flags.iter().filter(decides) {
            match value {
                Given::Switch(is_given) => record.switch(name, *is_given),
                Given::Text(text) => record.set(name, text.as_ref()),
                Given::File(file) => record.file(name, file.as_deref())?,
            }
        }
        Ok(record)
    }

    pub(crate) fn set(&mut self, flag: &str, value: Option<impl Display>) {
        // Stored as text, because numbers may change in their last bit when they are written and read.
        let value = value.map(|value| value.to_string());
        self.0.insert(flag.to_owned(), value.into());
    }

    fn switch(&mut self, flag: &str, is_given: bool) {
        self.0.insert(flag.to_owned(), is_given.into());
    }

    pub(crate) fn choice(&mut self, flag: &str, value: Option<&impl ValueEnum>) {
        let name = value.and_then(ValueEnum::to_possible_value);
        self.set(flag, name.as_ref().map(|name| name.get_name()));
    }

    /// Records the display and the files that define it, in the place of the flags for it.
    pub(crate) fn display(&mut self, name: Option<&str>, display: &phasefront::Display) -> Result<()> {
        self.0
            .retain(|flag, _| !["--offset-mm", "--size"].contains(&flag.as_str()));
        self.set("--display", name.filter(|name| display::display_path(name).is_none()));
        let values = serde_json::to_value(display).map_err(|e| Error::Input(e.to_string()))?;
        for (key, value) in values.as_object().into_iter().flatten() {
            self.set(&format!("display {key}"), Some(value));
        }
        let files = name.map(display_files).transpose()?.unwrap_or_default();
        for (key, file) in files {
            self.set(&format!("display {key}"), Some(file));
        }
        Ok(())
    }

    /// Records a file, by its name without folders and its content, or a name that is no file's.
    fn file(&mut self, flag: &str, path: Option<&Path>) -> Result<()> {
        let value = match path {
            Some(path) if path.is_file() => Some(described(path)?),
            name => name.map(|name| name.display().to_string()),
        };
        self.set(flag, value);
        Ok(())
    }

    /// Returns the fingerprint that identifies holograms of this record.
    pub(crate) fn fingerprint(&self) -> Fingerprint {
        Fingerprint::of(self.text().as_bytes())
    }

    fn text(&self) -> String {
        serde_json::to_string_pretty(&self.0).expect("keys are text") + "\n"
    }

    fn read(text: &str) -> Option<Self> {
        let values: BTreeMap<String, Value> = serde_json::from_str(text).ok()?;
        values.contains_key(VERSION).then_some(RunRecord(values))
    }

    /// Returns the first difference between `earlier` and this record, described for each of them.
    fn difference(&self, earlier: &Self) -> Option<[String; 2]> {
        let flags = self.0.keys().chain(earlier.0.keys());
        let differing = flags
            .into_iter()
            .find(|flag| given(self.0.get(*flag)) != given(earlier.0.get(*flag)))?;
        Some([earlier, self].map(|record| said(differing, record.0.get(differing))))
    }
}

/// Returns the value of a flag if it is given.
fn given(value: Option<&Value>) -> Option<&Value> {
    value.filter(|value| !matches!(value, Value::Null | Value::Bool(false)))
}

/// Formats a flag as on the command line.
fn said(flag: &str, value: Option<&Value>) -> String {
    match value {
        None | Some(Value::Null | Value::Bool(false)) => format!("no {flag}"),
        Some(Value::Bool(true)) => flag.to_owned(),
        Some(Value::String(text)) => format!("{flag} {text}"),
        Some(value) => format!("{flag} {value}"),
    }
}

fn described(path: &Path) -> Result<String> {
    let content = Fingerprint::of(&input::read_file(path)?);
    Ok(format!(
        "{} ({content})",
        path.file_name().unwrap_or_default().display()
    ))
}

/// Describes the files of a display: its TOML file, and those that it names.
fn display_files(name: &str) -> Result<BTreeMap<String, String>> {
    let mut all = BTreeMap::new();
    let Some(path) = display::display_path(name) else {
        return Ok(all);
    };
    all.insert("file".to_owned(), described(&path)?);
    let text = String::from_utf8_lossy(&input::read_file(&path)?).into_owned();
    let table: toml::Table = toml::from_str(&text).unwrap_or_default();
    let mut values: Vec<(String, toml::Value)> = table.into_iter().collect();
    while let Some((key, value)) = values.pop() {
        match value {
            toml::Value::Table(table) => values.extend(table.into_iter().map(|(name, v)| (format!("{key}.{name}"), v))),
            toml::Value::String(name) if path.with_file_name(&name).is_file() => {
                all.insert(key, described(&path.with_file_name(name))?);
            }
            _ => {}
        }
    }
    Ok(all)
}

/// The treatment of holograms that already exist in a folder.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Before {
    /// The command stops.
    Refuse,
    /// They stay, and the command makes the missing ones.
    Resume,
    /// They are replaced.
    Overwrite,
}

impl Before {
    pub(crate) fn of_flags(resume: bool, overwrite: bool) -> Self {
        match (resume, overwrite) {
            (true, _) => Before::Resume,
            (_, true) => Before::Overwrite,
            _ => Before::Refuse,
        }
    }

    /// Returns which files the output folder may hold.
    pub(crate) fn holding(self) -> Holding<'static> {
        match self {
            Before::Overwrite => Holding::Anything,
            _ => Holding::RunOf(FILE),
        }
    }
}

/// A folder that only one run at a time writes to.
pub(crate) struct Claim {
    /// The record's file, locked for the whole run. The system releases the lock of a killed run.
    _request: File,
    /// Whether this run resumes an earlier run of the same record.
    pub(crate) resumes: bool,
}

impl Claim {
    /// Makes `folder` and keeps other runs out of it. `is_made` checks whether a run makes a file of that name there.
    ///
    /// # Errors
    /// Returns an error if another run uses the folder. Returns an error if files of an earlier run exist, unless
    /// `before` allows them and the record is the same.
    pub(crate) fn new(
        folder: &Path,
        record: &RunRecord,
        before: Before,
        is_made: impl Fn(&str) -> bool,
    ) -> Result<Self> {
        let path = folder.join(FILE);
        let refuse = |e: std::io::Error| Error::file(&path, format!("cannot be written: {e}"));
        std::fs::create_dir_all(folder).map_err(|e| Error::file(folder, format!("cannot be made: {e}")))?;
        if path.exists() && !path.is_file() {
            return Err(Error::file(
                path,
                "is no regular file; give a folder of its own to what is made",
            ));
        }
        let mut file = File::options()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path)
            .map_err(refuse)?;
        // A file system without locks keeps no run out.
        if matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
            return Err(Error::file(
                folder,
                "another run is writing there; wait for it, or give another folder",
            ));
        }
        let mut text = String::new();
        let readable = (&file).take(MOST_BYTES).read_to_string(&mut text).is_ok();
        let earlier = RunRecord::read(&text);
        if !(text.is_empty() || earlier.is_some()) || !readable {
            return Err(Error::file(
                path,
                "is no request of phasefront; give another folder, or remove the file",
            ));
        }
        // Checked after taking the lock, because another run may just have ended.
        let made = names_of(folder)?.iter().any(|name| is_made(name));
        let resumes = before == Before::Resume && made;
        match before {
            Before::Refuse if made => return Err(already(folder)),
            Before::Resume if resumes => check(folder, record, earlier.as_ref())?,
            _ => {
                file.rewind().and_then(|()| file.set_len(0)).map_err(refuse)?;
                file.write_all(record.text().as_bytes()).map_err(refuse)?;
                file.sync_all().map_err(refuse)?;
            }
        }
        Ok(Claim {
            _request: file,
            resumes,
        })
    }
}

/// Makes the error for files that already exist.
pub(crate) fn already(path: &Path) -> Error {
    Error::file(
        path,
        "holds what an earlier run made; --resume goes on with it, --overwrite makes it anew",
    )
}

fn check(folder: &Path, record: &RunRecord, earlier: Option<&RunRecord>) -> Result<()> {
    let Some(earlier) = earlier else {
        return Err(Error::file(
            folder,
            format!("holds an empty {FILE} beside what an earlier run made; --overwrite makes it anew"),
        ));
    };
    match record.difference(earlier) {
        None => Ok(()),
        Some([earlier, now]) => Err(Error::file(
            folder,
            format!(
                "was made with {earlier}, this run has {now}; --resume needs the same flags, --overwrite begins anew"
            ),
        )),
    }
}

/// Returns the names of the files in `folder`.
pub(crate) fn names_of(folder: &Path) -> Result<Vec<String>> {
    let refuse = |e: std::io::Error| Error::file(folder, format!("cannot be read: {e}"));
    let entries = std::fs::read_dir(folder).map_err(refuse)?;
    let name = |path: PathBuf| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    entries.map(|entry| Ok(name(entry.map_err(refuse)?.path()))).collect()
}
