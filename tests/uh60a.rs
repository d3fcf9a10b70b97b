//! The UH-60A against trims and derivatives of an independent run of J-GenHel's
//! equations. What these gates leave out, and why, is in
//! `docs/validation/uh60a.md`.

use coaxdesign::linear::StateSpace;
use coaxdesign::linear::linearize::linearize;
use coaxdesign::linear::reduction::residualise;
use coaxdesign::problem::builtin_named;
use coaxdesign::trim::{FlightCondition, Lateral, Options, TrimPoint, sweep};
use coaxdesign::units::{FOOT, KNOT};
use coaxdesign::vehicle::{Layout, Vehicle};

/// Trims as the targets are: without sideslip below 60 kt, without bank above.
fn trims(speeds: &[f64]) -> (Vehicle, Vec<TrimPoint>) {
    let problem = builtin_named("uh60a").unwrap().problem;
    let vehicle = Vehicle::new(&problem).unwrap();
    let condition = |&knots: &f64| FlightCondition {
        airspeed: knots * KNOT,
        lateral: if knots < 60.0 { Lateral::Sideslip(0.0) } else { Lateral::Bank(0.0) },
        ..FlightCondition::level(0.0)
    };
    let conditions: Vec<FlightCondition> = speeds.iter().map(condition).collect();
    let points = sweep(&vehicle, &conditions, &Options::default(), |_| {}).points;
    (vehicle, points)
}

/// Speed (kt), bank and pitch attitude (deg), sticks (%), root collective (deg),
/// power of both rotors (hp).
const TARGETS: [[f64; 9]; 6] = [
    [0.0, -2.42, 4.85, 51.01, 46.33, 46.45, 33.39, 17.37, 1643.0],
    [20.0, -1.87, 5.97, 45.73, 41.25, 42.54, 39.05, 16.76, 1447.0],
    [40.0, -1.15, 1.46, 43.92, 47.84, 35.30, 46.37, 15.63, 1106.0],
    [60.0, 0.0, 0.88, 46.87, 45.27, 32.55, 47.30, 15.20, 981.0],
    [80.0, 0.0, 2.94, 49.70, 35.12, 33.90, 50.86, 15.41, 1004.0],
    [100.0, 0.0, 1.53, 51.52, 33.32, 38.40, 52.71, 16.12, 1151.0],
];

#[test]
fn val_trims_from_hover_to_100_kt() {
    let (_, points) = trims(&TARGETS.map(|row| row[0]));
    for (point, target) in points.iter().zip(TARGETS) {
        let [knots, bank, pitch, lat, lon, _, ped, collective, power] = target;
        assert!(point.on_orbit(), "{knots} kt: {:?}", point.status);
        assert!(point.power.imbalance().abs() < 1e-5, "{knots} kt: energy");
        let near = |value: f64, target: f64, gate: f64, what: &str| {
            assert!((value - target).abs() <= gate, "{knots} kt, {what}: {value}, not {target}");
        };
        let attitude = |state: usize| point.mean_state[state].to_degrees();
        near(attitude(Layout::BODY.roll), bank, 0.7, "bank");
        // Our wake turns the flow at the stabilator more at 40 and 60 kt.
        let gate = if matches!(knots, 40.0 | 60.0) { 1.6 } else { 0.7 };
        near(attitude(Layout::BODY.pitch), pitch, gate, "pitch attitude");
        near(point.sticks[0], lat, 4.0, "lateral stick");
        near(point.sticks[1], lon, 4.0, "longitudinal stick");
        near(point.sticks[3], ped, 4.0, "pedals");
        // Rigid blades need less collective than the targets' elastic ones.
        near(point.rotors[0].pitch[0].to_degrees(), collective, 1.0, "collective");
        // Drag along the span is not in the model.
        let gate = if knots <= 40.0 { 0.05 } else { 0.1 };
        near(point.power.shaft / 745.7 / power, 1.0, gate, "power");
    }
}

/// The averaged model at a speed, and its eight states of the rigid body.
fn models(knots: f64) -> (StateSpace, StateSpace) {
    let (vehicle, mut points) = trims(&[knots]);
    let trim = points.remove(0).into_converged().unwrap();
    let full = linearize(&vehicle, &trim, &Default::default()).unwrap().model.averaged();
    let keep = ["u", "v", "w", "p", "q", "r", "phi", "theta"];
    let reduced = residualise(&full, &keep).unwrap().model;
    (full, reduced)
}

/// Flap-only modes of the rotor in hover: coning and reactionless, the advancing
/// flap mode.
#[test]
fn val_rotor_modes_in_hover() {
    let (full, reduced) = models(0.0);
    let found = full.a().clone().complex_eigenvalues();
    for (re, im) in [(-13.47, 21.22), (-15.15, 23.59), (-12.92, 48.45)] {
        let off = found
            .iter()
            .map(|value| (value.re - re).hypot(value.im - im))
            .fold(f64::INFINITY, f64::min);
        assert!(off < 0.1 * f64::hypot(re, im), "{re} {im}: off by {off}");
    }
    // Derivatives within their gates; per foot where a velocity is the input.
    let a = |row: usize, column: usize| reduced.a()[(row, column)];
    let gate = |value: f64, low: f64, high: f64, what: &str| {
        assert!((low..=high).contains(&value), "{what}: {value}");
    };
    gate(a(1, 1), -0.065, -0.035, "Y_v");
    gate(a(3, 1) * FOOT, -0.05, -0.02, "L_v");
    gate(a(3, 3), -7.0, -3.0, "L_p");
    gate(a(4, 4), -1.1, -0.6, "M_q");
}
