//! Commercial modulators: size, pitch and bits, the phases of the levels, and the input format. Each modulator is
//! described by a TOML file. The files in `sdk/core/devices` are bundled; users can add their own.
//!
//! ```
//! use phasefront::output::ModulatorSpec;
//!
//! let device = ModulatorSpec::shipped("ti-plm-p47")?;
//! assert_eq!((device.display.size().width, device.display.bits()), (960, 4));
//! # Ok::<(), phasefront::Error>(())
//! ```

use crate::Size;
use crate::display::Display;
use crate::display::panel::Panel;
use crate::display::response::Response;
use crate::display::response::per_pixel::PerPixel;
use crate::display::target::Target;
use crate::output::{Cells, Layout, Split};
use crate::runtime::error::{Error, Result};
use crate::runtime::keys;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A modulator as its file describes it.
#[derive(Debug, Clone)]
pub struct ModulatorSpec {
    /// The name of the modulator.
    pub name: String,
    /// The physical parameters. Those that the file omits have the values of [`Display::default`].
    pub display: Display,
    /// The packing of a hologram for the modulator's input.
    pub packing: Packing,
    /// Whether the whole frame is flipped left to right.
    pub flip_x: bool,
    /// Whether the whole frame is flipped top to bottom.
    pub flip_y: bool,
    /// The phase of each level in turns of 2π, starting with level 0. `None` if the levels are evenly spaced over one
    /// turn, or if they differ from laser to laser.
    pub levels_turns: Option<Vec<f64>>,
    /// The phase of each level in turns of 2π for each laser, if they differ from laser to laser.
    pub lasers_turns: Option<Vec<Vec<f64>>>,
    /// The frame rate in hertz.
    pub rate_hz: Option<f64>,
    /// The source of each figure, by its key in the file.
    pub sources: BTreeMap<String, String>,
    /// The basis of each figure that no document of the manufacturer confirms, by its key.
    pub unconfirmed: BTreeMap<String, String>,
}

/// A packing of a hologram for a modulator's input.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Packing {
    /// All colours in one image, or one image after another for each colour.
    Images(Layout),
    /// Memory cells of moving mirrors, with 24 maps in each frame.
    BitPlanes(Cells),
}

/// The file's keys in addition to those of [`Display`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ModulatorToml {
    #[serde(default)]
    name: String,
    packing: Option<PackingToml>,
    #[serde(default)]
    flip_x: bool,
    #[serde(default)]
    flip_y: bool,
    levels_turns: Option<TurnsToml<Vec<f64>>>,
    range_turns: Option<TurnsToml<f64>>,
    rate_hz: Option<f64>,
    #[serde(default)]
    sources: BTreeMap<String, String>,
    #[serde(default)]
    unconfirmed: BTreeMap<String, String>,
}

/// Phases of levels: of all lasers, of each, or at the wavelength at which they were measured.
#[derive(Deserialize)]
#[serde(untagged)]
enum TurnsToml<T> {
    All(T),
    Lasers(Vec<T>),
    At { turns: T, at_nm: f64 },
}

/// Phases of levels as the target takes them.
enum Turns {
    All(Vec<f64>),
    Lasers(Vec<Vec<f64>>),
}

#[derive(Deserialize)]
#[serde(untagged)]
enum PackingToml {
    Named(String),
    Split {
        red: Vec<u8>,
        green: Vec<u8>,
        blue: Vec<u8>,
    },
    Cells {
        memory: Vec<u8>,
        layout: [[u8; 2]; 2],
    },
}

/// The names of the packings that need no parameters.
const NAMED: [(&str, Layout); 3] = [
    ("rgb", Layout::Rgb),
    ("grey", Layout::Grey),
    ("grey-16", Layout::Grey16),
];

/// The bundled files, by name.
const SHIPPED: [(&str, &str); 9] = [
    ("hamamatsu-x15213", include_str!("../../devices/hamamatsu-x15213.toml")),
    ("holoeye-gaea-2", include_str!("../../devices/holoeye-gaea-2.toml")),
    ("holoeye-leto", include_str!("../../devices/holoeye-leto.toml")),
    ("holoeye-pluto", include_str!("../../devices/holoeye-pluto.toml")),
    ("meadowlark-hdmi", include_str!("../../devices/meadowlark-hdmi.toml")),
    ("santec-slm-200", include_str!("../../devices/santec-slm-200.toml")),
    ("santec-slm-210", include_str!("../../devices/santec-slm-210.toml")),
    ("ti-plm-p47", include_str!("../../devices/ti-plm-p47.toml")),
    ("ti-plm-p67", include_str!("../../devices/ti-plm-p67.toml")),
];

