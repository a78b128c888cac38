//! Data sets: pairs of a random scene's layered depth image and its SM-LBM hologram, in files that NumPy can open.
//!
//! A folder holds `manifest.json` and, for each scene, a `pair_000123.npz` with three arrays: `rgb`, uint8 (L, H, W,
//! 4), RGBA, front first, with alpha 0 at pixels without a hit; `depth`, uint16 (L, H, W), d·65535; and `hologram`,
//! complex64 (C, H, W), at the midpoint, without the carrier. C is 1 for a display with one laser. With sensors there
//! is also `sensed`, uint16 (S, H, W): the front layer's depth that a session makes of each sensor's reading, or the
//! true depth if it refuses the reading.
//!
//! For a display with an aberration, the holograms come from the correcting variant of SM-LBM. A network trained on
//! them learns the correction.
//!
//! A pair is written to a temporary file and then renamed, so every pair in the folder is complete. Making a data set
//! again resumes it and keeps the existing pairs. Shards can write into one folder, or into several that are then
//! merged by copying.

use crate::scene::{self, Scene, Texture};
use crate::sensor::Sensor;
use ndarray::{Array2, Array3, Array4};
use ndarray_npy::NpzWriter;
use num_complex::Complex32;
use phasefront::Display;
use phasefront::Size;
use phasefront_core::runtime::file;
use phasefront_exact::corrected::{self, Correction, spatial};
use phasefront_exact::sm_lbm;
use phasefront_exact::truth::{visible_depth, visible_rgb};
use phasefront_io::display::calibration::{self, AberrationFile, Entry};
use phasefront_io::display::spatial::SpatialAberrations;
use phasefront_io::input::{self, npy};
use phasefront_io::ldi::{Ldi, LdiLayer};
use phasefront_io::{Error, Result, output};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{BufReader, Cursor, Read, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use zip::ZipArchive;

/// The format name at the start of a manifest, which tells readers how to interpret the rest.
const FORMAT: &str = "phasefront-dataset-1";

/// All parameters of a data set. Two data sets with equal parameters hold the same bytes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    format: String,
    /// The number of pairs.
    pub scenes: usize,
    /// The height and width of a scene, in pixels.
    pub size: usize,
    /// The number of SM-LBM planes.
    pub planes: usize,
    /// The number of layers of an LDI.
    pub ldi_layers: usize,
    /// The seed. Scene i has the seed·2³² + i.
    pub seed: u64,
    /// The look of the scenes.
    #[serde(default, skip_serializing_if = "Look::is_objects")]
    pub look: Look,
    /// The display that the holograms are for.
    pub display: Display,
    /// The ranges of pairs for training, validation and test.
    pub splits: Splits,
    /// The display's aberration, which the holograms correct, or empty if they correct none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub aberration: Vec<Entry>,
    /// The sensors whose depth the pairs hold.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sensors: Vec<Sensor>,
}

/// The look of a data set's scenes.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", tag = "like")]
pub enum Look {
    /// Many objects, mostly without a background: [`scene::random_scene`].
    #[default]
    Objects,
    /// Bright and dark scenes that fill the frame: [`scene::natural_scene`].
    Photographs {
        /// The [`scene::fingerprint`] of the photographs on the surfaces, in hexadecimal, or `None` without
        /// photographs.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        textures: Option<String>,
    },
    /// Scenes of every kind: [`scene::varied_scene`].
    Varied {
        /// The fingerprint of the photographs, as in [`Look::Photographs`].
        #[serde(default, skip_serializing_if = "Option::is_none")]
        textures: Option<String>,
    },
    /// Scenes that are hard for every method: [`scene::hard_scene`].
    Hard,
    /// Furnished interiors in perspective: [`scene::interior_scene`].
    Interiors,
}

impl Look {
    fn is_objects(&self) -> bool {
        *self == Self::Objects
    }

    /// Returns the photograph-like look with `textures` on the surfaces.
    pub fn photographs(textures: &[Texture]) -> Self {
        let textures = fingerprint(textures);
        Self::Photographs { textures }
    }

    /// Returns the varied look with `textures` on some surfaces.
    pub fn varied(textures: &[Texture]) -> Self {
        let textures = fingerprint(textures);
        Self::Varied { textures }
    }

