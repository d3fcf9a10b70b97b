//! Multicopters with commanded rotor speeds: hover, control rows and drag of the
//! Hummingbird and the Firefly (RotorS), against what their coefficients say; four
//! coaxial pairs that work in one another's wakes.

mod common;

use coaxdesign::linear::StateSpace;
use coaxdesign::linear::linearize::linearize;
use coaxdesign::trim::{FlightCondition, Options};
use coaxdesign::vehicle::{Layout, Vehicle};
use common::{problem, rates, trimmed, vehicle};

/// Hover speed of every rotor, and the averaged model.
fn hover(vehicle: &Vehicle) -> (Vec<f64>, StateSpace) {
    let point = trimmed(vehicle, FlightCondition::level(0.0), &Options::default());
    let speeds = vehicle
        .layout
        .rotors
        .iter()
        .map(|places| point.mean_state[places.speed.unwrap()])
        .collect();
    let trim = point.into_converged().unwrap();
    let model = linearize(vehicle, &trim, &Default::default()).unwrap().model.averaged();
    (speeds, model)
}

fn close(value: f64, expected: f64, tolerance: f64, what: &str) {
    let error = (value - expected).abs();
    assert!(error < tolerance, "{what}: {value}, expected {expected}");
}

/// A specification of the tree, an aircraft and the channels that its flight must
/// hold, by the largest error against the law's references.
fn designed(name: &str, specification: &str) {
    use coaxdesign::pipeline::{
        FlightPlan, PipelineError, Requirements, Silent, TuneOptions, fly, tune,
    };
    use coaxdesign::simulate::{Status, maneuver};
    let path = format!("{}/problems/{specification}", env!("CARGO_MANIFEST_DIR"));
    let requirements = Requirements::load(std::path::Path::new(&path)).unwrap();
    let aircraft = coaxdesign::problem::builtin_named(name).unwrap();
    let tuned = tune(&aircraft, &requirements, &TuneOptions::default(), &Silent).unwrap();
    assert!(tuned.verified.met(), "{name}");
    assert!(tuned.schedule.requirements_met, "{name}");
    for check in &tuned.verified.authority {
        assert!(check.passed, "{name}: {check:?}");
    }
    let flown = maneuver::builtin("dash-climb-turn").unwrap().unwrap();
    let plan = FlightPlan::new(flown, Some(&tuned.schedule)).unwrap();
    let mut rows = 0;
    let flight = fly(
        &aircraft.problem,
        Some(&tuned.schedule),
        &plan,
        &Silent,
        |_, row| -> Result<(), PipelineError> {
            rows += 1;
            assert!(row.iter().all(|value| value.is_finite()), "{name}: row {rows}");
            Ok(())
        },
    )
    .unwrap();
    assert_eq!(flight.status, Status::Completed, "{name}");
    for track in &flight.metrics.tracking {
        // m/s, rad and rad/s alike.
        assert!(track.size.peak < 0.5, "{name}: {track:?}");
    }
}

/// The whole way for each multicopter: tuned and verified, all steps within what
/// its rotors can do, flown through a manoeuvre.
#[test]
fn multicopters_are_designed_and_flown() {
    designed("hummingbird", "hq-multicopter.toml");
    designed("firefly", "hq-multicopter.toml");
    designed("octo-x8", "hq-octo-x8.toml");
}