fn refuse(what: impl std::fmt::Display) -> Error {
    Error::Display(what.to_string())
}

impl ModulatorSpec {
    /// Returns the names of the bundled devices.
    pub fn names() -> impl Iterator<Item = &'static str> {
        SHIPPED.iter().map(|(name, _)| *name)
    }

    /// Returns the bundled device called `name`.
    ///
    /// # Errors
    /// Returns an error if no bundled device has this name.
    pub fn shipped(name: &str) -> Result<Self> {
        Self::from_table(Self::shipped_table(name)?)
    }

    /// Returns the parsed file of the bundled device called `name`.
    ///
    /// # Errors
    /// Returns an error if no bundled device has this name.
    #[doc(hidden)]
    pub fn shipped_table(name: &str) -> Result<toml::Table> {
        let (_, text) = SHIPPED.iter().find(|(known, _)| *known == name).ok_or_else(|| {
            let all: Vec<_> = Self::names().collect();
            refuse(format!("there is no device {name}; there are {}", all.join(", ")))
        })?;
        toml::from_str(text).map_err(|e| refuse(keys::message(&e)))
    }

    /// Returns the keys of `table` over those of the bundled device that its key `device` names, without this key. A
    /// key that says what phase a level shows replaces the device's.
    ///
    /// # Errors
    /// Returns an error if no bundled device has this name.
    #[doc(hidden)]
    pub fn on_device(mut table: toml::Table) -> Result<toml::Table> {
        let mut all = match table.remove("device") {
            None => return Ok(table),
            Some(toml::Value::String(name)) => Self::shipped_table(&name)?,
            Some(_) => {
                let names: Vec<_> = Self::names().collect();
                return Err(refuse(format!(
                    "device must be the name of a modulator: {}",
                    names.join(", ")
                )));
            }
        };
        if ["lut", "per_pixel", "levels_turns", "range_turns"]
            .iter()
            .any(|key| table.contains_key(*key))
        {
            all.remove("levels_turns");
            all.remove("range_turns");
        }
        for figures in ["sources", "unconfirmed"] {
            if let Some(toml::Value::Table(figures)) = all.get_mut(figures) {
                figures.retain(|key, _| !table.contains_key(key));
            }
        }
        all.extend(table);
        Ok(all)
    }

    /// Parses a device from TOML. The key `device` names a bundled device whose keys hold where the text has none.
    ///
    /// # Errors
    /// Returns an error if the text is not TOML, a key is unknown or a value is impossible.
    pub fn from_toml(text: &str) -> Result<Self> {
        let table = toml::from_str(text).map_err(|e| refuse(keys::message(&e)))?;
        Self::from_table(table)
    }

    /// Reads a device from a parsed table, like [`Self::from_toml`].
    ///
    /// # Errors
    /// Returns an error if a key is unknown or a value is impossible.
    #[doc(hidden)]
    pub fn from_table(table: toml::Table) -> Result<Self> {
        let mut table = Self::on_device(table)?;
        keys::check(&table, &[&keys::DISPLAY[..], &keys::DEVICE].concat())?;
        let own: toml::Table = (keys::DEVICE.iter())
            .filter_map(|key| Some(((*key).to_owned(), table.remove(*key)?)))
            .collect();
        let display = Display::deserialize(table).map_err(|e| refuse(keys::message(&e)))?;
        let own = ModulatorToml::deserialize(own).map_err(|e| match keys::message(&e) {
            message if message.contains("TurnsToml") => refuse(
                "levels_turns and range_turns are numbers for all lasers, a list of them with one for each laser, or { turns = …, at_nm = 638 }",
            ),
            message if message.contains("untagged") => refuse(format!(
                "packing must be {}, or say which bits red, green and blue hold, or memory and layout of cells",
                NAMED.map(|(name, _)| name).join(", ")
            )),
            message => refuse(message),
        })?;
        let (levels_turns, lasers_turns) = match levels(&own, &display)? {
            None => (None, None),
            Some(Turns::All(turns)) => (Some(turns), None),
            Some(Turns::Lasers(turns)) => (None, Some(turns)),
        };
        let packing = match &own.packing {
            None => Packing::default_for(&display),
            Some(packing) => packing.packing()?,
        };
        packing.check(&display)?;
        if let Some(rate) = own.rate_hz
            && !(rate > 0.0 && rate <= 1e6)
        {
            return Err(refuse(format!(
                "rate_hz is {rate}; it must lie above 0 and up to 1000000"
            )));
        }
        Ok(ModulatorSpec {
            name: own.name,
            display,
            packing,
            flip_x: own.flip_x,
            flip_y: own.flip_y,
            levels_turns,
            lasers_turns,
            rate_hz: own.rate_hz,
            sources: own.sources,
            unconfirmed: own.unconfirmed,
        })
    }

    /// Returns the target for holograms on this modulator, with the phases of its levels.
    ///
    /// # Errors
    /// Returns an error if levels of more than 8 bits are not evenly spaced over one turn.
    pub fn target(&self) -> Result<Target> {
        let target = Target::from(&self.display);
        match (&self.levels_turns, &self.lasers_turns) {
            (None, None) => Ok(target),
            (_, Some(turns)) => Ok(Target {
                response: Response::PerPixel(Arc::new(of_lasers(self.display.size(), turns)?)),
                ..target
            }),
            (Some(turns), None) => Ok(Target {
                response: Response::of_turns(turns)?,
                panel: Panel {
                    levels_turns: Some(turns.clone()),
                    ..Panel::default()
                },
                ..target
            }),
        }
    }
}