    /// Checks whether `textures` are the photographs that this look names.
    fn names(&self, textures: &[Texture]) -> bool {
        match self {
            Self::Objects | Self::Hard | Self::Interiors => textures.is_empty(),
            Self::Photographs { textures: named } | Self::Varied { textures: named } => *named == fingerprint(textures),
        }
    }

    /// Makes the scene of `seed` for a frame of `size` x `size` pixels.
    fn scene(&self, seed: u64, size: usize, textures: &[Texture]) -> Scene {
        match self {
            Self::Objects => scene::random_scene(
                seed,
                Size {
                    width: size,
                    height: size,
                },
            ),
            Self::Photographs { .. } => scene::natural_scene(
                seed,
                Size {
                    width: size,
                    height: size,
                },
                textures,
            ),
            Self::Varied { .. } => scene::varied_scene(
                seed,
                Size {
                    width: size,
                    height: size,
                },
                textures,
            ),
            Self::Hard => scene::hard_scene(
                seed,
                Size {
                    width: size,
                    height: size,
                },
            ),
            Self::Interiors => scene::interior_scene(
                seed,
                Size {
                    width: size,
                    height: size,
                },
            ),
        }
    }
}

/// Returns the [`scene::fingerprint`] of the photographs in hexadecimal, if there are any.
fn fingerprint(textures: &[Texture]) -> Option<String> {
    (!textures.is_empty()).then(|| format!("{:016x}", scene::fingerprint(textures)))
}

/// Half-open ranges of pair indices.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Splits {
    /// The pairs for training.
    pub train: [usize; 2],
    /// The pairs for validation.
    pub validation: [usize; 2],
    /// The pairs for the final test, which are used once.
    pub test: [usize; 2],
}

impl Manifest {
    /// Makes the manifest of a data set of `scenes` pairs, split like the paper's 3800/100/100.
    ///
    /// # Errors
    /// Returns an error if a parameter is invalid.
    pub fn new(
        scenes: usize,
        size: usize,
        planes: usize,
        ldi_layers: usize,
        seed: u64,
        display: Display,
    ) -> Result<Self> {
        for (name, value, most) in [
            ("scenes", scenes, 1_000_000),
            ("size", size, 4096),
            ("planes", planes, sm_lbm::MOST_PLANES),
            ("ldi-layers", ldi_layers, 64),
            ("seed", seed as usize + 1, u32::MAX as usize + 1),
        ] {
            if !(1..=most).contains(&value) {
                return Err(Error::Input(format!(
                    "--{name} is out of range; it must lie in {}..={}",
                    usize::from(name != "seed"),
                    most - usize::from(name == "seed"),
                )));
            }
        }
        let held_out = scenes / 40;
        let (validation, test) = (scenes - 2 * held_out, scenes - held_out);
        Ok(Manifest {
            format: FORMAT.into(),
            scenes,
            size,
            planes,
            ldi_layers,
            seed,
            look: Look::Objects,
            display,
            splits: Splits {
                train: [0, validation],
                validation: [validation, test],
                test: [test, scenes],
            },
            aberration: Vec::new(),
            sensors: Vec::new(),
        })
    }

    /// Returns the manifest with scenes of `look`.
    pub fn looking(self, look: Look) -> Self {
        Manifest { look, ..self }
    }

    /// Returns the manifest with holograms that correct `aberration`.
    pub fn correcting(self, aberration: Option<&AberrationFile>) -> Self {
        Manifest {
            aberration: aberration.map_or_else(Vec::new, AberrationFile::entries),
            ..self
        }
    }

    /// Returns the manifest with depth of `sensors`.
    pub fn sensed_by(self, sensors: Vec<Sensor>) -> Self {
        Manifest { sensors, ..self }
    }

