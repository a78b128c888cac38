//! The depth of Samsung's portraits, in a trailer behind the photo. Samsung does not publish the form of its numbers,
//! so that it is only named.
//!
//! The trailer ends with the length of its directory and `SEFT`. The directory begins with `SEFH`, a version and the
//! number of entries. An entry has a kind, the way from the directory back to its block, and the block's size; a block
//! has the kind again, the length of its name, its name and its data. All numbers are little-endian.

/// The kinds of blocks that hold depth, of two cameras and of one, and the name of exiftool's tag for each.
const KINDS: [(u16, &str); 2] = [(0x0AB1, "DepthMapTiff"), (0x0B41, "SingleShotDepthMapTiff")];

/// Returns the name of the depth in Samsung's trailer and that of exiftool's tag, if `file` has both.
pub(super) fn depth(file: &[u8]) -> Option<(String, &'static str)> {
    let number = |at: usize| Some(u32::from_le_bytes(*file.get(at..)?.first_chunk()?) as usize);
    let end = file.strip_suffix(b"SEFT")?.len().checked_sub(4)?;
    let directory = end.checked_sub(number(end)?)?;
    let entries = file.get(directory..end)?.strip_prefix(b"SEFH")?.get(8..)?;
    entries.chunks_exact(12).find_map(|entry| {
        let kind = u16::from_le_bytes([entry[2], entry[3]]);
        let (_, tag) = KINDS.iter().find(|(known, _)| *known == kind)?;
        let back = u32::from_le_bytes(*entry[4..].first_chunk()?) as usize;
        let block = directory.checked_sub(back)?;
        let name = file.get(block + 8..)?.get(..number(block + 4)?)?;
        Some((
            String::from_utf8_lossy(name.get(..64).unwrap_or(name)).into_owned(),
            *tag,
        ))
    })
}
