//! The committed design, flown on the full nonlinear vehicle.
//!
//! The design may be made anew, so these tests hold it to what a flight must
//! show, and to no number of the present one.

use coaxdesign::problem::builtin_named;
use coaxdesign::schedule::Schedule;
use coaxdesign::simulate::flight::Autopilot;
use coaxdesign::simulate::maneuver::{self, Maneuver};
use coaxdesign::simulate::metrics::Meter;
use coaxdesign::simulate::{Flight, Metrics, Options, Recorder, Status};
use coaxdesign::trim::{ConvergedTrim, Options as TrimOptions, sweep};
use coaxdesign::units::KNOT;
use coaxdesign::vehicle::Vehicle;
use std::sync::LazyLock;

static VEHICLE: LazyLock<Vehicle> =
    LazyLock::new(|| Vehicle::new(&builtin_named("coax2d").unwrap().problem).unwrap());

static DESIGN: LazyLock<Schedule> = LazyLock::new(|| {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/designs/coax2d/schedule.json");
    Schedule::from_json(&std::fs::read_to_string(path).unwrap()).unwrap()
});

fn autopilot() -> Autopilot {
    Autopilot { table: DESIGN.law().unwrap(), stick_limits: DESIGN.stick_limits }
}

fn options() -> Options {
    let specification = coaxdesign::control::spec::builtin().unwrap();
    Options::new(DESIGN.hardware, specification.pitch_rate_limit)
}

fn builtin(name: &str) -> Maneuver {
    maneuver::builtin(name).unwrap().unwrap()
}

fn start(vehicle: &Vehicle, maneuver: &Maneuver) -> ConvergedTrim {
    let conditions = [maneuver.start.condition];
    let mut found = sweep(vehicle, &conditions, &TrimOptions::default(), |_| {});
    found.points.pop().unwrap().into_converged().unwrap()
}

/// Flies, checks that every recorded number is finite, and sums up.
fn fly(vehicle: &Vehicle, law: &Autopilot, maneuver: &Maneuver) -> (Status, Metrics) {
    let start = start(vehicle, maneuver);
    let mut flight = Flight::new(vehicle, &start, Some(law), maneuver, &options()).unwrap();
    let mut recorder = Recorder::new(&flight);
    let mut meter = Meter::new(&flight);
    let status = flight.fly(|flight| {
        meter.see(flight);
        assert!(recorder.row(flight).iter().all(|x| x.is_finite()));
    });
    (status.clone(), meter.finish(&flight, &status))
}

fn knots(metrics: &Metrics, channel: &str) -> (f64, f64) {
    let size = metrics.tracked(channel).unwrap().size;
    (size.rms / KNOT, size.peak / KNOT)
}

fn degrees(metrics: &Metrics, channel: &str) -> f64 {
    metrics.tracked(channel).unwrap().size.peak.to_degrees()
}

/// Acceleration and deceleration through turn coordination, both ways: the
/// velocities stay within the bounds set for the paper's manoeuvre, and neither
/// sticks nor actuators jump.
#[test]
fn turn_coordination_is_crossed_both_ways_without_a_jump() {
    let (status, metrics) = fly(&VEHICLE, &autopilot(), &builtin("accel-decel"));
    assert_eq!(status, Status::Completed);
    let (rms, peak) = knots(&metrics, "forward_velocity");
    assert!(rms < 1.0 && peak < 3.0, "{rms} {peak} kt");
    let (rms, peak) = knots(&metrics, "right_velocity");
    assert!(rms < 1.0 && peak < 3.0, "{rms} {peak} kt");
    assert!(degrees(&metrics, "phi") < 2.0);
    assert!(degrees(&metrics, "theta") < 2.0);
    assert_eq!(metrics.saturated_s, 0.0);
    // A jump would be a step of stick in one period of 10 ms.
    assert!(metrics.stick_jump_percent.iter().all(|jump| *jump < 1.0));
}

