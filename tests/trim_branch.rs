//! One condition, one answer: a trim does not depend on the list that it
//! stands in, it continues level flight, and where nothing does it says where
//! the last one was.

mod common;

use coaxdesign::problem::{self, Problem};
use coaxdesign::trim::{
    Branch, FlightCondition, Lateral, Options, Status, TrimPoint, sweep, trim_at, trim_at_power,
};
use coaxdesign::vehicle::inflow::FlowState;
use coaxdesign::vehicle::{Layout, Vehicle};
use common::{KNOT, coarsened, problem, vehicle};
use std::path::Path;

/// One foot a minute, m/s.
const FOOT_PER_MINUTE: f64 = 0.3048 / 60.0;

fn from_file(path: &str) -> Problem {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    problem::load(&path).unwrap_or_else(|report| panic!("{}: {report:?}", path.display())).problem
}

fn in_phase() -> Vehicle {
    vehicle(&coarsened(from_file("problems/variants/coax2d-in-phase.toml")))
}

/// The centre of gravity moved forward, m.
fn moved(mut problem: Problem, forward: f64) -> Problem {
    problem.mass.center_of_gravity.fuselage_station -= forward;
    problem
}

/// Speeds, climbs and turns, in an order that no sweep would choose.
fn grid() -> Vec<FlightCondition> {
    let turning =
        |turn_rate: f64, condition: FlightCondition| FlightCondition { turn_rate, ..condition };
    let flight =
        |knots: f64, climb: f64| FlightCondition::climbing(knots * KNOT, climb * FOOT_PER_MINUTE);
    vec![
        flight(55.0, 400.0),
        flight(0.0, 0.0),
        flight(8.0, 300.0),
        turning(0.15, flight(40.0, 0.0)),
        flight(2.0, 300.0),
        flight(0.0, 300.0),
        turning(-0.1, flight(30.0, -200.0)),
        FlightCondition { lateral: Lateral::Bank(0.03), ..flight(20.0, 0.0) },
    ]
}

fn bits(point: &TrimPoint) -> Vec<u64> {
    point.state.iter().chain(&point.sticks).map(|value| value.to_bits()).collect()
}

/// A point alone is the point in any list, to the last bit, on every shipped
/// aircraft, with the centre of gravity as printed and moved.
#[test]
fn a_point_alone_is_the_point_in_any_list() {
    let options = Options::default();
    for (name, base, shifts) in [
        ("coax2d", problem("coax2d"), [0.0, 0.01]),
        ("coax2d-appendix", problem("coax2d-appendix"), [0.0, -0.03]),
        ("coax2d-physics", problem("coax2d-physics"), [0.0, -0.03]),
        ("in phase", from_file("problems/variants/coax2d-in-phase.toml"), [0.0, -0.02]),
        ("light helicopter", from_file("examples/light-helicopter.toml"), [0.0, 0.05]),
    ] {
        for shift in shifts {
            let vehicle = vehicle(&coarsened(moved(base.clone(), shift)));
            let conditions = grid();
            let listed = sweep(&vehicle, &conditions, &options, |_| {}).points;
            let on_orbit = listed.iter().filter(|point| point.on_orbit()).count();
            assert!(on_orbit + 1 >= listed.len(), "{name}, {shift} m: {on_orbit} trimmed");
            // The way is a function of the condition: a few alone tell.
            for k in [2, 3, 5, 7] {
                let alone = trim_at(&vehicle, conditions[k], &options);
                assert_eq!(bits(&alone), bits(&listed[k]), "{name}, {shift} m, {k}");
                assert_eq!(alone.status, listed[k].status, "{name}, {shift} m, {k}");
                assert_eq!(alone.branch, listed[k].branch, "{name}, {shift} m, {k}");
                assert_eq!(alone.steps, listed[k].steps, "{name}, {shift} m, {k}");
            }
            let turned: Vec<FlightCondition> = conditions.iter().rev().copied().collect();
            let backwards = sweep(&vehicle, &turned[..3], &options, |_| {}).points;
            for (a, b) in backwards.iter().zip(listed.iter().rev()) {
                assert_eq!(bits(a), bits(b), "{name}, {shift} m, backwards");
            }
        }
    }
}