/// Returns the table of a modulator whose level l shows the phase `turns[laser][l]`, in turns.
fn of_lasers(size: Size, turns: &[Vec<f64>]) -> Result<PerPixel> {
    let reach: Vec<f64> = turns.iter().map(|turns| turns[turns.len() - 1]).collect();
    PerPixel::of_lasers(size, &reach, |laser, phase| {
        let turns = &turns[laser];
        let after = turns.partition_point(|turn| *turn < phase).clamp(1, turns.len() - 1);
        let (from, to) = (turns[after - 1], turns[after]);
        (after - 1) as f64 + (phase - from) / (to - from)
    })
}

/// Returns the phase of each level in turns, or `None` if the levels are evenly spaced over one turn.
///
/// A level retards light by the same path at every wavelength if the birefringence (or a mirror's height) does, so its
/// phase is that at `at_nm` times at_nm/λ. The dispersion of liquid crystals is left out; it makes the phase of shorter
/// waves a few percent larger.
fn levels(of: &ModulatorToml, display: &Display) -> Result<Option<Turns>> {
    let count = 1usize << display.bits();
    let even = |range: &f64| (0..count).map(|level| range * level as f64 / count as f64).collect();
    let all = match (&of.levels_turns, &of.range_turns) {
        (None, None | Some(TurnsToml::All(1.0))) => return Ok(None),
        (Some(_), Some(_)) => return Err(refuse("levels_turns and range_turns say the same; give one")),
        (Some(turns), None) => by_laser(turns, display, Vec::clone)?,
        (None, Some(range)) => by_laser(range, display, even)?,
    };
    if display.bits() > 8 {
        return Err(refuse(
            "levels_turns and range_turns are for at most 8 bits; over that levels are even over one turn",
        ));
    }
    let lasers = match &all {
        Turns::All(turns) => std::slice::from_ref(turns),
        Turns::Lasers(_) if display.bits() != 8 => {
            return Err(refuse("levels_turns and range_turns of each laser are for 8 bits"));
        }
        Turns::Lasers(lasers) => lasers,
    };
    for turns in lasers {
        if turns.len() != count {
            return Err(refuse(format!(
                "levels_turns has {} levels; {} bits have {count}",
                turns.len(),
                display.bits()
            )));
        }
        Response::of_turns(turns)?;
    }
    Ok(Some(all))
}

/// Returns the phases of levels that `given` says, for all lasers or for each laser of `display`.
fn by_laser<T>(given: &TurnsToml<T>, display: &Display, turns: impl Fn(&T) -> Vec<f64>) -> Result<Turns> {
    let lasers: Vec<Vec<f64>> = match given {
        TurnsToml::All(all) => return Ok(Turns::All(turns(all))),
        TurnsToml::Lasers(each) => each.iter().map(turns).collect(),
        TurnsToml::At { turns: at, at_nm } => {
            let factors = display.phase_factors(*at_nm)?;
            let of = |factor: &f64| turns(at).iter().map(|turn| turn * factor).collect();
            factors.iter().map(of).collect()
        }
    };
    if lasers.len() != display.colours() {
        return Err(refuse(format!(
            "levels_turns or range_turns for {} lasers; the display has {}",
            lasers.len(),
            display.colours()
        )));
    }
    Ok(match <[Vec<f64>; 1]>::try_from(lasers) {
        Ok([one]) => Turns::All(one),
        Err(lasers) => Turns::Lasers(lasers),
    })
}

