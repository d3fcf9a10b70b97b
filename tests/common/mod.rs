//! What the tests of the vehicle and of trim share.

// Each test file uses its own part of this.
#![allow(dead_code)]

use coaxdesign::problem::{
    Airfoil, FuselageTable, HubKind, Polar, Problem, Spanwise, WingModel, builtin_named,
};
use coaxdesign::trim::{FlightCondition, Options, TrimPoint, sweep};
use coaxdesign::vehicle::{Layout, Vehicle};

#[allow(unused_imports)]
pub use coaxdesign::validation::{mirror_signs, mirror_sticks, mirrored};

/// One knot, m/s.
pub const KNOT: f64 = coaxdesign::units::KNOT;

/// A built-in problem.
pub fn problem(name: &str) -> Problem {
    builtin_named(name).unwrap_or_else(|report| panic!("{name}: {report:?}")).problem
}

/// The vehicle of a problem.
pub fn vehicle(problem: &Problem) -> Vehicle {
    Vehicle::new(problem).unwrap_or_else(|error| panic!("{}: {error}", problem.name))
}

/// Fewer blade elements: for identities that do not depend on their number.
pub fn coarsened(mut problem: Problem) -> Problem {
    for rotor in &mut problem.rotors {
        rotor.elements = 6;
    }
    for wing in &mut problem.wings {
        if let WingModel::Elements { elements, .. } = &mut wing.model {
            *elements = 4;
        }
    }
    problem
}

/// Rates in plain numbers.
#[inline(never)]
pub fn rates(
    vehicle: &Vehicle,
    azimuth: f64,
    state: &[f64],
    effectors: &[f64],
    wind_body: [f64; 3],
) -> Vec<f64> {
    let mut work = vehicle.workspace::<f64>();
    let mut rates = vec![0.0; vehicle.state_count()];
    vehicle.rates(azimuth, state, effectors, wind_body, &mut work, &mut rates);
    rates
}

/// A flight with nothing zero and nothing symmetric: state and blade controls.
pub fn lively(vehicle: &Vehicle) -> (Vec<f64>, Vec<f64>) {
    let mut state = vec![0.0; vehicle.state_count()];
    let mut effectors = vec![0.0; vehicle.effector_count()];
    state[..Layout::BODY.count].copy_from_slice(&[21.0, 1.7, 1.3, 0.11, -0.07, 0.13, 0.05, -0.06]);
    for (k, (rotor, places)) in vehicle.rotors.iter().zip(&vehicle.layout.rotors).enumerate() {
        // Each rotor does something else.
        let vary = 1.0 + 0.3 * k as f64;
        let mut put = |start: usize, values: &[f64]| {
            for (slot, value) in state[start..].iter_mut().zip(values) {
                *slot = value * vary;
            }
        };
        if let Some(start) = places.flapping {
            put(start, &[0.021, -0.013]);
        }
        let [start, angles, rates] = places.flap;
        if rates > 0 {
            put(start, &[0.03, 0.021, -0.013, 0.008, -0.005][..angles.min(5)]);
            put(start + angles, &[0.2, -0.3, 0.4, 0.1, -0.2][..rates.min(5)]);
        }
        if let Some(start) = places.self_inflow {
            put(start, &[0.023, 0.007, -0.004]);
        }
        if let Some(start) = places.total_inflow {
            put(start, &[0.037, 0.009, -0.003]);
        }
        if let Some(start) = places.speed {
            state[start] = rotor.speed + 0.7 * vary;
        }
        if let Some(place) = places.azimuth {
            state[place] = 0.17 * vary;
        }
        if let Some(at) = places.pitch {
            effectors[at..at + 3].copy_from_slice(&[0.16 * vary, 0.011 * vary, -0.019 * vary]);
        }
        if let Some(place) = places.command {
            effectors[place] = rotor.speed + 1.3;
        }
    }
    (state, effectors)
}

/// Trims at one condition from nothing; it must converge.
pub fn trimmed(vehicle: &Vehicle, condition: FlightCondition, options: &Options) -> TrimPoint {
    let mut points = sweep(vehicle, &[condition], options, |_| {}).points;
    let point = points.pop().unwrap();
    assert!(point.on_orbit(), "{}: {condition:?}: {:?}", vehicle.name, point.status);
    point
}

/// A made-up fuselage table, different in every load.
pub fn fuselage_table() -> FuselageTable {
    let angle_of_attack: Vec<f64> = (-4..=4).map(|k| 0.25 * f64::from(k)).collect();
    let sideslip: Vec<f64> = vec![-1.2, -0.5, -0.2, 0.1, 0.35, 0.9];
    let loads = [0, 1, 2, 3, 4, 5].map(|k| {
        let k = f64::from(k);
        angle_of_attack
            .iter()
            .flat_map(|&a| {
                sideslip.iter().map(move |&b| {
                    0.4 * (k + 1.0).sin() + (0.3 + 0.1 * k) * (a * (1.0 + 0.2 * k)).sin()
                        - 0.5 * (b * (1.3 - 0.1 * k)).sin()
                        + 0.2 * a * b
                })
            })
            .collect()
    });
    FuselageTable { angle_of_attack, sideslip, loads }
}

/// One value along the whole span.
pub fn constant(value: f64) -> Spanwise {
    Spanwise { station: vec![0.0], value: vec![value] }
}

/// Linear lift and constant drag.
pub fn analytic(lift_slope: f64, drag: f64) -> Airfoil {
    Airfoil::Analytic {
        lift_slope,
        zero_lift_angle: 0.0,
        drag,
        polar: Polar::default(),
        small_angles: false,
    }
}

/// Linear lift and constant drag by Eqs. 35.
pub fn small_angles(lift_slope: f64, drag: f64) -> Airfoil {
    Airfoil::Analytic {
        lift_slope,
        zero_lift_angle: 0.0,
        drag,
        polar: Polar::default(),
        small_angles: true,
    }
}

/// The problem's rotors with blades that flap each about a hinge of its own.
pub fn articulated(mut problem: Problem, blades: usize) -> Problem {
    for rotor in &mut problem.rotors {
        rotor.hub_kind = HubKind::Articulated {
            hinge_offset: 0.15,
            spring: 400.0,
            damping: 30.0,
            delta_3: -0.2,
        };
        rotor.blades = blades;
        rotor.blade_mass *= 2.0 / blades as f64;
        rotor.root_cutout = 0.12;
    }
    problem
}

/// The problem's rotors on gimbals.
pub fn gimballed(mut problem: Problem, blades: usize) -> Problem {
    for rotor in &mut problem.rotors {
        rotor.hub_kind =
            HubKind::Gimballed { undersling: 0.06, spring: 800.0, damping: 25.0, delta_3: 0.2 };
        rotor.blades = blades;
        rotor.root_cutout = 0.12;
    }
    problem
}

/// Blades that sweep through the problem's rotors with three blades, held
/// rigidly.
pub fn rigid_three_blades(mut problem: Problem) -> Problem {
    for rotor in &mut problem.rotors {
        rotor.hub_kind = HubKind::Rigid;
        rotor.blades = 3;
    }
    problem
}
