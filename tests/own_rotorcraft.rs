//! A rotorcraft that is not the CoAX 2D: the conventional helicopter of
//! `examples/`.

use coaxdesign::problem::{self, Problem};
use coaxdesign::trim::{FlightCondition, Options, TrimPoint, sweep};
use coaxdesign::units::{FOOT, KNOT, STANDARD_GRAVITY};
use coaxdesign::vehicle::{Layout, Vehicle};

fn flown() -> (Problem, Vec<TrimPoint>) {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/light-helicopter.toml");
    let loaded = problem::load(path).unwrap_or_else(|report| panic!("{report}"));
    assert!(loaded.warnings.is_empty());
    let vehicle = Vehicle::new(&loaded.problem).unwrap();
    let conditions = [0.0, 60.0].map(|knots| FlightCondition::level(knots * KNOT));
    let points = sweep(&vehicle, &conditions, &Options::default(), |_| {}).points;
    assert!(points.iter().all(TrimPoint::on_orbit));
    (loaded.problem, points)
}

/// What a conventional helicopter does, from the balance of forces and moments.
#[test]
fn a_conventional_helicopter_trims_as_one_does() {
    let (problem, points) = flown();
    let weight = problem.mass.mass * STANDARD_GRAVITY;
    let hover = &points[0];
    let [main, tail] = [&hover.rotors[0], &hover.rotors[1]];
    // The main rotor carries the weight and the download.
    assert!(main.thrust > weight && main.thrust < 1.05 * weight, "{}", main.thrust);
    // The tail rotor balances the torque: arm 14.8 ft about the centre of gravity.
    let arm = 14.8 * FOOT;
    assert!((tail.thrust * arm / main.torque - 1.0).abs() < 0.03, "{}", tail.thrust * arm);
    // It pushes to starboard, and the helicopter hangs to port against it.
    let bank = hover.mean_state[Layout::BODY.roll];
    assert!((-4f64.to_radians()..-0.5f64.to_radians()).contains(&bank), "{bank}");
    // Momentum theory is the least that hover can cost; a figure of merit of
    // the main rotor between 0.6 and 0.8 is what such rotors have.
    let radius = problem.rotors[0].radius;
    let density = 1.225;
    let disk = std::f64::consts::PI * radius * radius;
    let ideal = main.thrust.powf(1.5) / (2.0 * density * disk).sqrt();
    let merit = ideal / main.power;
    assert!((0.6..0.8).contains(&merit), "{merit}");
    // Forward flight is cheaper than hover, and its nose is lower.
    assert!(points[1].power.shaft < 0.8 * hover.power.shaft);
    let pitch = |p: &TrimPoint| p.mean_state[Layout::BODY.pitch];
    assert!(pitch(&points[1]) < pitch(hover));
    // Energy is accounted for.
    assert!(hover.power.imbalance().abs() < 1e-5, "{}", hover.power.imbalance());
}
