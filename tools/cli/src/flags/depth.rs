//! The flags for the meaning of a depth image's values.

use crate::record::RunRecord;
use clap::{Args, ValueEnum};
use phasefront_command::flags::check_used;
use phasefront_core::depth::DepthUnit;
use phasefront_io::frame::DepthOptions;
use phasefront_io::{Error, Result};

/// The unit of a depth image's values, and the range of depth to show.
#[derive(Default, Args)]
#[command(next_help_heading = "Depth")]
pub(crate) struct DepthFlags {
    /// Unit of the depth values; 0 and NaN are missing readings, except in normalized depth [default: normalized]
    #[arg(long, value_enum)]
    depth_unit: Option<UnitName>,
    /// Units per metre, for --depth-unit raw
    #[arg(long, value_name = "N", required_if_eq("depth_unit", "raw"))]
    depth_scale: Option<f64>,
    /// Depth shown nearest, in metres for any --depth-unit [default: the 1st percentile]
    #[arg(long, value_name = "M")]
    near: Option<f32>,
    /// Depth shown farthest, in metres for any --depth-unit [default: the 99th percentile]
    #[arg(long, value_name = "M")]
    far: Option<f32>,
}

#[derive(Clone, Copy, Default, PartialEq, ValueEnum)]
enum UnitName {
    #[default]
    /// From 0, nearest, to the largest number, farthest
    Normalized,
    /// Metres
    M,
    /// Millimetres
    Mm,
    /// Inverse metres; pixels where Middlebury's calib.txt lies beside
    Disparity,
    /// 256 units per metre, as KITTI's PNGs of 16 bits
    Kitti,
    /// --depth-scale units per metre
    Raw,
}

impl DepthFlags {
    /// Records the unit of the depth, which a folder's layout may define.
    pub(crate) fn record(&self, record: &mut RunRecord) {
        record.choice("--depth-unit", Some(&self.depth_unit.unwrap_or_default()));
        record.set("--depth-scale", self.depth_scale);
    }

    /// Takes the unit that a folder's layout defines, unless --depth-unit is given.
    pub(crate) fn take_layout(&mut self, unit: Option<DepthUnit>) {
        let (Some(unit), None) = (unit, self.depth_unit) else {
            return;
        };
        self.depth_unit = Some(match unit {
            DepthUnit::Normalized => UnitName::Normalized,
            DepthUnit::Metres => UnitName::M,
            DepthUnit::Millimetres => UnitName::Mm,
            DepthUnit::Disparity => UnitName::Disparity,
            DepthUnit::Raw { units_per_m } => {
                self.depth_scale = Some(units_per_m);
                UnitName::Raw
            }
        });
    }

    /// Returns --near and --far of video, in metres.
    pub(crate) fn range(&self) -> Result<Option<(f32, f32)>> {
        match (self.near, self.far) {
            (None, None) => Ok(None),
            (Some(near), Some(far)) => Ok(Some((near, far))),
            _ => Err(Error::Usage("video needs both --near and --far, or neither".into())),
        }
    }

    /// Returns how depth is read. `inverted` tells whether --invert is given.
    pub(crate) fn options(&self, inverted: bool) -> Result<DepthOptions> {
        let unit = self.depth_unit.unwrap_or_default();
        check_used(&[(
            "--depth-scale",
            self.depth_scale.is_some(),
            unit == UnitName::Raw,
            "--depth-unit raw",
        )])?;
        let unit = match unit {
            UnitName::Normalized => DepthUnit::Normalized,
            UnitName::M => DepthUnit::Metres,
            UnitName::Mm => DepthUnit::Millimetres,
            UnitName::Disparity => DepthUnit::Disparity,
            UnitName::Kitti => DepthUnit::Raw { units_per_m: 256.0 },
            UnitName::Raw => DepthUnit::Raw {
                units_per_m: self.depth_scale.unwrap_or(f64::NAN),
            },
        };
        Ok(DepthOptions {
            unit,
            near_m: self.near,
            far_m: self.far,
            inverted,
        })
    }
}
