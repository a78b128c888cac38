//! Measures the plane sweep on smooth slopes, where the boundaries between planes can show as stripes.

use crate::study::sweep_parts::Figures;
use ndarray::{Array2, Array3, ArrayView3, Axis, concatenate};
use num_complex::Complex32;
use phasefront::Size;
use phasefront::{Display, RgbdFrame, Sweep};
use phasefront_core::method::sweep::SweepPlan;
use phasefront_core::view::refocus::Refocus;
use phasefront_exact::sm_lbm;
use phasefront_io::ldi::{Ldi, LdiLayer};
use phasefront_io::{Error, Result};
use rayon::prelude::*;
use serde::Serialize;

/// The slopes: the name, whether the surface is curved, and whether it has a texture.
pub const SLOPES: [(&str, bool, bool); 4] = [
    ("straight", false, false),
    ("straight, textured", false, true),
    ("curved", true, false),
    ("curved, textured", true, true),
];

/// The depths in focus in the near and far views.
const FOCUS: [f64; 2] = [0.25, 0.75];

/// One method on one slope, compared with SM-LBM with many planes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// The slope, one of [`SLOPES`].
    pub slope: &'static str,
    /// The method in words.
    pub method: String,
    /// The quality of the midpoint hologram's amplitude.
    pub midpoint: Figures,
    /// The quality of the view focused on depth 0.25.
    pub near: Figures,
    /// The quality of the view focused on depth 0.75.
    pub far: Figures,
}

/// The result of the study.
#[derive(Debug)]
pub struct Slopes {
    /// The figures, slope by slope.
    pub rows: Vec<Row>,
    /// The views of the slopes, (C, H, W), one slope below the other: near focus, then far focus, each of the truth,
    /// points moved to planes and the sweep.
    pub picture: Array3<f32>,
}

/// Compares the sweep with SM-LBM with `planes` planes on slopes of `size`×`size` pixels. `done` is called after each
/// hologram, [`work`] times in total.
///
/// # Errors
/// Returns an error if the size is 0 or the display cannot be swept.
pub fn study(size: usize, planes: usize, display: &Display, done: &(dyn Fn() + Sync)) -> Result<Slopes> {
    let z_m = FOCUS.map(|depth| display.z_of_depth(depth));
    let refocus = Refocus::new(
        Size {
            width: size,
            height: size,
        },
        display,
        &z_m,
        None,
    )?;
    let views = |field: Array3<Complex32>| -> Result<Vec<Array3<f32>>> {
        let midpoint = field.mapv(|u| u.norm());
        let stack = refocus.focal_stack(field.as_slice().expect("standard layout"), &z_m)?;
        let stack = stack
            .into_iter()
            .map(|view| Array3::from_shape_vec(midpoint.dim(), view));
        let stack = stack.collect::<std::result::Result<Vec<_>, _>>();
        let stack = stack.map_err(|e| Error::Input(e.to_string()))?;
        Ok(std::iter::once(midpoint).chain(stack).collect())
    };
    let sweeps = sweeps(display);
    let of_slopes = SLOPES.par_iter().map(|&(slope, curved, textured)| {
        let frame = frame(size, curved, textured)?;
        let ldi = Ldi::new(vec![LdiLayer::from(&frame)])?;
        let frame = frame.for_display(display);
        let truth = views(sm_lbm::hologram(&ldi, display, planes, &|_, _| {})?)?;
        done();
        let (mut rows, mut seen) = (Vec::new(), vec![truth.clone()]);
        for (method, sweep) in &sweeps {
            let plan = SweepPlan::new(
                Size {
                    width: size,
                    height: size,
                },
                display,
                *sweep,
                0.0,
            )?;
            let mut field = Array3::zeros((display.colours(), size, size));
            let values = field.as_slice_mut().expect("standard layout");
            plan.field(&frame, values, &mut plan.scratch())?;
            let ours = views(field)?;
            done();
            let alike = (ours.iter().zip(&truth))
                .map(|(a, b)| Figures::of(a.view(), b.view()))
                .collect::<Result<Vec<_>>>()?;
            rows.push(Row {
                slope,
                method: method.clone(),
                midpoint: alike[0],
                near: alike[1],
                far: alike[2],
            });
            seen.push(ours);
        }
        let focused = |view: usize| seen[..3].iter().map(move |views| views[view].clone());
        Ok((rows, beside(Axis(2), focused(1).chain(focused(2)))))
    });
    let of_slopes = of_slopes.collect::<Result<Vec<_>>>()?;
    let picture = beside(Axis(1), of_slopes.iter().map(|(_, strip)| strip.clone()));
    Ok(Slopes {
        rows: of_slopes.into_iter().flat_map(|(rows, _)| rows).collect(),
        picture,
    })
}

/// Returns the number of holograms of [`study`].
pub fn work(display: &Display) -> usize {
    SLOPES.len() * (1 + sweeps(display).len())
}

/// Returns the sweeps to compare.
fn sweeps(display: &Display) -> Vec<(String, Sweep)> {
    let default = Sweep::for_display(display);
    let moved = Sweep {
        between_planes: false,
        ..default
    };
    let planes = default.planes;
    vec![
        (format!("{planes} planes, points moved to planes"), moved),
        (format!("{planes} planes"), default),
        (format!("{} planes", 2 * planes), Sweep::of_planes(display, 2 * planes)),
    ]
}

/// Makes a slope from depth 0.1 to 0.9.
fn frame(size: usize, curved: bool, textured: bool) -> Result<RgbdFrame> {
    let at = |i: usize| (i as f32 + 0.5) / size as f32;
    let depth = Array2::from_shape_fn((size, size), |(y, x)| {
        let (v, u) = (at(y), at(x));
        let way = if curved {
            2.0 * ((u - 0.5).powi(2) + (v - 0.5).powi(2))
        } else {
            0.8 * v + 0.2 * u
        };
        0.1 + 0.8 * way
    });
    let rgb = Array3::from_shape_fn((3, size, size), |(c, y, x)| {
        if !textured {
            return 0.6;
        }
        let wave = (0.35 * x as f32 + c as f32).sin() * (0.27 * y as f32).cos();
        let blocks = ((x / 3 * 7 + y / 3 * 13 + c * 5) % 11) as f32 / 10.0;
        0.4 + 0.2 * wave + 0.2 * blocks
    });
    Ok(RgbdFrame::new(rgb, depth)?)
}

/// Joins panels of one size with white gaps.
fn beside(axis: Axis, panels: impl Iterator<Item = Array3<f32>>) -> Array3<f32> {
    let panels: Vec<_> = panels.collect();
    let mut gap = panels[0].raw_dim();
    gap[axis.index()] = 4;
    let gap = Array3::from_elem(gap, 1.0);
    let each = panels.iter().flat_map(|panel| [gap.view(), panel.view()]).skip(1);
    let each: Vec<ArrayView3<'_, f32>> = each.collect();
    concatenate(axis, &each).expect("panels of one size")
}