    /// Reads the manifest of the data set in `dir`.
    ///
    /// # Errors
    /// Returns an error if there is no manifest or it has another format.
    pub fn read(dir: &Path) -> Result<Self> {
        let path = dir.join("manifest.json");
        let text = input::text(&path)?;
        let manifest: Manifest = serde_json::from_str(&text).map_err(|e| Error::file(&path, e))?;
        if manifest.format != FORMAT {
            return Err(Error::file(
                path,
                format!("format is {:?}; it must be {FORMAT:?}", manifest.format),
            ));
        }
        if !manifest.aberration.is_empty() {
            let aberration = calibration::aberrations(&manifest.aberration);
            let checked = aberration.and_then(|aberration| aberration.check(&manifest.display));
            checked.map_err(|e| Error::file(&path, e))?;
        }
        Ok(manifest)
    }

    /// Returns the seed of scene `index`.
    pub fn scene_seed(&self, index: usize) -> u64 {
        (self.seed << 32) + index as u64
    }

    /// Returns the path of the file of pair `index` in `dir`.
    pub fn pair_path(dir: &Path, index: usize) -> PathBuf {
        dir.join(format!("pair_{index:06}.npz"))
    }
}

/// The method that computes the holograms.
enum GroundTruth {
    Plain,
    Corrected(Correction),
    Spatial(SpatialAberrations),
}

/// Makes the pairs of `manifest` that are in `shard` and not yet in `dir`. A shard is all pairs, or i/n of them: those
/// whose index is i modulo n. `textures` are the photographs that the look names. `made` is called for each pair that
/// is there.
///
/// # Errors
/// Returns an error if the photographs differ from the manifest's, or if the folder holds another data set or cannot be
/// written.
pub fn make(
    manifest: &Manifest,
    textures: &[Texture],
    dir: &Path,
    (shard, shards): (usize, usize),
    made: &(dyn Fn() + Sync),
) -> Result<()> {
    if !manifest.look.names(textures) {
        return Err(Error::Input(
            "the photographs for surfaces are not those of the data set".into(),
        ));
    }
    std::fs::create_dir_all(dir).map_err(|e| Error::file(dir, e))?;
    let place = dir.join("manifest.json");
    if place.exists() {
        if Manifest::read(dir)? != *manifest {
            return Err(Error::file(
                place,
                "the folder holds a data set of other parameters; choose another folder or the same parameters",
            ));
        }
    } else {
        let mut text = serde_json::to_vec_pretty(manifest).map_err(|e| Error::file(&place, e))?;
        text.push(b'\n');
        output::write_atomically(&place, |file| file.write_all(&text))?;
    }
    let (display, planes) = (&manifest.display, manifest.planes);
    let ground_truth = match manifest.aberration.is_empty() {
        true => GroundTruth::Plain,
        false => match calibration::aberrations(&manifest.aberration)? {
            AberrationFile::Spatial(all) => GroundTruth::Spatial(all),
            AberrationFile::Uniform(all) => {
                let size = Size {
                    width: manifest.size,
                    height: manifest.size,
                };
                let correction = Correction::of_aberrations(&all, size, planes, display)?;
                GroundTruth::Corrected(correction)
            }
        },
    };
    // Makes the pairs in order, so that a stopped run leaves the first ones.
    let mine: Range<usize> = 0..manifest.scenes.saturating_sub(shard).div_ceil(shards);
    mine.par_bridge().try_for_each(|i| {
        let index = i * shards + shard;
        let path = Manifest::pair_path(dir, index);
        if !is_whole(&path) {
            let (seed, size) = (manifest.scene_seed(index), manifest.size);
            let scene = manifest.look.scene(seed, size, textures);
            let ldi = scene::render_ldi_reference(
                &scene,
                Size {
                    width: size,
                    height: size,
                },
                manifest.ldi_layers,
            )?
            .quantized();
            let quiet = |_: usize, _: usize| {};
            let hologram = match &ground_truth {
                GroundTruth::Plain => sm_lbm::hologram(&ldi, display, planes, &quiet)?,
                GroundTruth::Corrected(correction) => corrected::hologram(&ldi, display, planes, correction, &quiet)?,
                GroundTruth::Spatial(all) => spatial::hologram(&ldi, display, planes, all, &quiet)?,
            };
            write_pair(&path, &ldi, &hologram, &sensed(&ldi, &manifest.sensors, seed))?;
        }
        made();
        Ok(())
    })
}