/// In a slow climb a second orbit lies 5° further nose down. The trim is the
/// first one, and changes smoothly with the climb; with the inputs of a report
/// that found either, by the list and by chance.
#[test]
fn regress_slow_climbs_continue_level_flight() {
    let vehicle = in_phase();
    let rates: Vec<f64> = (0..=8).map(|k| 100.0 * f64::from(k) * FOOT_PER_MINUTE).collect();
    let conditions: Vec<FlightCondition> =
        rates.iter().map(|&rate| FlightCondition::climbing(0.0, rate)).collect();
    let points = sweep(&vehicle, &conditions, &Options::default(), |_| {}).points;
    let pitch: Vec<f64> = points
        .iter()
        .map(|point| {
            assert_eq!(point.status, Status::Converged, "{:?}", point.condition);
            assert_eq!(point.branch, Branch::LevelFlight);
            point.mean_state[Layout::BODY.pitch].to_degrees()
        })
        .collect();
    for pair in pitch.windows(2) {
        assert!((pair[1] - pair[0]).abs() < 0.15, "{pitch:?}");
    }
    // Second differences: one branch.
    for three in pitch.windows(3) {
        assert!((three[0] - 2.0 * three[1] + three[2]).abs() < 0.05, "{pitch:?}");
    }
}

/// With the centre of gravity 2 cm forward the printed rigging has no hover:
/// the branch folds at some speed. Just above there is a trim, just below none,
/// and the failed hover names that speed.
#[test]
fn regress_a_fold_is_said_with_the_last_trim() {
    let vehicle = vehicle(&coarsened(moved(problem("coax2d"), 0.02)));
    let options = Options::default();
    let hover = trim_at(&vehicle, FlightCondition::level(0.0), &options);
    let Status::Failed { reason, .. } = &hover.status else { panic!("{:?}", hover.status) };
    assert!(reason.contains("no solution exists nearby"), "{reason}");
    let Branch::Ended { last: Some(last) } = hover.branch else { panic!("{:?}", hover.branch) };
    let fold = last.horizontal_speed();
    assert!((6.0..20.0).contains(&fold), "{fold}");
    let beside = [0.1, -0.1].map(|off| FlightCondition::level(fold + off));
    let [above, below] = beside.map(|condition| trim_at(&vehicle, condition, &options));
    assert!(above.on_orbit() && above.branch == Branch::LevelFlight, "{:?}", above.status);
    assert!(!below.on_orbit(), "{:?}", below.status);
}

/// A climb without horizontal speed is vertical, not a flight at another speed.
#[test]
fn a_climb_without_speed_is_vertical() {
    let vehicle = vehicle(&coarsened(problem("coax2d-physics")));
    let rate = 300.0 * FOOT_PER_MINUTE;
    for speed in [0.0, 2.0 * KNOT] {
        let condition = FlightCondition::climbing(speed, rate);
        assert!((condition.horizontal_speed() - speed).abs() < 1e-12);
        let point = trim_at(&vehicle, condition, &Options::default());
        assert!(point.on_orbit(), "{:?}", point.status);
        let mean = |k: usize| {
            point.orbit.iter().map(|state| vehicle.navigation(state)[k]).sum::<f64>()
                / point.orbit.len() as f64
        };
        assert!((mean(3) + rate).abs() < 1e-8, "{}", mean(3));
        assert!((mean(1).hypot(mean(2)) - speed).abs() < 1e-4, "{} {}", mean(1), mean(2));
    }
}

/// The tolerance of the step decides on the number of steps, in sweeps too.
#[test]
fn step_tolerance_counts_in_sweeps() {
    let vehicle = vehicle(&coarsened(problem("coax2d")));
    let conditions = [40.0, 50.0].map(|knots| FlightCondition::level(knots * KNOT));
    let steps = |step_tolerance: f64| -> Vec<usize> {
        let options = Options { step_tolerance, ..Options::default() };
        sweep(&vehicle, &conditions, &options, |_| {}).points.iter().map(|p| p.steps).collect()
    };
    let (coarse, usual) = (steps(4e-5), steps(4e-7));
    for (coarse, usual) in coarse.iter().zip(&usual) {
        assert!(3 * coarse < 2 * usual, "{coarse} {usual}");
    }
}

