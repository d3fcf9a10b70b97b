//! Every manoeuvre of `problems/maneuvers`, flown as its file says.

use std::collections::BTreeSet;
use std::path::Path;

use coaxdesign::problem::builtin_named;
use coaxdesign::schedule::Schedule;
use coaxdesign::simulate::flight::{Autopilot, FlightError};
use coaxdesign::simulate::maneuver::{self, BUILTIN, Maneuver, Mode};
use coaxdesign::simulate::metrics::Meter;
use coaxdesign::simulate::montecarlo::Variation;
use coaxdesign::simulate::{Flight, Metrics, Options, Recorder, Status};
use coaxdesign::trim::{Options as TrimOptions, sweep};
use coaxdesign::vehicle::Vehicle;

fn design() -> Schedule {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/designs/coax2d/schedule.json");
    Schedule::from_json(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// The vehicle of a manoeuvre: where the engine fails, with governors.
fn vehicle(maneuver: &Maneuver) -> Vehicle {
    let governor = maneuver.engine_out.map(|_| 1.0);
    let variation = Variation { governor, ..Variation::default() };
    variation.vehicle(&builtin_named("coax2d").unwrap().problem).unwrap()
}

/// Flies, and checks that every recorded number is finite.
fn fly(vehicle: &Vehicle, maneuver: &Maneuver) -> (Status, Metrics, Vec<f64>) {
    let design = design();
    let specification = coaxdesign::control::spec::builtin().unwrap();
    let options = Options::new(design.hardware, specification.pitch_rate_limit);
    let law = Autopilot { table: design.law().unwrap(), stick_limits: design.stick_limits };
    let law = (maneuver.mode != Mode::OpenLoop).then_some(&law);
    let conditions = [maneuver.start.condition];
    let mut found = sweep(vehicle, &conditions, &TrimOptions::default(), |_| {});
    let start = found.points.pop().unwrap().into_converged().unwrap();
    let mut flight = Flight::new(vehicle, &start, law, maneuver, &options).unwrap();
    let mut recorder = Recorder::new(&flight);
    let mut meter = Meter::new(&flight);
    let speed = recorder.column("upper.omega");
    let mut speeds = Vec::new();
    let status = flight.fly(|flight| {
        meter.see(flight);
        let row = recorder.row(flight);
        assert!(row.iter().all(|x| x.is_finite()));
        speeds.extend(speed.map(|place| row[place]));
    });
    (status.clone(), meter.finish(&flight, &status), speeds)
}

/// The folder holds the built-in manoeuvres and no others.
#[test]
fn every_file_is_built_in() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("problems/maneuvers");
    let files: BTreeSet<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path().file_stem().unwrap().to_str().unwrap().to_owned())
        .collect();
    let known: BTreeSet<String> = BUILTIN.iter().map(|(name, _)| (*name).to_owned()).collect();
    assert_eq!(files, known);
}

/// All are flown to their ends; those under the law without an actuator at a
/// limit and with velocities near their references.
#[test]
fn every_maneuver_is_flown_to_its_end() {
    for (name, _) in BUILTIN {
        let maneuver = maneuver::builtin(name).unwrap().unwrap();
        let (status, metrics, speeds) = fly(&vehicle(&maneuver), &maneuver);
        assert_eq!(status, Status::Completed, "{name}");
        if maneuver.mode != Mode::OpenLoop {
            assert_eq!(metrics.saturated_s, 0.0, "{name}");
        }
        // Without an engine, pitch has a fifth of its power and waits.
        let most = if maneuver.engine_out.is_some() { [20.0, 8.0] } else { [5.0, 5.0] };
        for (channel, most) in ["forward_velocity", "right_velocity"].into_iter().zip(most) {
            if let Some(tracking) = metrics.tracked(channel) {
                let knots = tracking.size.peak / coaxdesign::units::KNOT;
                assert!(knots < most, "{name}: {channel} {knots} kt");
            }
        }
        if let Some(time) = maneuver.engine_out {
            // Until then nothing happens; then the rotors slow down, and the
            // descent keeps them turning.
            let nominal = speeds[0];
            let before = (time * 100.0) as usize;
            assert!(speeds[..before].iter().all(|s| (s / nominal - 1.0).abs() < 1e-6));
            let range = |speeds: &[f64]| {
                speeds.iter().fold([f64::INFINITY, 0.0_f64], |[a, b], s| [a.min(*s), b.max(*s)])
            };
            let [least, most] = range(&speeds);
            assert!(least < 0.8 * nominal && least > 0.65 * nominal, "{least} rad/s");
            assert!(most < 1.15 * nominal, "{most} rad/s");
            // Fifteen seconds in which the air alone keeps them turning.
            let [least, most] = range(&speeds[1300..2800]);
            assert!(least > 0.8 * nominal && most < 1.05 * nominal, "{least} to {most} rad/s");
            // The flare makes rotor speed of ground speed.
            assert!(range(&speeds[2800..])[1] > range(&speeds[2700..2800])[1] + 2.0);
        }
    }
}

