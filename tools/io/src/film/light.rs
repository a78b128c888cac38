//! The light of HDR films, mapped to that of an SDR display.

use super::{Film, Pixels};
use crate::{Error, Result};
use std::path::Path;
use std::process::{Command, Stdio};

/// The transfer function of a film's light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Light {
    /// That of a film for displays of standard dynamic range.
    Sdr,
    /// Hybrid log-gamma or the perceptual quantizer, ITU-R BT.2100.
    Hdr,
}

/// The luminance of an SDR display's white, in cd/m² (ITU-R BT.2035).
const SDR_WHITE: f64 = 100.0;
/// The luminance of an HDR film's reference white, which lies above that of SDR white, in cd/m² (ITU-R BT.2408).
const HDR_WHITE: f64 = 203.0;
/// The luminance of the largest number in what is measured, in cd/m².
const MOST: f64 = 10_000.0;
/// The share of a picture's pixels that may be brighter than its peak.
const BRIGHTER: f64 = 1e-3;
/// The most pictures of which the peak is measured.
const MEASURED: u32 = 512;
/// The fraction of white up to which light is kept as it is, where a film is brighter than its reference white.
const KEPT: f64 = 0.75;

impl Light {
    /// Returns the light of a film for which ffprobe says this transfer function.
    pub(super) fn of(transfer: Option<&str>) -> Self {
        match transfer {
            Some("arib-std-b67" | "smpte2084") => Light::Hdr,
            _ => Light::Sdr,
        }
    }

    /// Returns ffmpeg's filters that map the film at `path` to BT.709, or `None` if it needs none.
    ///
    /// A film that is nowhere brighter than SDR white shows what its SDR twin shows, at the same luminances. Up to the
    /// reference white, white is the film's peak. A brighter film has its reference white at SDR white, and its
    /// highlights are compressed.
    ///
    /// zscale applies the gamma of hybrid log-gamma's display to each channel instead of the luminance, as most
    /// programs that use it do. Greys are exact, and saturated colours are more saturated than by ITU-R BT.2100.
    ///
    /// # Errors
    /// Returns an error if ffmpeg lacks the filters or cannot read the film.
    pub(super) fn to_sdr(self, path: &Path) -> Result<Option<String>> {
        if self == Light::Sdr {
            return Ok(None);
        }
        check_filters(path)?;
        let peak = peak(path)?;
        let white = peak.clamp(SDR_WHITE, HDR_WHITE);
        let highlights = if peak > white {
            format!("tonemap=mobius:param={KEPT}:peak={}:desat=0", peak / white)
        } else {
            "tonemap=clip:desat=0".to_owned()
        };
        Ok(Some(format!(
            "zscale=t=linear:npl={white},format=gbrpf32le,zscale=p=bt709,{highlights},zscale=t=bt709:m=gbr:r=pc,format=gbrp16le"
        )))
    }
}

/// Checks that ffmpeg has the filters that HDR films need.
fn check_filters(path: &Path) -> Result<()> {
    let output = Command::new("ffmpeg")
        .args(["-hide_banner", "-filters"])
        .stdin(Stdio::null())
        .output();
    let said = output
        .map(|output| String::from_utf8_lossy(&output.stdout).into_owned())
        .unwrap_or_default();
    let has = |filter: &str| said.lines().any(|line| line.split_whitespace().nth(1) == Some(filter));
    if has("zscale") && has("tonemap") {
        return Ok(());
    }
    Err(Error::file(
        path,
        "is an HDR film, for which the ffmpeg that is installed lacks its filters zscale and tonemap; export it in SDR, or install an ffmpeg with zimg",
    ))
}

/// Returns the luminance in cd/m² that a few pixels of the brightest picture exceed.
fn peak(path: &Path) -> Result<f64> {
    // A mean over pixels is as bright as the picture. zscale is slow and reads no more than it needs.
    let measured = format!(
        "scale=w='min(iw,480)':h=-2:flags=area,zscale=t=linear:npl={MOST},format=gbrpf32le,zscale=p=bt709,format=gbrp16le"
    );
    let mut film = Film::survey(path, Pixels::DeepRgb, Some(&measured), MEASURED)?;
    let mut peak = 0;
    while let Some(picture) = film.read()? {
        let channels = picture.bytes.as_chunks::<2>().0.as_chunks::<3>().0;
        let mut brightest: Vec<u16> = (channels.iter())
            .map(|rgb| rgb.map(u16::from_be_bytes).into_iter().max().unwrap_or(0))
            .collect();
        if let Some(last) = brightest.len().checked_sub(1) {
            let rank = ((1.0 - BRIGHTER) * last as f64) as usize;
            peak = peak.max(*brightest.select_nth_unstable(rank).1);
        }
    }
    Ok(f64::from(peak) / f64::from(u16::MAX) * MOST)
}