/// Returns the depth of the front layer, d·65535, (S, H, W), that a session makes of each sensor's reading.
fn sensed(ldi: &Ldi, sensors: &[Sensor], seed: u64) -> Array3<u16> {
    let (rgb, truth) = (visible_rgb(ldi), visible_depth(ldi));
    let mut depths = Array3::zeros((sensors.len(), truth.nrows(), truth.ncols()));
    for (sensor, mut plane) in sensors.iter().zip(depths.outer_iter_mut()) {
        let depth = sensor.read(truth.view(), seed).session_depth(&rgb);
        plane.zip_mut_with(depth.as_ref().unwrap_or(&truth), |to, d| {
            *to = (d * 65535.0).round() as u16
        });
    }
    depths
}

/// Writes one pair with the depth `sensed` by sensors, if there are any.
fn write_pair(path: &Path, ldi: &Ldi, hologram: &Array3<Complex32>, sensed: &Array3<u16>) -> Result<()> {
    let Size { width, height } = ldi.size();
    let layers = ldi.layers.len();
    let rgb = Array4::from_shape_fn((layers, height, width, 4), |(l, y, x, c)| {
        let layer = &ldi.layers[l];
        match (layer.depth[(y, x)].is_nan(), c) {
            (true, _) => 0,
            (false, 3) => 255,
            (false, c) => (layer.rgb[(c, y, x)] * 255.0).round() as u8,
        }
    });
    let depth = Array3::from_shape_fn((layers, height, width), |(l, y, x)| {
        let d = ldi.layers[l].depth[(y, x)];
        match d.is_nan() {
            true => u16::MAX,
            false => (d * 65535.0).round() as u16,
        }
    });
    // Builds the archive in memory first: on a full disk, the archive's writer would print to stderr itself.
    let archive = || -> std::result::Result<Vec<u8>, ndarray_npy::WriteNpzError> {
        let mut npz = NpzWriter::new_compressed(Cursor::new(Vec::new()));
        npz.add_array("rgb", &rgb)?;
        npz.add_array("depth", &depth)?;
        npz.add_array("hologram", hologram)?;
        if !sensed.is_empty() {
            npz.add_array("sensed", sensed)?;
        }
        Ok(npz.finish()?.into_inner())
    };
    let bytes = archive().map_err(|e| Error::file(path, e))?;
    output::write_atomically(path, |file| file.write_all(&bytes))
}

/// A pair of a scene and its hologram.
pub struct Pair {
    /// The scene.
    pub ldi: Ldi,
    /// The scene's complex midpoint hologram, (C, H, W), without the carrier.
    pub hologram: Array3<Complex32>,
}

/// The names of a pair's arrays.
const ARRAYS: [&str; 3] = ["rgb.npy", "depth.npy", "hologram.npy"];

/// Checks whether the file is a complete pair. A full disk or a lost write leaves an incomplete file.
fn is_whole(path: &Path) -> bool {
    let archive = file::open(path, u64::MAX).map(|file| ZipArchive::new(BufReader::new(file)));
    matches!(archive, Ok(Ok(archive)) if ARRAYS.iter().all(|name| archive.index_for_name(name).is_some()))
}

/// Opens the file of array `name` in `archive`, whose values have at most `most` bytes.
fn array_bytes(
    archive: &mut ZipArchive<BufReader<File>>,
    name: &str,
    most: usize,
) -> std::result::Result<Vec<u8>, String> {
    /// The most bytes of a header.
    const HEADER: usize = 1 << 16;
    let array = archive
        .by_name(&format!("{name}.npy"))
        .map_err(|e| format!("{name}: {e}"))?;
    let mut bytes = Vec::new();
    let limit = (most + HEADER) as u64;
    (array.take(limit).read_to_end(&mut bytes)).map_err(|e| format!("{name}: {e}"))?;
    Ok(bytes)
}