/// (rotor, ṗ, q̇, ṙ per rad/s): `aircraft.md` derives them from mass, arms and
/// coefficients.
type Rows = [(&'static str, f64, f64, f64)];

fn assert_rows(name: &str, speed: f64, heave: f64, drag: f64, rows: &Rows) {
    let vehicle = vehicle(&problem(name));
    assert!(vehicle.is_steady());
    let (speeds, model) = hover(&vehicle);
    for found in speeds {
        assert!((found / speed - 1.0).abs() < 1e-3, "{name}: {found} rad/s");
    }
    let state = |name: &str| vehicle.layout.state(name).unwrap();
    let a = model.a();
    let mut all = 0.0;
    for (rotor, roll, pitch, yaw) in rows {
        let omega = state(&format!("{rotor}.omega"));
        let label = |axis: &str| format!("{name}, {rotor}: {axis}");
        close(a[(state("p"), omega)], *roll, 2e-4, &label("p"));
        close(a[(state("q"), omega)], *pitch, 2e-4, &label("q"));
        close(a[(state("r"), omega)], *yaw, 2e-5, &label("r"));
        all -= a[(state("w"), omega)];
        close(a[(omega, omega)], -80.0, 1e-6, "motor");
    }
    close(all, heave * rows.len() as f64 / rows.len() as f64, 1e-4, "heave");
    close(a[(state("u"), state("u"))], drag, 2e-3, "X_u");
    close(a[(state("v"), state("v"))], drag, 2e-3, "Y_v");
}

#[test]
fn val_hummingbird_hover_and_control_rows() {
    let rows = [
        ("front", 0.0, 0.1882, -0.01033),
        ("left", 0.1882, 0.0, 0.01033),
        ("back", 0.0, -0.1882, -0.01033),
        ("right", -0.1882, 0.0, 0.01033),
    ];
    assert_rows("hummingbird", 453.15, 0.04328, -0.204, &rows);
}

#[test]
fn val_firefly_hover_and_control_rows() {
    let rows = [
        ("front_left", 0.0286, 0.0375, 0.00151),
        ("left", 0.0572, 0.0, -0.00151),
        ("back_left", 0.0286, -0.0375, 0.00151),
        ("back_right", -0.0286, -0.0375, -0.00151),
        ("right", -0.0572, 0.0, 0.00151),
        ("front_right", -0.0286, 0.0375, -0.00151),
    ];
    assert_rows("firefly", 540.86, 0.03626, -0.171, &rows);
}

/// The published inertia of the Firefly breaks the triangle inequality: a
/// warning that says so with the figures, not an error.
#[test]
fn an_impossible_inertia_is_a_warning() {
    let loaded = coaxdesign::problem::builtin_named("firefly").unwrap();
    let warning = loaded.warnings.iter().find(|warning| warning.key == "mass").unwrap();
    assert!(warning.message.contains("no body has this inertia"), "{}", warning.message);
    assert!(warning.message.contains("principal moments"), "{}", warning.message);
}

/// Level flight against the rotors' drag alone: tan(−θ) = |X_u| V/g.
#[test]
fn val_pitch_attitude_in_level_flight() {
    for (name, degrees) in [("firefly", -4.98), ("hummingbird", -5.94)] {
        let vehicle = vehicle(&problem(name));
        let point = trimmed(&vehicle, FlightCondition::level(5.0), &Options::default());
        let pitch = point.mean_state[Layout::BODY.pitch].to_degrees();
        close(pitch, degrees, 0.03, name);
        assert!(point.power.imbalance().abs() < 1.0, "{}", point.power.imbalance());
    }
}

/// Eight rotors on four shafts lie in eight ways: over and under one another, and
/// beside, above and below at the side and the diagonal of the square. Tables are
/// built for these and not for 56 pairs, and a rotor more in a row adds two.
#[test]
fn tables_of_interference_go_with_the_ways_in_which_rotors_lie() {
    let mut x8 = problem("octo-x8");
    assert_eq!(vehicle(&x8).interference_tables(), 2);
    x8.inflow.reach = 1000.0;
    assert_eq!(vehicle(&x8).interference_tables(), 8);
    let row = |count: usize| {
        let mut p = x8.clone();
        p.rotors.truncate(count);
        p.controls.mix.truncate(count);
        p.controls.collective_limits.truncate(count);
        p.controls.cyclic_limits.truncate(count);
        p.controls.speed_limits.truncate(count);
        for (k, rotor) in p.rotors.iter_mut().enumerate() {
            rotor.hub.fuselage_station = 0.4 * k as f64;
            rotor.hub.butt_line = 0.0;
            rotor.hub.water_line = 0.0;
        }
        vehicle(&p).interference_tables()
    };
    // Rotors in a line see each other at count − 1 distances, ahead or behind alike.
    assert_eq!([2, 3, 6].map(row), [1, 2, 5]);
}

/// Interference has an answer in any flight: forward, sideward and rearward, up
/// and down, fast and slow.
#[test]
fn wakes_of_eight_rotors_are_finite_in_any_flight() {
    let mut problem = problem("octo-x8");
    problem.inflow.reach = 1000.0;
    let vehicle = vehicle(&problem);
    let point = trimmed(&vehicle, FlightCondition::level(0.0), &Options::default());
    let mut effectors = vec![0.0; vehicle.effector_count()];
    vehicle.mix(&point.sticks, &mut effectors);
    for k in 0..60 {
        let angle = 2.399963 * f64::from(k);
        let mut state = point.mean_state.clone();
        state[0] = 0.5 * f64::from(k) * angle.cos();
        state[1] = 0.5 * f64::from(k) * angle.sin();
        state[2] = 8.0 * (1.7 * angle).sin();
        let all = rates(&vehicle, 0.0, &state, &effectors, [0.0; 3]);
        assert!(all.iter().all(|rate| rate.is_finite()), "{k}: {all:?}");
    }
}

/// The lower rotor of a pair works in the wake of the upper one: at one speed it
/// carries less, and the aircraft needs more power than with its rotors apart.
/// Every speed trims and has modes: eight rotors alike repeat eigenvalues.
#[test]
fn an_x8_trims_and_linearises() {
    let problem = problem("octo-x8");
    let vehicle = vehicle(&problem);
    let apart = vehicle.with_interactions(false).unwrap();
    let hover = trimmed(&vehicle, FlightCondition::level(0.0), &Options::default());
    let alone = trimmed(&apart, FlightCondition::level(0.0), &Options::default());
    let thrust = |name: &str| {
        let index = vehicle.rotors.iter().position(|rotor| rotor.name == name).unwrap();
        hover.rotors[index].thrust
    };
    let share = thrust("front_left_lower") / thrust("front_left_upper");
    assert!((0.4..0.8).contains(&share), "{share}");
    let more = hover.power.shaft / alone.power.shaft;
    assert!((1.2..1.6).contains(&more), "{more}");
    for speed in [0.0, 4.0, 8.0, 10.0] {
        let point = trimmed(&vehicle, FlightCondition::level(speed), &Options::default());
        assert!(point.margins.iter().all(|margin| margin.fraction() > 0.05), "{speed}");
        let trim = point.into_converged().unwrap();
        let model = linearize(&vehicle, &trim, &Default::default()).unwrap().model.averaged();
        assert!(model.a().iter().chain(model.b().iter()).all(|entry| entry.is_finite()));
        let modes = coaxdesign::linear::dense::eigen(model.a()).unwrap();
        assert!(modes.values.iter().all(|value| value.is_finite()));
    }
}
