//! Quantities among the arguments, and how large they may be.

use super::CliError;
use coaxdesign::units::{Kind, parse_quantity};

/// Least and largest value of a quantity by the name of its argument: beyond them
/// nothing that is computed means anything. Those of `--model` have two words.
const BOUNDS: [(&str, [&str; 2]); 26] = [
    ("climb", ["-20000 ft/min", "20000 ft/min"]),
    ("turn-rate", ["-360 deg/s", "360 deg/s"]),
    ("sideslip", ["-74 deg", "74 deg"]),
    ("bank", ["-74 deg", "74 deg"]),
    ("wind-azimuth", ["-360 deg", "360 deg"]),
    // Those of the atmosphere's model.
    ("altitude", ["-6500 ft", "98000 ft"]),
    ("power", ["-100000 hp", "100000 hp"]),
    ("thrust", ["-1000000 lbf", "1000000 lbf"]),
    ("torque", ["-10000000 ft lbf", "10000000 ft lbf"]),
    ("ct", ["-1", "1"]),
    ("edgewise", ["-660 kt", "660 kt"]),
    ("axial", ["-660 kt", "660 kt"]),
    // Of a Monte Carlo study: the largest, either way.
    ("cg", ["0 ft", "30 ft"]),
    ("delay", ["0 s", "10 s"]),
    ("turbulence", ["0 kt", "200 kt"]),
    ("gust", ["0 ft/s", "300 ft/s"]),
    ("peak", ["0 kt", "660 kt"]),
    ("saturated", ["0 s", "36000 s"]),
    // Of a model that is varied.
    ("model cg", ["-30 ft", "30 ft"]),
    ("model delay", ["0 s", "10 s"]),
    ("model turbulence", ["0 kt", "200 kt"]),
    ("model gust-forward", ["-300 ft/s", "300 ft/s"]),
    ("model gust-right", ["-300 ft/s", "300 ft/s"]),
    ("model gust-up", ["-300 ft/s", "300 ft/s"]),
    ("model governor", ["1 ms", "1000 s"]),
    ("omega", ["1e-6 rad/s", "1e6 rad/s"]),
];

/// Why a value of an argument is out of bounds; `None` where it is within them, or
/// the argument has none.
pub fn beyond(name: &str, value: f64, kind: Kind) -> Option<String> {
    let [low, high] = BOUNDS.iter().find(|entry| entry.0 == name)?.1;
    let within =
        |bound: &str, holds: &dyn Fn(f64) -> bool| parse_quantity(bound, kind).is_ok_and(holds);
    // The conversion of a bound rounds as that of the value does.
    let held = within(low, &|low| value >= low) && within(high, &|high| value <= high);
    (!held).then(|| format!("write a value from {low} to {high}"))
}

/// The value of `--flag` in SI units, within its bounds.
///
/// # Errors
/// A text that is no quantity of the kind, or one out of bounds.
pub fn quantity(flag: &str, text: &str, kind: Kind) -> Result<f64, CliError> {
    let value = parse_quantity(text, kind).map_err(|error| CliError::Usage {
        message: format!("--{flag} {text:?}: {error}"),
        help: error.help(),
    })?;
    match beyond(flag, value, kind) {
        None => Ok(value),
        Some(help) => {
            Err(CliError::Usage { message: format!("--{flag} {text:?} is out of bounds"), help })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every bound is a quantity, the lower below the higher; what lies on one is
    /// within it, and what lies beyond is told the bounds as they stand here.
    #[test]
    fn bounds_can_be_read_and_hold() {
        for (name, [low, high]) in BOUNDS {
            let kinds: Vec<Kind> = Kind::ALL
                .into_iter()
                .filter(|kind| {
                    parse_quantity(low, *kind).is_ok() && parse_quantity(high, *kind).is_ok()
                })
                .collect();
            assert!(!kinds.is_empty(), "{name}");
            for kind in kinds {
                let [low_si, high_si] = [low, high].map(|text| parse_quantity(text, kind).unwrap());
                assert!(low_si < high_si, "{name}");
                assert_eq!(beyond(name, low_si, kind), None, "{name}");
                assert_eq!(beyond(name, high_si, kind), None, "{name}");
                let help = beyond(name, 1.001 * high_si, kind).unwrap();
                assert!(help.contains(low) && help.contains(high), "{help}");
                assert!(beyond(name, f64::NAN, kind).is_some(), "{name}");
            }
        }
        assert_eq!(beyond("other", 1e300, Kind::Length), None);
        let error = quantity("climb", "1e300 m/s", Kind::Velocity).unwrap_err().to_string();
        assert!(error.len() < 200 && error.contains("1e300 m/s"), "{error}");
    }
}
