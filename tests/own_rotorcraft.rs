//! A rotorcraft that is not the CoAX 2D: the conventional helicopter of
//! `examples/`.

mod common;

use coaxdesign::linear::linearize::linearize;
use coaxdesign::problem::{self, AzimuthModel, HubKind, Problem};
use coaxdesign::trim::{FlightCondition, Options, TrimPoint, sweep};
use coaxdesign::units::{FOOT, KNOT, STANDARD_GRAVITY};
use coaxdesign::vehicle::{Layout, Vehicle};

fn light_helicopter() -> Problem {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/light-helicopter.toml");
    let loaded = problem::load(path).unwrap_or_else(|report| panic!("{report}"));
    assert!(loaded.warnings.is_empty());
    loaded.problem
}

fn flown() -> (Problem, Vec<TrimPoint>) {
    let problem = light_helicopter();
    let vehicle = Vehicle::new(&problem).unwrap();
    let conditions = [0.0, 60.0].map(|knots| FlightCondition::level(knots * KNOT));
    let points = sweep(&vehicle, &conditions, &Options::default(), |_| {}).points;
    assert!(points.iter().all(TrimPoint::on_orbit));
    (problem, points)
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

/// The same helicopter with its tail rotor at a speed that stands in no simple
/// ratio to the main rotor's: 394 and 2550 rpm.
fn at_odd_speeds() -> Problem {
    let mut problem = light_helicopter();
    problem.rotors[0].speed = 41.26;
    problem.rotors[1].speed = 267.04;
    // As much thrust as before from rotors that turn slower.
    for rotor in &mut problem.rotors {
        for chord in &mut rotor.chord.value {
            *chord *= 1.6;
        }
    }
    problem
}

/// A tail rotor of any speed is averaged, each rotor turns at its own speed, and
/// the helicopter trims and has a linear model with the period of its main rotor.
#[test]
fn speeds_without_a_common_period_trim_and_linearise() {
    let problem = at_odd_speeds();
    let vehicle = Vehicle::new(&problem).unwrap();
    assert!(!vehicle.rotors[0].is_averaged() && vehicle.rotors[1].is_averaged());
    assert!((vehicle.period - std::f64::consts::PI / 41.26).abs() < 1e-12);
    let conditions = [0.0, 60.0].map(|knots| FlightCondition::level(knots * KNOT));
    for point in sweep(&vehicle, &conditions, &Options::default(), |_| {}).points {
        assert!(point.on_orbit(), "{:?}", point.status);
        assert!(point.power.imbalance().abs() < 1e-4, "{}", point.power.imbalance());
        let tail = &point.rotors[1];
        assert!((tail.power / tail.torque / 267.04 - 1.0).abs() < 1e-9);
        let trim = point.into_converged().unwrap();
        let model = linearize(&vehicle, &trim, &Default::default()).unwrap().model.averaged();
        assert!(model.a().iter().all(|entry| entry.is_finite()));
    }
}

/// Averaging leaves the trim nearly alone: what the ripple of a tail rotor does
/// to the mean flight is small beside what it carries.
#[test]
fn averaging_the_tail_rotor_hardly_moves_the_trim() {
    let trims = [AzimuthModel::Resolved, AzimuthModel::Averaged].map(|azimuth| {
        let mut problem = light_helicopter();
        problem.rotors[1].azimuth = Some(azimuth);
        let vehicle = Vehicle::new(&problem).unwrap();
        let condition = [FlightCondition::level(60.0 * KNOT)];
        sweep(&vehicle, &condition, &Options::default(), |_| {}).points.remove(0)
    });
    let [resolved, averaged] = &trims;
    for k in 0..4 {
        let moved = averaged.sticks[k] - resolved.sticks[k];
        // The pedals carry the tail rotor itself.
        let most = if k == 3 { 0.5 } else { 0.05 };
        assert!(moved.abs() < most, "stick {k}: {moved} %");
    }
    let moved = averaged.mean_state[Layout::BODY.roll] - resolved.mean_state[Layout::BODY.roll];
    assert!(moved.abs().to_degrees() < 0.01, "{moved}");
}

/// A rotor averaged over its azimuth is a rotor of many blades: twelve blades
/// resolved leave no ripple that matters, and both do the same.
#[test]
fn many_blades_resolved_are_the_average() {
    let aircraft = |azimuth| {
        let mut problem = light_helicopter();
        for rotor in &mut problem.rotors {
            rotor.hub_kind = HubKind::Rigid;
            for chord in &mut rotor.chord.value {
                *chord *= rotor.blades as f64 / 12.0;
            }
            rotor.blade_mass /= 6.0;
            rotor.blade_first_moment /= 6.0;
            rotor.blade_second_moment /= 6.0;
            rotor.blades = 12;
            rotor.azimuth = Some(azimuth);
        }
        Vehicle::new(&problem).unwrap()
    };
    let resolved = aircraft(AzimuthModel::Resolved);
    let averaged = aircraft(AzimuthModel::Averaged);
    assert!(averaged.is_steady() && !resolved.is_steady());
    let (state, effectors) = common::lively(&resolved);
    let mean = common::rates(&averaged, 0.0, &state, &effectors, [0.0; 3]);
    for azimuth in [0.0, 0.1, 0.21, 0.37] {
        let rates = common::rates(&resolved, azimuth, &state, &effectors, [0.0; 3]);
        for (k, (a, b)) in rates.iter().zip(&mean).enumerate() {
            assert!((a - b).abs() < 1e-6 * b.abs().max(1.0), "rate {k} at {azimuth}: {a} {b}");
        }
    }
}
