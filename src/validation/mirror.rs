//! The mirror image of a rotorcraft in its plane of symmetry.

use crate::problem::{
    Direction, FlowAngle, FuselageAerodynamics, FuselageTable, Problem, STICKS, Station,
};
use crate::vehicle::{Layout, Vehicle};
use std::sync::Arc;

/// Sticks that change sign in the mirror: lateral stick and pedals.
const MIRRORED_STICKS: [usize; 2] = [0, 3];

/// The mirror image of a problem in its plane of symmetry. The sticks are
/// mirrored too: lateral stick and pedals change sign.
#[must_use]
pub fn mirrored(problem: &Problem) -> Problem {
    let station = |place: Station| Station { butt_line: -place.butt_line, ..place };
    let mut mirror = problem.clone();
    let mass = &mut mirror.mass;
    mass.center_of_gravity = station(mass.center_of_gravity);
    mass.i_xy = -mass.i_xy;
    mass.i_yz = -mass.i_yz;
    for body in &mut mirror.fuselages {
        body.position = station(body.position);
        if let FuselageAerodynamics::Table(table) = &body.aerodynamics {
            body.aerodynamics = FuselageAerodynamics::Table(Arc::new(mirrored_table(table)));
        }
    }
    for rotor in &mut mirror.rotors {
        rotor.hub = station(rotor.hub);
        rotor.cant = -rotor.cant;
        rotor.direction = match rotor.direction {
            Direction::CounterClockwise => Direction::Clockwise,
            Direction::Clockwise => Direction::CounterClockwise,
        };
    }
    for wing in &mut mirror.wings {
        wing.aerodynamic_center = station(wing.aerodynamic_center);
        wing.cant = -wing.cant;
        wing.chord.station = wing.chord.station.iter().rev().map(|s| 1.0 - s).collect();
        wing.chord.value.reverse();
        if let Some(behind) = &mut wing.dynamic_pressure
            && behind.over == FlowAngle::Sideslip
        {
            behind.angle = behind.angle.iter().rev().map(|angle| -angle).collect();
            behind.ratio.reverse();
        }
        if let Some(surface) = &mut wing.surface {
            for stick in MIRRORED_STICKS {
                surface.gearing[stick] = -surface.gearing[stick];
            }
        }
    }
    for mix in &mut mirror.controls.mix {
        for row in [&mut mix.theta_0, &mut mix.theta_1c, &mut mix.theta_1s, &mut mix.speed] {
            for stick in MIRRORED_STICKS {
                row[stick] = -row[stick];
            }
        }
    }
    for stick in MIRRORED_STICKS {
        let [low, high] = problem.controls.stick_limits[stick];
        mirror.controls.stick_limits[stick] = [-high, -low];
    }
    mirror
}

fn mirrored_table(table: &FuselageTable) -> FuselageTable {
    let columns = table.sideslip.len();
    let loads = [0, 1, 2, 3, 4, 5].map(|k| {
        // Y, L and N change sign.
        let sign = if [1, 3, 5].contains(&k) { -1.0 } else { 1.0 };
        table.loads[k]
            .chunks(columns)
            .flat_map(|row| row.iter().rev().map(move |value| sign * value))
            .collect()
    });
    FuselageTable {
        angle_of_attack: table.angle_of_attack.clone(),
        sideslip: table.sideslip.iter().rev().map(|angle| -angle).collect(),
        loads,
    }
}

/// Signs of the mirror on the states: v, p, r and φ change. Rotor states live
/// in each rotor's own frame, which is mirrored with it.
#[must_use]
pub fn mirror_signs(vehicle: &Vehicle) -> Vec<f64> {
    let body = Layout::BODY;
    let changed = [body.velocity + 1, body.rate, body.rate + 2, body.roll];
    (0..vehicle.state_count()).map(|k| if changed.contains(&k) { -1.0 } else { 1.0 }).collect()
}

/// Sticks of the mirrored flight.
#[must_use]
pub fn mirror_sticks(mut sticks: [f64; STICKS.len()]) -> [f64; STICKS.len()] {
    for stick in MIRRORED_STICKS {
        sticks[stick] = -sticks[stick];
    }
    sticks
}
