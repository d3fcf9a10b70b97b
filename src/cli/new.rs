//! `coaxdesign new`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::{CliError, Outcome, output};
use coaxdesign::control::spec;
use coaxdesign::simulate::maneuver;

/// What to start; a test holds every text to the checks of its kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Kind {
    /// A problem file: two rotors on one shaft
    Coaxial,
    /// A problem file: main and tail rotor
    Helicopter,
    /// A problem file: four rotors whose speeds are the controls
    Multicopter,
    /// A problem file: four coaxial pairs of propellers, by blade elements
    CoaxialMulticopter,
    /// A specification: what the gains must meet
    Specification,
    /// A manoeuvre: what is flown
    Maneuver,
}

impl Kind {
    fn text(self) -> Result<&'static str, CliError> {
        Ok(match self {
            Kind::Coaxial => include_str!("starter.toml"),
            Kind::Helicopter => include_str!("../../examples/light-helicopter.toml"),
            Kind::Multicopter => include_str!("../../problems/hummingbird.toml"),
            Kind::CoaxialMulticopter => include_str!("../../problems/octo-x8.toml"),
            Kind::Specification => spec::BUILTIN,
            Kind::Maneuver => {
                let (_, text) = maneuver::BUILTIN
                    .iter()
                    .find(|(name, _)| *name == "accel-climb-turn")
                    .ok_or_else(|| CliError::Internal("no manoeuvre to start from".into()))?;
                text
            }
        })
    }
}

/// Write a commented file to start from
#[derive(Debug, Args)]
pub struct New {
    /// File to write
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// What the file is to be
    #[arg(long, value_enum, default_value = "coaxial")]
    kind: Kind,
    /// Replace the file if it is already there
    #[arg(long)]
    force: bool,
}

impl New {
    pub(super) fn run(self) -> Result<Outcome, CliError> {
        output::write_whole(&self.file, self.kind.text()?.as_bytes(), self.force)?;
        Ok(Outcome::Done)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn starters_are_sound() {
        for kind in [Kind::Coaxial, Kind::Helicopter, Kind::Multicopter, Kind::CoaxialMulticopter] {
            let text = kind.text().unwrap();
            // Nothing beside the file is needed.
            let alone = Path::new("/nowhere");
            let loaded = coaxdesign::problem::parse_str("starter.toml", text, alone);
            let loaded = loaded.unwrap_or_else(|report| panic!("{kind:?}: {report}"));
            assert!(loaded.warnings.is_empty(), "{kind:?}: {:?}", loaded.warnings);
        }
        spec::parse("spec.toml", Kind::Specification.text().unwrap()).unwrap();
        maneuver::parse("maneuver.toml", Kind::Maneuver.text().unwrap()).unwrap();
    }
}
