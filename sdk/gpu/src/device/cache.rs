//! Compiled programs that are stored between runs, with a seal that is checked before a driver receives them.
//!
//! Drivers trust these bytes. A file in a cache directory may be truncated, damaged on disk or from an older driver, so
//! only complete programs of the same GPU and driver are used. The seal detects damage and is not a signature: programs
//! should be stored where only the app itself writes.
#![allow(unsafe_code)]

use std::hash::{DefaultHasher, Hasher};

/// The first bytes of sealed programs. The last character is the version.
const MAGIC: [u8; 16] = *b"phasefront gpu 1";
/// The length of the header: the magic, the digest of the GPU and its driver, and the digest of the programs.
const HEADER: usize = MAGIC.len() + 16;

/// Prepends a header that identifies the GPU, the driver and the programs.
pub(super) fn seal(programs: &[u8], info: &wgpu::AdapterInfo) -> Vec<u8> {
    [&header(programs, info)[..], programs].concat()
}

/// Creates a pipeline cache for `device` from programs that were sealed on an earlier run. If they are rejected,
/// returns an empty cache and the reason.
pub(super) fn open(
    device: &wgpu::Device,
    info: &wgpu::AdapterInfo,
    sealed: Option<&[u8]>,
) -> (wgpu::PipelineCache, Option<&'static str>) {
    let (programs, refused) = match sealed.map(|sealed| unseal(sealed, info)) {
        Some(Ok(programs)) => (Some(programs), None),
        Some(Err(why)) => (None, Some(why)),
        None => (None, None),
    };
    // SAFETY: `unseal` accepts only complete data that `PipelineCache::get_data` returned for the same GPU and driver.
    // wgpu checks its own header in the data and falls back to an empty cache.
    let cache = unsafe {
        device.create_pipeline_cache(&wgpu::PipelineCacheDescriptor {
            label: None,
            data: programs,
            fallback: true,
        })
    };
    (cache, refused)
}

/// Returns the programs that [`seal`] sealed for the same GPU and driver, or why they are rejected.
fn unseal<'a>(sealed: &'a [u8], info: &wgpu::AdapterInfo) -> Result<&'a [u8], &'static str> {
    let Some((given, programs)) = sealed.split_at_checked(HEADER) else {
        return Err("they end within their header");
    };
    let right = header(programs, info);
    let same = |part: std::ops::Range<usize>| given[part.clone()] == right[part];
    match () {
        () if !same(0..16) => Err("they are of another version, or no programs"),
        () if !same(16..24) => Err("they are of another GPU or driver"),
        () if !same(24..32) => Err("they are damaged"),
        () => Ok(programs),
    }
}

fn header(programs: &[u8], info: &wgpu::AdapterInfo) -> [u8; HEADER] {
    let mut maker = DefaultHasher::new();
    maker.write_u32(info.vendor);
    maker.write_u32(info.device);
    for text in [info.backend.to_str(), &info.name, &info.driver, &info.driver_info] {
        maker.write_usize(text.len());
        maker.write(text.as_bytes());
    }
    // Another Rust release may hash differently. The programs are then compiled again.
    let mut whole = DefaultHasher::new();
    whole.write_usize(programs.len());
    whole.write(programs);
    let mut header = [0; HEADER];
    header[..16].copy_from_slice(&MAGIC);
    header[16..24].copy_from_slice(&maker.finish().to_le_bytes());
    header[24..].copy_from_slice(&whole.finish().to_le_bytes());
    header
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::testing::{opened, software};
    use super::super::{Device, DeviceOptions};
    use super::*;

    /// Opens a software driver with stored programs. Software drivers support storing them.
    fn device(programs: Option<Vec<u8>>) -> Device {
        let options = DeviceOptions { programs, ..software() };
        opened(Device::open(&options))
    }

    /// Runs a program that writes the number 7.
    fn seven(device: &Device) -> Vec<u8> {
        let source = "
            @group(0) @binding(0) var<storage, read_write> result: array<u32>;
            @compute @workgroup_size(1) fn seven() { result[0] = 7u; }";
        let buffer = device.guarded(|| {
            let result = device.buffer("result", 16)?;
            let program = device.program("seven", source.into(), "seven");
            let step = program.on(device, &[(0, result.as_entire_binding())], [1, 1, 1])?;
            let mut encoder = device.inner.create_command_encoder(&Default::default());
            step.run(&mut encoder.begin_compute_pass(&Default::default()));
            device.queue.submit([encoder.finish()]);
            Ok(result)
        });
        device.read(&buffer.unwrap(), 4).unwrap()
    }

    #[test]
    fn programs_are_kept_from_run_to_run() {
        let first = device(None);
        let before = first.programs().unwrap();
        assert_eq!(seven(&first), [7, 0, 0, 0]);
        let programs = first.programs().unwrap();
        assert!(programs.len() >= before.len());
        let second = device(Some(programs));
        assert_eq!(second.programs_refused(), None);
        assert_eq!(seven(&second), [7, 0, 0, 0]);
    }

    #[test]
    fn what_is_not_as_it_was_never_reaches_the_driver() {
        let first = device(None);
        seven(&first);
        let programs = first.programs().unwrap();
        let changed = |at: usize| {
            let mut changed = programs.clone();
            changed[at] ^= 1;
            changed
        };
        let longer = [&programs[..], &[0]].concat();
        let cases = [
            ("nothing", Vec::new(), "header"),
            ("three bytes", vec![1, 2, 3], "header"),
            ("another file", vec![0x55; programs.len()], "version"),
            ("the driver's bytes bare", programs[HEADER..].to_vec(), "version"),
            ("another version", changed(15), "version"),
            ("another GPU", changed(16), "another GPU"),
            ("another digest", changed(24), "damaged"),
            ("the first byte changed", changed(HEADER), "damaged"),
            ("the last byte changed", changed(programs.len() - 1), "damaged"),
            ("cut short", programs[..programs.len() - 1].to_vec(), "damaged"),
            ("empty", programs[..HEADER].to_vec(), "damaged"),
            ("longer", longer, "damaged"),
        ];
        for (name, kept, word) in cases {
            let device = device(Some(kept));
            let why = device.programs_refused().unwrap_or("taken");
            assert!(why.contains(word), "{name}: {why}");
            assert_eq!(seven(&device), [7, 0, 0, 0], "{name}");
        }
    }

    #[test]
    fn each_damaged_byte_is_found() {
        let device = device(None);
        let info = device.inner.adapter_info();
        let programs: Vec<u8> = (0..=255).collect();
        let sealed = seal(&programs, &info);
        assert_eq!(unseal(&sealed, &info), Ok(&programs[..]));
        for at in 0..sealed.len() {
            let mut damaged = sealed.clone();
            damaged[at] ^= 0x10;
            assert!(unseal(&damaged, &info).is_err(), "byte {at}");
            assert!(unseal(&sealed[..at], &info).is_err(), "{at} bytes");
        }
        let update = wgpu::AdapterInfo {
            driver_info: format!("{} and later", info.driver_info),
            ..info
        };
        assert_eq!(unseal(&sealed, &update), Err("they are of another GPU or driver"));
    }
}