impl PackingToml {
    fn packing(&self) -> Result<Packing> {
        Ok(match self {
            PackingToml::Named(name) => {
                let found = NAMED.iter().find(|(known, _)| known == name);
                let (_, layout) = found.ok_or_else(|| {
                    let all = NAMED.map(|(name, _)| name).join(", ");
                    refuse(format!("packing is {name:?}; it must be {all}, bits or cells"))
                })?;
                Packing::Images(*layout)
            }
            PackingToml::Split { red, green, blue } => Packing::Images(Layout::Split(Split::new([red, green, blue])?)),
            PackingToml::Cells { memory, layout } => Packing::BitPlanes(Cells::new(memory, *layout)?),
        })
    }
}

impl From<Display> for ModulatorSpec {
    /// Creates a modulator whose input takes all colours in one image, or one grey image for one laser.
    fn from(display: Display) -> Self {
        ModulatorSpec {
            name: String::new(),
            packing: Packing::default_for(&display),
            display,
            flip_x: false,
            flip_y: false,
            levels_turns: None,
            lasers_turns: None,
            rate_hz: None,
            sources: BTreeMap::new(),
            unconfirmed: BTreeMap::new(),
        }
    }
}

impl Packing {
    /// Returns the packing for files that name none.
    fn default_for(display: &Display) -> Self {
        Packing::Images(match (display.bits(), display.colours()) {
            (0..=8, 1) => Layout::Grey,
            (0..=8, _) => Layout::Rgb,
            _ => Layout::Grey16,
        })
    }

