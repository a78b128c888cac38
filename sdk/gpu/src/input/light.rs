//! The constants of the program that converts colours to amplitudes.

use phasefront_core::frame::{LightConstants, RgbEncoding};

/// Returns the constants that `light.wgsl` reads.
pub(super) fn header(light: &LightConstants) -> String {
    let kind = match light.encoding {
        RgbEncoding::Amplitude => "AMPLITUDE",
        RgbEncoding::Bt2020Hlg => "HLG",
        RgbEncoding::Bt2020Pq => "PQ",
        _ => "SRGB",
    };
    let numbers = |values: &[f32]| {
        let all: Vec<_> = values.iter().map(|v| format!("{v:?}")).collect();
        all.join(", ")
    };
    let columns: [f32; 9] = std::array::from_fn(|i| light.matrix[i % 3][i / 3]);
    format!(
        "const AMPLITUDE: u32 = 0u;
        const SRGB: u32 = 1u;
        const HLG: u32 = 2u;
        const PQ: u32 = 3u;
        const ENCODING: u32 = {kind};
        const TO_LASERS: mat3x3f = mat3x3f({});
        const LUMINANCE: vec3f = vec3f({});
        const GAMUT: vec2f = vec2f({});
        const HIGHLIGHTS: vec2f = vec2f({});
        const HLG_GAIN: f32 = {:?};
        const PQ_FULL: f32 = {:?};
        ",
        numbers(&columns),
        numbers(&light.luminance),
        numbers(&light.gamut),
        numbers(&light.highlights),
        light.full[0],
        light.full[1],
    )
}
