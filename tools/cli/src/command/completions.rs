//! `phasefront completions` and `phasefront man`: files for shells and for `man`.

use super::help;
use clap::{Args, Command};
use clap_complete::Shell;
use phasefront_command::terminal;
use phasefront_io::{Error, Result, output};
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Print the completions of this command for a shell
///
/// bash: phasefront completions bash > ~/.local/share/bash-completion/completions/phasefront
///
/// zsh: phasefront completions zsh > DIR/_phasefront, where DIR is one of $fpath
///
/// fish: phasefront completions fish > ~/.config/fish/completions/phasefront.fish
#[derive(Args)]
pub(crate) struct Completions {
    /// The shell
    shell: Shell,
}

/// Write the manual pages of this command
#[derive(Args)]
pub(crate) struct Man {
    /// Output folder: phasefront.1, phasefront-hologram.1 …; one that man searches is ~/.local/share/man/man1
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
}

impl Completions {
    pub(crate) fn run(self) -> Result<()> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut help::command(), "phasefront", &mut script);
        terminal::print_file(&script);
        Ok(())
    }
}

impl Man {
    pub(crate) fn run(self, json: bool) -> Result<()> {
        output::make_folder(&self.output)?;
        let mut command = help::command();
        command.build();
        let mut pages = Vec::new();
        write_pages(&command, command.get_name(), &self.output, &mut pages)?;
        let text = format!("{}: {} pages", terminal::name(&self.output), pages.len());
        terminal::print(json, &json!({ "output": self.output, "pages": pages }), text);
        Ok(())
    }
}

/// Writes the page of `command`, which is called `name`, and those of its commands.
fn write_pages(command: &Command, name: &str, folder: &Path, pages: &mut Vec<String>) -> Result<()> {
    let page = format!("{name}.1");
    let path = folder.join(&page);
    let mut text = Vec::new();
    let man = clap_mangen::Man::new(command.clone()).title(name.to_owned());
    man.render(&mut text).map_err(|e| Error::file(&path, e))?;
    output::write_atomically(&path, |file| file.write_all(&text))?;
    pages.push(page);
    for part in command.get_subcommands().filter(|part| part.get_name() != "help") {
        write_pages(part, &format!("{name}-{}", part.get_name()), folder, pages)?;
    }
    Ok(())
}