    /// Checks whether the display's levels fit the packing.
    ///
    /// # Errors
    /// Returns an error if they do not fit.
    fn check(&self, display: &Display) -> Result<()> {
        let (bits, place) = match self {
            Packing::Images(layout) => (display.bits(), layout.place_bits()),
            Packing::BitPlanes(cells) if 1 << display.bits() != cells.levels() => {
                return Err(refuse(format!(
                    "the cells' memory has {} levels; {} bits have {}",
                    cells.levels(),
                    display.bits(),
                    1 << display.bits()
                )));
            }
            Packing::BitPlanes(_) => return Ok(()),
        };
        if bits <= place {
            Ok(())
        } else {
            Err(refuse(format!(
                "levels of {bits} bits do not fit the packing's {place}"
            )))
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::output::BitPlanes;

    /// Returns the levels in `text`, one hexadecimal digit for each of 256 steps of 2π.
    fn digits(text: &str) -> Vec<u8> {
        text.chars().map(|c| c.to_digit(16).unwrap() as u8).collect()
    }

    #[test]
    fn every_shipped_device_says_where_its_figures_are_from() {
        for (name, text) in SHIPPED {
            let device = ModulatorSpec::shipped(name).unwrap();
            assert!(!device.name.is_empty() && device.target().is_ok(), "{name}");
            let table: toml::Table = toml::from_str(text).unwrap();
            for key in [
                "width",
                "pitch_um",
                "bits",
                "packing",
                "levels_turns",
                "flip_x",
                "rate_hz",
            ] {
                let told = device.sources.contains_key(key) || device.unconfirmed.contains_key(key);
                assert_eq!(told, table.contains_key(key), "{name}: {key}");
            }
        }
    }

    /// Compares with the output of `PLM.quantize` in Texas Instruments' package ti-plm 1.1.0 for the phases 2πi/256.
    /// The second file uses the levels of our p67.
    #[test]
    fn levels_are_those_of_the_makers_package() {
        for (name, golden) in [
            ("ti-plm-p47", include_str!("modulator/p47_levels.txt")),
            ("ti-plm-p67", include_str!("modulator/p67_levels.txt")),
        ] {
            let response = ModulatorSpec::shipped(name).unwrap().target().unwrap().response;
            let Response::Lut { level, .. } = response else {
                panic!("{name} has levels of its own")
            };
            let turns = ModulatorSpec::shipped(name).unwrap().levels_turns.unwrap();
            for (step, (level, golden)) in level.iter().zip(digits(golden.trim())).enumerate() {
                // Halfway between two levels, at step 111 of p47, the rounding of the package decides.
                let apart = |level: u8| (turns[usize::from(level)] - step as f64 / 256.0).abs();
                let tie = level.abs_diff(golden) == 1 && (apart(*level) - apart(golden)).abs() < 1e-12;
                assert!(
                    *level == golden || tie,
                    "{name}: {level} for step {step}, {golden} is right"
                );
            }
        }
    }

    /// Compares with the output of `PLM.electrode_map` in the same package for the levels 0 to 15 in two rows. One map
    /// fills the whole frame.
    #[test]
    fn frames_are_those_of_the_makers_package() {
        let p47 = "0000001000101010 1101101100011000 0101010111111111 1101100011011000";
        let p67 = "0000010001000101 1011100011010001 1010111110101111 1011101100010001";
        for (name, golden) in [("ti-plm-p47", p47), ("ti-plm-p67", p67)] {
            let device = ModulatorSpec::shipped(name).unwrap();
            let Packing::BitPlanes(cells) = &device.packing else {
                panic!("{name} has cells")
            };
            let plan = BitPlanes::new(cells, Size { width: 8, height: 2 }, device.flip_x, device.flip_y);
            let levels: Vec<u8> = (0..16).collect();
            let mut frame = vec![0; plan.frame_bytes()];
            plan.pack(&[&levels], &mut frame, 6 * 8).unwrap();
            let cells = golden.chars().filter(|c| *c != ' ');
            let want: Vec<u8> = cells.flat_map(|c| [if c == '1' { 255 } else { 0 }; 3]).collect();
            assert_eq!(frame, want, "{name}");
        }
    }

    #[test]
    fn a_file_builds_on_a_bundled_device() {
        let text =
            "device = \"holoeye-pluto\"\nname = \"mine\"\nwavelengths_nm = [532]\noffset_mm = -20\nflip_x = true";
        let (mine, pluto) = (
            ModulatorSpec::from_toml(text).unwrap(),
            ModulatorSpec::shipped("holoeye-pluto").unwrap(),
        );
        assert_eq!(mine.display.size(), pluto.display.size());
        assert_eq!((mine.packing.clone(), mine.rate_hz), (pluto.packing, pluto.rate_hz));
        assert_eq!((&mine.name[..], mine.display.colours(), mine.flip_x), ("mine", 1, true));
        // Levels of one's own replace the device's, and so do the sources of figures.
        let own =
            ModulatorSpec::from_toml("device = \"ti-plm-p67\"\nbits = 1\npacking = \"grey\"\nlevels_turns = [0, 0.5]")
                .unwrap();
        assert_eq!(own.levels_turns, Some(vec![0.0, 0.5]));
        assert!(!own.unconfirmed.contains_key("levels_turns") && own.sources.contains_key("pitch_um"));
        let message = ModulatorSpec::from_toml("device = \"pluto\"").unwrap_err().to_string();
        assert!(message.contains("no device pluto; there are"), "{message}");
    }

    #[test]
    fn what_cannot_be_is_named_in_one_line() {
        for (text, word) in [
            ("width = \"1920\"", "width: "),
            ("name = 3", "name: "),
            ("wavelengths_nm = 532", "wavelengths_nm: "),
            ("sources = \"the manual\"", "sources: "),
            ("flip_x = 1", "flip_x: "),
            ("device = 3", "device must be the name"),
            ("width = ", "expected"),
            ("widht = 4", "unknown key `widht`; did you mean `width`?"),
            ("pack = \"rgb\"", "unknown key `pack`; did you mean `packing`?"),
            ("wavelengths_nm = [450, 520, 638]", "the longest first: [638, 520, 450]"),
            ("bits = 12", "bits"),
            ("packing = \"rbg\"", "rbg"),
            ("packing = 3", "packing"),
            ("packing = { red = [0] }", "packing"),
            ("packing = { red = [0], green = [0], blue = [] }", "once"),
            ("bits = 10\npacking = \"grey\"", "10 bits"),
            (
                "bits = 4\npacking = { memory = [0, 1], layout = [[0, 1], [2, 3]] }",
                "2 levels",
            ),
            ("bits = 2\nlevels_turns = [0, 0.5]", "2 levels"),
            ("bits = 1\nlevels_turns = [0.5, 0.25]", "rise"),
            ("bits = 1\nlevels_turns = [0, 0.5]\nrange_turns = 2", "give one"),
            ("bits = 10\nrange_turns = 2\npacking = \"grey-16\"", "8 bits"),
            ("rate_hz = -1", "rate_hz"),
        ] {
            let message = ModulatorSpec::from_toml(text).unwrap_err().to_string();
            assert!(message.contains(word), "{text}: {message}");
            assert!(!message.contains('\n'), "{message}");
        }
        let message = ModulatorSpec::shipped("pluto").unwrap_err().to_string();
        assert!(message.contains("holoeye-pluto"), "{message}");
    }
}