/// Reads pair `index` of the data set in `dir` that `manifest` describes.
///
/// # Errors
/// Returns an error if the pair does not exist, is damaged, or differs in shape from the manifest.
pub fn read_pair(manifest: &Manifest, dir: &Path, index: usize) -> Result<Pair> {
    let path = Manifest::pair_path(dir, index);
    let file = file::open(&path, u64::MAX).map_err(|e| {
        Error::file(
            &path,
            format!("{e}; `phasefront-lab dataset` into the same folder completes the data set"),
        )
    })?;
    let damaged = |e: &dyn std::fmt::Display| Error::file(&path, format!("is no whole pair: {e}"));
    let mut archive = ZipArchive::new(BufReader::new(file)).map_err(|e| damaged(&e))?;
    let pixels = manifest.size * manifest.size;
    let mut bytes = |name, most| array_bytes(&mut archive, name, most).map_err(|e| damaged(&e));
    let rgb = bytes("rgb", 4 * manifest.ldi_layers * pixels)?;
    let rgb: Array4<u8> = npy::read(&rgb).map_err(|e| damaged(&e))?;
    let depth = bytes("depth", 2 * manifest.ldi_layers * pixels)?;
    let depth: Array3<u16> = npy::read(&depth).map_err(|e| damaged(&e))?;
    let colours = manifest.display.colours();
    let hologram = bytes("hologram", 8 * colours * pixels)?;
    let hologram: Array3<Complex32> = npy::read(&hologram).map_err(|e| damaged(&e))?;
    let (layers, size) = (manifest.ldi_layers, manifest.size);
    if rgb.dim() != (layers, size, size, 4)
        || depth.dim() != (layers, size, size)
        || hologram.dim() != (colours, size, size)
    {
        return Err(damaged(&format!(
            "shapes {:?}, {:?} and {:?} are not those of {layers} layers of {size}×{size} pixels",
            rgb.dim(),
            depth.dim(),
            hologram.dim()
        )));
    }
    let layers = (0..layers).map(|l| LdiLayer {
        rgb: Array3::from_shape_fn((3, size, size), |(c, y, x)| f32::from(rgb[(l, y, x, c)]) / 255.0),
        depth: Array2::from_shape_fn((size, size), |(y, x)| match rgb[(l, y, x, 3)] {
            0 => f32::NAN,
            _ => f32::from(depth[(l, y, x)]) / 65535.0,
        }),
    });
    let ldi = Ldi::new(layers.collect()).map_err(|e| damaged(&e))?;
    Ok(Pair {
        ldi,
        hologram: hologram.as_standard_layout().into_owned(),
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    fn manifest(look: Look) -> Manifest {
        let plain = Manifest::new(4, 24, 8, 2, 3, Display::default()).unwrap();
        plain.looking(look)
    }

    #[test]
    fn a_manifest_without_a_look_is_of_objects_and_stays_as_it_is() {
        let text = serde_json::to_string(&manifest(Look::Objects)).unwrap();
        assert!(!text.contains("look"), "{text}");
        let read: Manifest = serde_json::from_str(&text).unwrap();
        assert_eq!(read, manifest(Look::Objects));
    }

    #[test]
    fn a_set_like_photographs_says_so_and_holds_natural_scenes() {
        let dir = tempfile::tempdir().unwrap();
        let texture = Texture::plain([0.2, 0.5, 0.9]);
        let ours = manifest(Look::photographs(std::slice::from_ref(&texture)));
        make(&ours, std::slice::from_ref(&texture), dir.path(), (1, 4), &|| {}).unwrap();
        assert_eq!(Manifest::read(dir.path()).unwrap(), ours);
        let pair = read_pair(&ours, dir.path(), 1).unwrap();
        let scene = scene::natural_scene(ours.scene_seed(1), Size { width: 24, height: 24 }, &[texture]);
        let ldi = scene::render_ldi_reference(&scene, Size { width: 24, height: 24 }, 2).unwrap();
        assert!(pair.ldi == ldi.quantized());
        let other = manifest(Look::photographs(&[]));
        let refused = make(&other, &[], dir.path(), (1, 4), &|| {}).unwrap_err();
        assert!(refused.to_string().contains("other parameters"), "{refused}");
    }

    #[test]
    fn a_varied_set_says_so_and_holds_varied_scenes() {
        let dir = tempfile::tempdir().unwrap();
        let ours = manifest(Look::varied(&[]));
        make(&ours, &[], dir.path(), (1, 4), &|| {}).unwrap();
        assert_eq!(Manifest::read(dir.path()).unwrap(), ours);
        let pair = read_pair(&ours, dir.path(), 1).unwrap();
        let scene = scene::varied_scene(ours.scene_seed(1), Size { width: 24, height: 24 }, &[]);
        assert!(
            pair.ldi
                == scene::render_ldi_reference(&scene, Size { width: 24, height: 24 }, 2)
                    .unwrap()
                    .quantized()
        );
        let refused = make(&manifest(Look::photographs(&[])), &[], dir.path(), (1, 4), &|| {}).unwrap_err();
        assert!(refused.to_string().contains("other parameters"), "{refused}");
    }

    #[test]
    fn a_set_with_sensors_holds_the_depth_that_sessions_make() {
        let dir = tempfile::tempdir().unwrap();
        let sensors = vec![Sensor::Noise, Sensor::HalfBilinear];
        let ours = manifest(Look::varied(&[])).sensed_by(sensors.clone());
        make(&ours, &[], dir.path(), (1, 4), &|| {}).unwrap();
        assert_eq!(Manifest::read(dir.path()).unwrap(), ours);
        let ldi = read_pair(&ours, dir.path(), 1).unwrap().ldi;
        let file = File::open(Manifest::pair_path(dir.path(), 1)).unwrap();
        let mut archive = ZipArchive::new(BufReader::new(file)).unwrap();
        let bytes = array_bytes(&mut archive, "sensed", 2 * 2 * 24 * 24).unwrap();
        let sensed: Array3<u16> = npy::read(&bytes).unwrap();
        assert_eq!(sensed.dim(), (2, 24, 24));
        for (sensor, depth) in sensors.iter().zip(sensed.outer_iter()) {
            let reading = sensor.read(visible_depth(&ldi).view(), ours.scene_seed(1));
            let expected = reading.session_depth(&visible_rgb(&ldi)).unwrap();
            assert!(
                depth
                    .iter()
                    .zip(&expected)
                    .all(|(a, b)| (f32::from(*a) / 65535.0 - b).abs() < 1e-5)
            );
        }
    }

    #[test]
    fn a_pair_that_is_not_whole_is_made_anew() {
        let dir = tempfile::tempdir().unwrap();
        let ours = manifest(Look::Objects);
        let make = || make(&ours, &[], dir.path(), (1, 4), &|| {}).unwrap();
        make();
        let path = Manifest::pair_path(dir.path(), 1);
        let whole = std::fs::read(&path).unwrap();
        for left in [0, 10, whole.len() / 2, whole.len() - 1] {
            std::fs::write(&path, &whole[..left]).unwrap();
            assert!(read_pair(&ours, dir.path(), 1).is_err());
            make();
            assert_eq!(std::fs::read(&path).unwrap(), whole);
        }
    }

    #[test]
    fn a_pair_that_promises_more_than_there_is_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let ours = manifest(Look::Objects);
        let text = "{'descr': '|u1', 'fortran_order': False, 'shape': (2, 1000000, 1000000, 4), }";
        let header = [b"\x93NUMPY\x01\x00", &[text.len() as u8, 0][..], text.as_bytes()].concat();
        let mut archive = zip::ZipWriter::new(File::create(Manifest::pair_path(dir.path(), 0)).unwrap());
        for name in ARRAYS {
            archive
                .start_file(name, zip::write::SimpleFileOptions::default())
                .unwrap();
            archive.write_all(&header).unwrap();
        }
        archive.finish().unwrap();
        let refused = read_pair(&ours, dir.path(), 0).map(|_| ()).unwrap_err().to_string();
        assert!(refused.contains("is no whole pair"), "{refused}");
    }

    #[test]
    fn other_photographs_than_the_manifests_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let [one, other] = [0.2, 0.3].map(|v| vec![Texture::plain([v; 3])]);
        let looks = [
            (Look::photographs(&one), other),
            (Look::photographs(&one), Vec::new()),
            (Look::photographs(&[]), one.clone()),
            (Look::Objects, one.clone()),
            (Look::varied(&[]), one),
        ];
        for (look, textures) in looks {
            let refused = make(&manifest(look), &textures, dir.path(), (0, 1), &|| {});
            let told = refused.unwrap_err().to_string();
            assert!(told.contains("not those of the data set"), "{told}");
        }
    }
}
