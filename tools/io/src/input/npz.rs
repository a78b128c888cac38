//! Depth maps in `.npz` files: ZIP archives of `.npy` files, as `numpy.savez` and `numpy.savez_compressed` write them.

use crate::input::decode::{MOST_PIXELS, Plane, Said};
use crate::input::npy::{self, Npy};
use std::io::{Cursor, Read};
use zip::ZipArchive;

/// The maximum size of an array in bytes: one of 64-bit numbers and its header. An archive of little more than nothing
/// may hold any number of zeros.
const MOST_ARRAY: u64 = 8 * MOST_PIXELS + (1 << 16);

/// Reads the plane of a whole `.npz` file with one array, or with one called `depth`.
pub(crate) fn read_plane(file: &[u8]) -> Said<Plane> {
    let broken = |e: zip::result::ZipError| format!("is not a whole .npz: {e}");
    let mut archive = ZipArchive::new(Cursor::new(file)).map_err(broken)?;
    let names: Vec<String> = (archive.file_names())
        .filter_map(|name| name.strip_suffix(".npy").map(str::to_owned))
        .collect();
    let name = match names.as_slice() {
        [] => return Err("is a ZIP archive without arrays; a .npz holds .npy files".into()),
        [name] => name,
        names => names.iter().find(|name| *name == "depth").ok_or_else(|| {
            format!(
                "holds several arrays: {}; one of them is to be called depth, or be the only one",
                names.join(", ")
            )
        })?,
    };
    let entry = archive.by_name(&format!("{name}.npy")).map_err(broken)?;
    let mut array = Vec::new();
    // The archive may understate the size of what it holds.
    let read = entry.take(MOST_ARRAY + 1).read_to_end(&mut array);
    read.map_err(|e| format!("is not a whole .npz: {e}"))?;
    if array.len() as u64 > MOST_ARRAY {
        return Err(format!("holds an array of over {MOST_ARRAY} bytes"));
    }
    let plane = Npy::new(&array[..], array.len() as u64).and_then(npy::read_plane);
    plane.map_err(|why| format!("holds the array {name}, which {why}"))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use ndarray::{Array2, array};
    use ndarray_npy::WriteNpyExt;
    use std::io::Write;
    use zip::write::SimpleFileOptions;
    use zip::{CompressionMethod, ZipWriter};

    fn npz(method: CompressionMethod, arrays: &[(&str, Array2<f32>)]) -> Vec<u8> {
        let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
        for (name, array) in arrays {
            let mut bytes = Vec::new();
            array.write_npy(&mut bytes).unwrap();
            let options = SimpleFileOptions::default().compression_method(method);
            archive.start_file(*name, options).unwrap();
            archive.write_all(&bytes).unwrap();
        }
        archive.finish().unwrap().into_inner()
    }

    #[test]
    fn the_only_array_or_the_one_called_depth_is_read() {
        let (depth, other) = (array![[1.0f32, 2.0], [3.0, 4.0]], array![[9.0f32]]);
        for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
            let one = npz(method, &[("arr_0.npy", depth.clone())]);
            assert_eq!(read_plane(&one).unwrap().values, depth);
            let two = npz(method, &[("rgb.npy", other.clone()), ("depth.npy", depth.clone())]);
            assert_eq!(read_plane(&two).unwrap().values, depth);
            let which = npz(method, &[("a.npy", other.clone()), ("b.npy", depth.clone())]);
            assert!(read_plane(&which).unwrap_err().contains("a, b"));
            assert!(read_plane(&npz(method, &[])).unwrap_err().contains("without arrays"));
            for end in 0..one.len() {
                assert!(read_plane(&one[..end]).is_err());
            }
        }
    }
}