/// The paper's manoeuvre: flown to its end without a limit, at the heading rate
/// it asks for, pitch on its reference. With the interactions off that the law
/// was designed with it is flown as well.
#[test]
fn val_paper_maneuver_is_flown() {
    let (status, metrics) = fly(&VEHICLE, &autopilot(), &builtin("accel-climb-turn"));
    assert_eq!(status, Status::Completed);
    assert_eq!(metrics.saturated_s, 0.0);
    let rate = metrics.steady_turn_rate_error_rad_s.unwrap();
    assert!(rate < 0.01, "{rate} rad/s");
    assert!(degrees(&metrics, "theta") < 2.0);
    assert!(metrics.stick_jump_percent.iter().all(|jump| *jump < 1.0));
    let plain = VEHICLE.with_interactions(false).unwrap();
    let (status, metrics) = fly(&plain, &autopilot(), &builtin("accel-climb-turn"));
    assert_eq!(status, Status::Completed);
    assert_eq!(metrics.saturated_s, 0.0);
}

/// In hover the off-axis responses of a turn in place and of a climb are
/// small.
#[test]
fn hover_turn_and_climb_stay_where_they_are() {
    for name in ["hover-turn", "vertical"] {
        let (status, metrics) = fly(&VEHICLE, &autopilot(), &builtin(name));
        assert_eq!(status, Status::Completed, "{name}");
        for channel in ["forward_velocity", "right_velocity"] {
            let (rms, _) = knots(&metrics, channel);
            assert!(rms < 1.0, "{name}: {channel} {rms} kt");
        }
        assert_eq!(metrics.saturated_s, 0.0);
    }
}

/// With the signs of its roll gains turned round the law drives the aircraft
/// away. That is reported, with the state and the time, and nothing that is not
/// finite is seen on the way.
#[test]
fn a_bad_schedule_diverges_and_says_so() {
    let mut bad = DESIGN.clone();
    for point in &mut bad.points {
        let roll = point.gains.get_mut("roll").unwrap();
        (roll.k_d, roll.k_p, roll.k_i) = (-roll.k_d, -roll.k_p, -roll.k_i);
    }
    let law = Autopilot { table: bad.law().unwrap(), stick_limits: bad.stick_limits };
    let (status, metrics) = fly(&VEHICLE, &law, &builtin("sidestep"));
    let Status::Diverged(departure) = status else { panic!("{status:?}") };
    assert!(departure.time > 0.0 && departure.time < 50.0, "{departure:?}");
    assert_eq!(metrics.end.status, "diverged");
    assert_eq!(metrics.end.state.as_deref(), Some(departure.state.as_str()));
}

/// A small bank command is answered as the linear closed loop predicts: what
/// the command model asks for, delayed, within five per cent of RMS.
#[test]
fn small_steps_follow_the_linear_prediction() {
    for (axis, channel) in [("roll", "phi"), ("pitch", "theta")] {
        let text = format!(
            "title = \"step\"\nduration = \"5 s\"\nmode = \"attitude\"\n[start]\n\
             airspeed = \"20 kt\"\n[commands.{axis}]\ntime = [\"0.5 s\", \"0.5 s\"]\n\
             value = [\"0 deg\", \"1 deg\"]\n"
        );
        let (status, metrics) =
            fly(&VEHICLE, &autopilot(), &maneuver::parse("step", &text).unwrap());
        assert_eq!(status, Status::Completed);
        let error = metrics.tracked(channel).unwrap().size.rms.to_degrees();
        assert!(error < 0.05, "{axis}: {error} deg of 1 deg");
    }
}

/// Switched on in trimmed flight that is not its own (the interactions it was
/// designed with are off), the law begins without a transient.
#[test]
fn law_engages_without_a_transient_in_another_model() {
    let other = VEHICLE.with_interactions(false).unwrap();
    let text = "title = \"hold\"\nduration = \"2 s\"\nmode = \"velocity\"\n[start]\n\
                airspeed = \"30 kt\"\n";
    let (status, metrics) = fly(&other, &autopilot(), &maneuver::parse("hold", text).unwrap());
    assert_eq!(status, Status::Completed);
    for channel in ["forward_velocity", "right_velocity", "climb_rate"] {
        let (_, peak) = knots(&metrics, channel);
        assert!(peak < 0.1, "{channel}: {peak} kt");
    }
    assert!(degrees(&metrics, "theta") < 0.1);
}
