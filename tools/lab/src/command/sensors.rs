//! The flag `--sensor`: names of simulated sensors.

use clap::ValueEnum;
use phasefront_lab::sensor::Sensor;

/// One value of the flag: a sensor, or all of them.
#[derive(Clone)]
pub(super) struct Sensors(Vec<Sensor>);

impl Sensors {
    /// Returns the sensors of all values.
    pub(super) fn all(values: &[Sensors]) -> Vec<Sensor> {
        values.iter().flat_map(|sensors| sensors.0.clone()).collect()
    }
}

pub(super) fn parse(text: &str) -> Result<Sensors, String> {
    match text {
        "all" => Ok(Sensors(Sensor::value_variants().to_vec())),
        name => Sensor::from_str(name, false).map(|sensor| Sensors(vec![sensor])),
    }
}

/// Returns the values of the flag for its help.
pub(super) fn names() -> String {
    let names: Vec<String> = Sensor::value_variants().iter().map(|sensor| name_of(*sensor)).collect();
    format!("all, {}", names.join(", "))
}

/// Returns the name of a sensor on the command line.
pub(super) fn name_of(sensor: Sensor) -> String {
    sensor
        .to_possible_value()
        .map_or_else(String::new, |value| value.get_name().to_owned())
}