// --- Descent and power -----------------------------------------------------------

/// A light helicopter flies down a fall line without power: its rate of descent
/// is least at some medium speed, near that of its smallest power over its
/// weight, and in the vertical it is that of a flat disk: the drag coefficient
/// of an autorotating rotor is 1.1 to 1.35 on its disk, W. Castles and R. B.
/// Gray (NACA TN 2474), J. G. Leishman.
#[test]
fn val_autorotation_of_a_helicopter() {
    let problem = from_file("examples/light-helicopter.toml");
    let vehicle = vehicle(&coarsened(problem));
    let options = Options::default();
    let at = |knots: f64| {
        let level = FlightCondition::level(knots * KNOT);
        let point = trim_at_power(&vehicle, level, 0.0, &options);
        assert!(point.on_orbit(), "{knots} kt: {:?}", point.status);
        assert!(point.power.shaft.abs() < 20.0, "{}", point.power.shaft);
        let needed = trim_at(&vehicle, level, &options).power.shaft;
        let weight = vehicle.mass * 9.806_65;
        println!(
            "{knots} kt: {:.2} m/s, P/W {:.2} m/s, {:?}",
            point.condition.climb_rate,
            needed / weight,
            point.rotors[0].flow
        );
        (point.condition.climb_rate, needed / weight, point)
    };
    let (vertical, _, hover) = at(0.0);
    let main = &vehicle.rotors[0];
    let area = std::f64::consts::PI * main.radius * main.radius;
    let disk = vehicle.mass * 9.806_65 / (0.5 * vehicle.air.density * vertical * vertical * area);
    assert!((1.0..1.5).contains(&disk), "drag coefficient of the disk {disk}");
    assert!(matches!(hover.rotors[0].flow, FlowState::TurbulentWake | FlowState::Windmill));
    let (slow, _, _) = at(25.0);
    let (medium, power_over_weight, _) = at(50.0);
    let (fast, _, _) = at(80.0);
    assert!(vertical < slow && slow < medium && fast < medium, "{vertical} {slow} {medium} {fast}");
    // Energy: height pays for what level flight needs.
    assert!((-medium / power_over_weight - 1.0).abs() < 0.15, "{medium} {power_over_weight}");
}

/// Power asked for is power flown, in climb too.
#[test]
fn power_asked_for_is_flown() {
    let vehicle = vehicle(&coarsened(problem("coax2d-physics")));
    let options = Options::default();
    let level = FlightCondition::level(40.0 * KNOT);
    let needed = trim_at(&vehicle, level, &options).power.shaft;
    let point = trim_at_power(&vehicle, level, 1.3 * needed, &options);
    assert_eq!(point.status, Status::Converged);
    assert!((point.power.shaft / (1.3 * needed) - 1.0).abs() < 1e-6);
    let again = trim_at(&vehicle, point.condition, &options);
    assert_eq!(bits(&point), bits(&again));
    assert!(point.condition.climb_rate > 0.0);
    let impossible = trim_at_power(&vehicle, level, 1e9, &options);
    let Status::Failed { reason, .. } = &impossible.status else { panic!() };
    assert!(reason.contains("no rate of climb was found"), "{reason}");
}

/// Straight down, the power falls with the descent as the measurements say: the
/// rotor passes the vortex-ring state, and its collective in autorotation is
/// below that of hover.
#[test]
fn descents_are_flagged() {
    let vehicle = vehicle(&coarsened(from_file("examples/light-helicopter.toml")));
    let options = Options::default();
    let down = |feet: f64| {
        let condition = FlightCondition::climbing(0.0, -feet * FOOT_PER_MINUTE);
        let point = trim_at(&vehicle, condition, &options);
        assert!(point.on_orbit(), "{feet}: {:?}", point.status);
        point
    };
    let states = [0.0, 1500.0, 3600.0].map(|feet| down(feet).rotors[0].flow);
    assert_eq!(states[0], FlowState::Normal);
    assert!(matches!(states[1], FlowState::VortexRing | FlowState::TurbulentWake), "{states:?}");
    assert_eq!(states[2], FlowState::Windmill);
}