/// The turn in place does not need the rotors to interact: the law is designed
/// with them interacting, and the pedals have half the power without.
#[test]
fn hover_turn_is_flown_without_interactions() {
    let maneuver = maneuver::builtin("hover-turn").unwrap().unwrap();
    let apart = vehicle(&maneuver).with_interactions(false).unwrap();
    let (status, metrics, _) = fly(&apart, &maneuver);
    assert_eq!(status, Status::Completed);
    assert_eq!(metrics.saturated_s, 0.0);
    for channel in ["forward_velocity", "right_velocity"] {
        let knots = metrics.tracked(channel).unwrap().size.peak / coaxdesign::units::KNOT;
        assert!(knots < 3.0, "{channel} {knots} kt");
    }
}

/// Right after the engine has failed the rotors lose what they put into the
/// air: J Ω' = −Q, from the power of level flight.
#[test]
fn coasting_rotors_lose_the_power_of_level_flight() {
    let mut maneuver = maneuver::builtin("engine-out").unwrap().unwrap();
    maneuver.engine_out = Some(0.0);
    maneuver.duration = 0.5;
    let vehicle = vehicle(&maneuver);
    let (_, _, speeds) = fly(&vehicle, &maneuver);
    let powered = Maneuver { engine_out: None, ..maneuver };
    let (_, metrics, _) = fly(&vehicle, &powered);
    // Mean over whole half revolutions, so that 2/rev cancels: 0.132 s each.
    let half = (std::f64::consts::PI / vehicle.reference_speed * 100.0).round() as usize;
    let inertia: f64 = {
        let problem = builtin_named("coax2d").unwrap().problem;
        problem.rotors.iter().map(|r| r.blades as f64 * r.blade_second_moment).sum()
    };
    let lost = (speeds[0] - speeds[half]) / (half as f64 * 0.01);
    let expected = metrics.power.unwrap().mean_w / (vehicle.reference_speed * inertia);
    assert!((lost / expected - 1.0).abs() < 0.15, "{lost} rad/s², expected {expected}");
}

/// Without governors the rotors cannot slow down, and that is said.
#[test]
fn an_engine_cannot_fail_where_rotor_speeds_are_held() {
    let maneuver = maneuver::builtin("engine-out").unwrap().unwrap();
    let vehicle = Vehicle::new(&builtin_named("coax2d").unwrap().problem).unwrap();
    let conditions = [maneuver.start.condition];
    let mut found = sweep(&vehicle, &conditions, &TrimOptions::default(), |_| {});
    let start = found.points.pop().unwrap().into_converged().unwrap();
    let design = design();
    let law = Autopilot { table: design.law().unwrap(), stick_limits: design.stick_limits };
    let options = Options::new(design.hardware, 1.0);
    let refused = Flight::new(&vehicle, &start, Some(&law), &maneuver, &options);
    assert_eq!(refused.err(), Some(FlightError::NoRotorSpeed));
}
