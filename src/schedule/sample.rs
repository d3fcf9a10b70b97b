//! A small schedule to prove readers and exports on.
//!
//! It is made from published matrices with gains of the right size and a trim
//! that differs in every number from speed to speed, so that a table that is
//! mixed up or read by the wrong rule shows. It is no design.

use super::{Provenance, Schedule, hash};
use crate::control::axis::{Channel, GainSet};
use crate::control::law::{LawPoint, LawTable};
use crate::control::loops::LawSettings;
use crate::control::plant::Inversion;
use crate::control::spec::TurnCoordination;
use crate::control::testbed;
use crate::control::tuning::start_gains;
use crate::units::KNOT;

/// Breakpoints, kt: not evenly spaced.
const SPEEDS: [f64; 5] = [0.0, 15.0, 40.0, 60.0, 90.0];

/// The schedule. Its requirements count as not met, because nobody checked.
pub fn schedule() -> Schedule {
    let settings = LawSettings {
        kappa: 0.25,
        hybrid_feedforward: true,
        reference_delay: 0.146,
        roll_frequency: 2.0,
        pitch_frequency: 1.8,
        attitude_damping: 0.8,
        yaw_time_constant: 0.5,
        heave_time_constant: 2.0,
        notch: Default::default(),
    };
    let points = SPEEDS
        .iter()
        .filter_map(|kt| {
            let s = kt / 100.0;
            let mut plant = testbed::plant(kt * KNOT, &testbed::NOMINAL);
            plant.trim.roll = 0.01 - 0.02 * s;
            plant.trim.velocity_body[1] = -0.3 * s;
            plant.trim.sticks =
                [1.0 - 3.0 * s, 6.0 - 20.0 * s * s, 47.0 - 20.0 * s + 40.0 * s * s, 7.0 - 9.0 * s];
            let mut gains = GainSet::default();
            for c in Channel::ALL {
                gains[c.index()] = start_gains(c, 0.16 + 0.02 * s, [0.0, 10.0]);
            }
            // The published matrices can be inverted at every speed.
            let inversion = Inversion::new(&plant).ok()?;
            Some(LawPoint { speed: plant.speed, gains, inversion })
        })
        .collect::<Vec<_>>();
    let table = LawTable::new(
        points,
        settings,
        TurnCoordination { speed: 50.0 * KNOT, width: 10.0 * KNOT },
    );
    let provenance = Provenance {
        generator: format!("coaxdesign {}, sample of the exports", env!("CARGO_PKG_VERSION")),
        problem_hash: hash(["none"]),
        specification_hash: hash(["none"]),
    };
    let limits = [[-100.0, 100.0], [-100.0, 100.0], [0.0, 100.0], [-39.27, 39.27]];
    match table {
        Ok(table) => Schedule::new("sample", &table, testbed::HARDWARE, limits, false, provenance),
        // Five increasing speeds of finite numbers: `LawTable::new` has
        // nothing to refuse.
        Err(error) => unreachable!("{error}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_speed_is_there_and_every_trim_differs() {
        let s = schedule();
        assert_eq!(s.points.len(), SPEEDS.len());
        for pair in s.points.windows(2) {
            assert!(pair[0].trim.sticks.iter().zip(pair[1].trim.sticks).all(|(a, b)| *a != b));
        }
    }
}
