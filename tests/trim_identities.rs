//! What a trimmed orbit must be: periodic, mirrored by the mirrored vehicle,
//! balanced in energy, near the closed forms of flight mechanics, and the same
//! whatever the guess and the number of threads.

mod common;

use approx::assert_relative_eq;
use coaxdesign::problem::{Governor, Problem};
use coaxdesign::trim::{FlightCondition, Guess, Lateral, Options, Status, TrimPoint, sweep, trim};
use coaxdesign::vehicle::{Layout, Vehicle};
use common::{KNOT, coarsened, mirror_signs, mirror_sticks, mirrored, problem, trimmed, vehicle};

const GRAVITY: f64 = 9.806_65;

fn level(knots: f64) -> FlightCondition {
    FlightCondition::level(knots * KNOT)
}

/// Far tighter than the default, where the identity is exact.
fn tight() -> Options {
    Options { residual_tolerance: 1e-12, ..Options::default() }
}

/// Every number of a trim that people read, with the size that its errors
/// are measured by: its own, or the usual size of its changes if it is small.
fn numbers(vehicle: &Vehicle, point: &TrimPoint) -> Vec<(String, f64, f64)> {
    let mut list = Vec::new();
    for (quantity, value) in vehicle.layout.states.iter().zip(&point.mean_state) {
        list.push((quantity.name.clone(), *value, value.abs().max(quantity.scale)));
    }
    let pitch_scale = vehicle.layout.effectors[0].scale;
    for (k, stick) in point.sticks.iter().enumerate() {
        // The travel that moves a blade by the scale of its pitch.
        let gain = vehicle
            .controls
            .mix
            .iter()
            .flat_map(|mix| [mix.theta_0[k], mix.theta_1c[k], mix.theta_1s[k]])
            .fold(0.0_f64, |most, gain| most.max(gain.abs()));
        list.push((format!("stick {k}"), *stick, stick.abs().max(pitch_scale / gain)));
    }
    for (rotor, mean) in vehicle.rotors.iter().zip(&point.rotors) {
        let force = mean.thrust.abs();
        let mut put = |name: &str, value: f64, size: f64| {
            list.push((format!("{} {name}", rotor.name), value, size));
        };
        put("thrust", mean.thrust, force);
        put("torque", mean.torque, mean.torque.abs());
        put("power", mean.power, mean.power.abs());
        for k in 0..3 {
            put("force", mean.force_hub[k], force);
            put("moment", mean.moment_hub[k], force * rotor.radius);
            put("pitch", mean.pitch[k], mean.pitch[k].abs().max(pitch_scale));
        }
    }
    list
}

fn assert_same(what: &str, a: &[(String, f64, f64)], b: &[(String, f64, f64)], tolerance: f64) {
    let mut worst = 0.0_f64;
    for ((name, x, size), (_, y, _)) in a.iter().zip(b) {
        let error = (x - y).abs() / size;
        assert!(error <= tolerance, "{what}: {name}: {x} and {y}, off by {error:.1e}");
        worst = worst.max(error);
    }
    println!("{what}: worst {worst:.1e}");
}

// --- The orbit -------------------------------------------------------------------

/// Halving the step moves no trim value by more than 1e-6, whatever the
/// tables' curvature does to the order of the integrator: the error test looks
/// at the trim itself, not at how far one period misses.
#[test]
fn half_the_step_is_the_same_trim() {
    const MOST: f64 = 1e-6;
    let options = Options::default();
    for (name, knots) in [
        ("coax2d-appendix", 30.0),
        ("coax2d-appendix", 90.0),
        ("coax2d", 0.0),
        ("coax2d", 50.0),
        ("coax2d", 80.0),
        ("coax2d-physics", 40.0),
    ] {
        let vehicle = vehicle(&coarsened(problem(name)));
        let point = trimmed(&vehicle, level(knots), &options);
        assert!(point.step_error <= options.step_tolerance);
        let guess = Guess { steps: Some(2 * point.steps), ..point.guess() };
        let again = trim(&vehicle, point.condition, &guess, &options);
        assert_eq!(again.status.word(), point.status.word());
        assert!(again.steps >= 2 * point.steps);
        let what = format!("{name} at {knots} kt, {} and {} steps", point.steps, again.steps);
        assert_same(&what, &numbers(&vehicle, &point), &numbers(&vehicle, &again), MOST);
    }
}

/// What the trim was asked for is what it flies.
#[test]
fn conditions_are_met() {
    let vehicle = vehicle(&coarsened(problem("coax2d")));
    let speed = 50.0 * KNOT;
    let body = Layout::BODY;
    for condition in [
        FlightCondition { lateral: Lateral::Sideslip(0.08), ..level(50.0) },
        FlightCondition { lateral: Lateral::Bank(-0.01), ..level(50.0) },
        FlightCondition { climb_rate: 2.0, ..level(50.0) },
        FlightCondition { turn_rate: -0.1, climb_rate: -1.5, ..level(50.0) },
        FlightCondition { lateral: Lateral::WindAzimuth(-0.08), ..level(50.0) },
    ] {
        let point = trimmed(&vehicle, condition, &Options::default());
        let mean = &point.mean_state;
        match condition.lateral {
            Lateral::Sideslip(angle) => {
                assert!((point.sideslip - angle).abs() < 1e-9, "{}", point.sideslip);
                assert!((mean[body.velocity + 1] - speed * angle.sin()).abs() < 1e-8);
            }
            Lateral::Bank(angle) => {
                assert!((mean[body.roll] - angle).abs() < 1e-9);
                // Banked to port without turning, it slips to port.
                assert!(point.sideslip < -0.02, "{}", point.sideslip);
            }
            Lateral::WindAzimuth(angle) => {
                let [_, forward, right, _] = vehicle.navigation(mean);
                assert!((right.atan2(forward) - angle).abs() < 1e-4, "{right} {forward}");
            }
        }
        // The orbit's vibration is small: the mean velocity has the airspeed.
        let length = (0..3).map(|k| mean[body.velocity + k].powi(2)).sum::<f64>().sqrt();
        assert!((length - speed).abs() < 1e-3 * speed, "{length} and {speed}");
        let climb = |state: &[f64]| -vehicle.navigation(state)[3];
        assert!((climb(mean) - condition.climb_rate).abs() < 0.02);
        assert!((vehicle.navigation(mean)[0] - condition.turn_rate).abs() < 1e-3);
    }
}

/// Flight in any direction: both velocities are met, the wind from ahead is level
/// flight, and a hexacopter, whose thrust knows no direction but up, leans by
/// one angle whatever the direction.
#[test]
fn the_wind_may_come_from_anywhere() {
    let single_rotor = vehicle(&coarsened(problem("uh60a")));
    let hexacopter = vehicle(&problem("firefly"));
    let speed = 17.0 * KNOT;
    let mut leans = Vec::new();
    for degrees in [0, 60, 90, 150, 180, 210, 270, 330] {
        let azimuth = f64::from(degrees).to_radians();
        let condition = FlightCondition::from_azimuth(speed, azimuth);
        let point = trimmed(&single_rotor, condition, &Options::default());
        let (mut forward, mut right) = (0.0, 0.0);
        for state in &point.orbit {
            let [_, f, r, _] = single_rotor.navigation(state);
            forward += f / point.orbit.len() as f64;
            right += r / point.orbit.len() as f64;
        }
        let off = (forward - speed * azimuth.cos()).hypot(right - speed * azimuth.sin());
        assert!(off < 1e-7, "{degrees} deg: {forward} and {right} m/s");
        let lean = trimmed(&hexacopter, condition, &tight());
        if degrees == 0 {
            // Without bank, no sideslip and the wind from ahead are one flight.
            let straight = trimmed(&hexacopter, level(17.0), &tight());
            let numbers = [&straight, &lean].map(|p| numbers(&hexacopter, p));
            assert_same("wind from ahead", &numbers[0], &numbers[1], 1e-9);
        }
        let [roll, pitch] = [Layout::BODY.roll, Layout::BODY.roll + 1].map(|k| lean.mean_state[k]);
        leans.push((roll.cos() * pitch.cos()).acos());
    }
    assert!(leans[0] > 0.1);
    for lean in &leans {
        assert!((lean - leans[0]).abs() < 1e-7, "{leans:?}");
    }
}

/// The mirrored vehicle trims to the mirror image in flight to the side and to
/// the rear.
#[test]
fn sideward_flight_mirrors() {
    let base = coarsened(problem("octo-x8"));
    let (original, mirror) = (vehicle(&base), vehicle(&mirrored(&base)));
    for azimuth in [1.2, 2.5] {
        let flight = |sign: f64| FlightCondition::from_azimuth(10.0 * KNOT, sign * azimuth);
        let a = trimmed(&original, flight(1.0), &tight());
        let mut b = trimmed(&mirror, flight(-1.0), &tight());
        for (value, sign) in b.mean_state.iter_mut().zip(mirror_signs(&original)) {
            *value *= sign;
        }
        b.sticks = mirror_sticks(b.sticks);
        let what = format!("wind from {azimuth} rad");
        assert_same(&what, &numbers(&original, &a), &numbers(&original, &b), 1e-9);
    }
}

// --- The mirror --------------------------------------------------------------------

/// The mirrored vehicle trims to the mirrored flight.
#[test]
fn mirrored_vehicle_trims_to_the_mirror_image() {
    for name in ["coax2d", "coax2d-physics", "octo-x8"] {
        let base = coarsened(problem(name));
        let few = name == "octo-x8";
        let (original, mirror) = (vehicle(&base), vehicle(&mirrored(&base)));
        for (knots, slip, turn) in [(0.0, 0.0, 0.0), (60.0, 0.1, 0.0), (60.0, 0.0, 0.1)] {
            // The multicopter is itself its mirror image in hover, and slow.
            let knots = if few { 0.2 * knots } else { knots };
            if few && knots == 0.0 {
                continue;
            }
            let condition = |sign: f64| FlightCondition {
                lateral: Lateral::Sideslip(sign * slip),
                turn_rate: sign * turn,
                ..level(knots)
            };
            let a = trimmed(&original, condition(1.0), &tight());
            let mut b = trimmed(&mirror, condition(-1.0), &tight());
            for (value, sign) in b.mean_state.iter_mut().zip(mirror_signs(&original)) {
                *value *= sign;
            }
            b.sticks = mirror_sticks(b.sticks);
            // Something there is to mirror.
            assert!(a.mean_state[Layout::BODY.roll].abs() > 1e-5 && a.sticks[3].abs() > 1e-3);
            let what = format!("{name}, {knots} kt, slip {slip}, turn {turn}");
            assert_same(&what, &numbers(&original, &a), &numbers(&original, &b), 1e-9);
        }
    }
}

// --- Energy --------------------------------------------------------------------------

fn manoeuvres() -> [(&'static str, FlightCondition); 6] {
    [
        ("hover", level(0.0)),
        ("level", level(60.0)),
        ("climb", FlightCondition { climb_rate: 3.0, ..level(50.0) }),
        ("descent", FlightCondition { climb_rate: -2.0, ..level(50.0) }),
        ("turn", FlightCondition { turn_rate: 0.15, ..level(60.0) }),
        ("slip", FlightCondition { lateral: Lateral::Sideslip(0.1), ..level(60.0) }),
    ]
}

/// The shafts' power is induced, profile, parasite and climb power, to 1e-6.
/// The published matrices' rules for in-plane moments and for the teeter motion
/// are not the mechanics of a hinge; what they take from the shafts beyond is
/// counted by itself.
#[test]
fn shaft_power_is_accounted_for() {
    for name in ["coax2d", "coax2d-appendix", "coax2d-physics"] {
        let vehicle = vehicle(&coarsened(problem(name)));
        let mut most_inexact = 0.0_f64;
        for (what, condition) in manoeuvres() {
            let point = trimmed(&vehicle, condition, &Options::default());
            let power = point.power;
            let imbalance = power.imbalance();
            println!(
                "{name}, {what}: {imbalance:.1e} of {:.0} W, inexact {:.1e} W",
                power.shaft, power.inexact
            );
            assert!(imbalance.abs() < 1e-6, "{name}, {what}: {imbalance:.1e}");
            assert!(power.induced > 0.0 && power.profile > 0.0);
            assert!((power.climb - vehicle.mass * GRAVITY * condition.climb_rate).abs() < 1.0);
            most_inexact = most_inexact.max((power.inexact / power.shaft).abs());
        }
        // Without it the balance would not close where the rules hold.
        assert_eq!(most_inexact > 1e-6, name == "coax2d-appendix", "{name}: {most_inexact:.1e}");
    }
}

/// Small-angle loads do the same work: lift none, drag along the blade's motion.
#[test]
fn small_angle_loads_keep_the_balance_of_power() {
    let mut p = coarsened(problem("coax2d"));
    for rotor in &mut p.rotors {
        rotor.airfoil = common::small_angles(6.2, 0.009);
    }
    let vehicle = vehicle(&p);
    let exact = {
        for rotor in &mut p.rotors {
            rotor.airfoil = common::analytic(6.2, 0.009);
        }
        common::vehicle(&p)
    };
    for (what, condition) in manoeuvres() {
        let point = trimmed(&vehicle, condition, &Options::default());
        let imbalance = point.power.imbalance();
        assert!(imbalance.abs() < 1e-6, "{what}: {imbalance:.1e}");
        // The flow is shallow but near the root: a few percent of the power.
        let full = trimmed(&exact, condition, &Options::default());
        assert_relative_eq!(point.power.shaft, full.power.shaft, max_relative = 0.05);
    }
}

// --- Flight mechanics -------------------------------------------------------------------

/// A turn without sideslip needs about the bank of a coordinated turn,
/// tan φ = V ψ'/g.
#[test]
fn val_bank_of_a_turn() {
    let speed = 60.0 * KNOT;
    for name in ["coax2d", "coax2d-physics"] {
        let vehicle = vehicle(&coarsened(problem(name)));
        let straight = trimmed(&vehicle, level(60.0), &Options::default());
        let mut powers = Vec::new();
        for turn_rate in [-0.15, 0.15] {
            let point = trimmed(
                &vehicle,
                FlightCondition { turn_rate, ..level(60.0) },
                &Options::default(),
            );
            let bank = point.mean_state[Layout::BODY.roll];
            let expected = (speed * turn_rate / GRAVITY).atan();
            println!("{name}: bank {:.2}°, {:.2}°", bank.to_degrees(), expected.to_degrees());
            assert!((bank - expected).abs() < 1.5_f64.to_radians());
            let thrust = |p: &TrimPoint| p.rotors.iter().map(|r| r.thrust).sum::<f64>();
            // Load factor 1/cos φ.
            let load = thrust(&point) / thrust(&straight);
            assert!((load * bank.cos() - 1.0).abs() < 0.03, "{load}");
            powers.push(point.power.shaft);
        }
        assert!(powers.iter().all(|power| *power > straight.power.shaft));
    }
}

/// A climb takes the power that goes into height and a little more or less:
/// in forward flight the inflow hardly changes, the attitude does.
#[test]
fn val_power_of_a_climb() {
    for name in ["coax2d", "coax2d-appendix", "coax2d-physics"] {
        let vehicle = vehicle(&coarsened(problem(name)));
        let power = |climb_rate: f64| {
            let condition = FlightCondition { climb_rate, ..level(60.0) };
            trimmed(&vehicle, condition, &Options::default()).power.shaft
        };
        let (up, down, flat) = (power(1.5), power(-1.5), power(0.0));
        let height = vehicle.mass * GRAVITY * 1.5;
        let (climb, descent) = ((up - flat) / height, (flat - down) / height);
        println!("{name}: climb {climb:.3}, descent {descent:.3} of W Vc");
        for ratio in [climb, descent] {
            assert!((0.8..1.25).contains(&ratio), "{name}: {ratio}");
        }
    }
}

/// Lift balances weight in hover, torque balances torque.
#[test]
fn hover_is_in_balance() {
    for name in ["coax2d", "coax2d-appendix"] {
        let p = coarsened(problem(name));
        let vehicle = vehicle(&p);
        let point = trimmed(&vehicle, level(0.0), &Options::default());
        let [upper, lower] = [&point.rotors[0], &point.rotors[1]];
        // No download without wash: thrusts along the shafts carry the weight,
        // tilted by the shaft and the flapping, 1 % at most.
        let weight = vehicle.mass * GRAVITY;
        let lift = upper.thrust + lower.thrust;
        assert!((lift / weight - 1.0).abs() < 0.01, "{name}: {}", lift / weight);
        // No tail rotor: torques are equal but for what the tilted forces do
        // about the centre of gravity.
        let difference = (upper.torque - lower.torque).abs() / upper.torque;
        assert!(difference < 0.02, "{name}: {difference}");
        // The lower rotor works in the wake of the upper one.
        assert!(upper.thrust > lower.thrust && lower.inflow[0] > upper.inflow[0]);
    }
}

// --- Behaviour ----------------------------------------------------------------------------

/// What cannot be flown fails, and says what could not be met or what is
/// beyond its limits; it is never passed off as converged.
#[test]
fn unreachable_flight_fails_by_name() {
    let vehicle = vehicle(&coarsened(problem("coax2d-physics")));
    for condition in [level(200.0), FlightCondition { climb_rate: 25.0, ..level(60.0) }] {
        let guess = Guess::estimate(&vehicle, &condition);
        let point = trim(&vehicle, condition, &guess, &Options::default());
        println!("{condition:?}: {:?}, residual {:.1e}", point.status, point.residual_norm);
        match &point.status {
            Status::Converged => panic!("{condition:?} is beyond this aircraft"),
            Status::BeyondLimits { controls } => {
                assert!(!controls.is_empty());
                for name in controls {
                    let margin = point.margins.iter().find(|margin| &margin.control == name);
                    assert!(margin.is_some_and(|margin| margin.fraction() < 0.0), "{name}");
                }
            }
            Status::Failed { equations, reason, .. } => {
                assert!(!reason.is_empty());
                assert!(!equations.is_empty());
                for name in equations {
                    assert!(point.residuals.iter().any(|r| &r.equation == name), "{name}");
                }
                assert!(point.clone().into_converged().is_err());
            }
        }
    }
}

/// Fast flight runs out of longitudinal cyclic. Where the sticks reach further
/// than the blades may, the trim is found and the blades are named; where the
/// stick itself stops, there is none, and the stick is.
#[test]
fn limits_are_named() {
    let fast = |name: &str, limit: &dyn Fn(&mut Problem)| {
        let mut p = coarsened(problem(name));
        limit(&mut p);
        let vehicle = vehicle(&p);
        let options = Options::default();
        let near = trimmed(&vehicle, level(80.0), &options);
        assert_eq!(near.status, Status::Converged);
        trim(&vehicle, level(90.0), &near.guess(), &options)
    };
    // 80 kt needs some 8° of longitudinal cyclic, 90 kt more than 10°.
    let degrees = 10.0_f64.to_radians();
    let beyond = fast("coax2d", &|p| p.controls.cyclic_limits.fill([-degrees, degrees]));
    let named = ["upper.theta_1s", "lower.theta_1s"].map(str::to_owned).to_vec();
    assert_eq!(beyond.status, Status::BeyondLimits { controls: named });
    assert!(beyond.residual_norm < 1e-10);
    let stopped = fast("coax2d-physics", &|p| {
        let per_percent = p.controls.mix[0].theta_1s[1];
        p.controls.stick_limits[1] = [-degrees / per_percent, degrees / per_percent];
    });
    let Status::Failed { binding, reason, .. } = &stopped.status else {
        panic!("{:?}", stopped.status)
    };
    assert_eq!(binding, &["lon"]);
    assert!(reason.contains("lon"), "{reason}");
}

/// Too few iterations allowed: a failure with its reason.
#[test]
fn iteration_limit_is_reported() {
    let vehicle = vehicle(&coarsened(problem("coax2d")));
    let condition = level(40.0);
    let options = Options { max_iterations: 1, ..Options::default() };
    let point = trim(&vehicle, condition, &Guess::estimate(&vehicle, &condition), &options);
    assert!(!point.on_orbit());
    assert!(
        matches!(&point.status, Status::Failed { reason, equations, .. }
            if !reason.is_empty() && !equations.is_empty()),
        "{:?}",
        point.status
    );
    assert!(point.residual_norm > options.residual_tolerance);
}

/// A poor guess finds the same orbit.
#[test]
fn a_poor_guess_finds_the_same_trim() {
    let vehicle = vehicle(&coarsened(problem("coax2d")));
    let condition = level(40.0);
    let good = trimmed(&vehicle, condition, &tight());
    // From nothing known, but with the same step.
    let mut guess = Guess { steps: Some(good.steps), jacobian: None, ..good.guess() };
    let body = Layout::BODY;
    guess.state[body.velocity] *= 0.85;
    guess.state[body.velocity + 2] += 2.0;
    guess.state[body.roll] += 0.12;
    guess.state[body.pitch] -= 0.1;
    guess.state[body.rate + 1] += 0.1;
    for places in &vehicle.layout.rotors {
        guess.state[places.self_inflow.unwrap()] *= 1.4;
        guess.state[places.flapping.unwrap()] += 0.025;
    }
    guess.sticks[1] += 0.75;
    guess.sticks[2] *= 0.85;
    guess.sticks[3] += 2.5;
    let found = trim(&vehicle, condition, &guess, &tight());
    assert!(found.on_orbit(), "{:?}", found.status);
    assert!(found.iterations > 1);
    assert_same("poor guess", &numbers(&vehicle, &good), &numbers(&vehicle, &found), 1e-8);
}

/// A governor holds the speed of a steady flight, so it changes no trim.
#[test]
fn governed_rotors_trim_alike() {
    let held = coarsened(problem("coax2d"));
    let mut governed = held.clone();
    for rotor in &mut governed.rotors {
        rotor.governor = Some(Governor { time_constant: 0.3 });
    }
    let (held, governed) = (vehicle(&held), vehicle(&governed));
    assert_eq!(governed.state_count(), held.state_count() + 4);
    for knots in [0.0, 60.0] {
        let a = trimmed(&held, level(knots), &tight());
        let b = trimmed(&governed, level(knots), &tight());
        for (k, state) in held.layout.states.iter().enumerate() {
            let other = governed.layout.state(&state.name).unwrap();
            let error = (a.mean_state[k] - b.mean_state[other]).abs() / state.scale;
            assert!(error < 1e-9, "{} at {knots} kt: off by {error:.1e}", state.name);
        }
        for (x, y) in a.sticks.iter().zip(b.sticks) {
            assert!((x - y).abs() < 1e-9 * x.abs().max(1.0), "{x} and {y}");
        }
        for (places, rotor) in governed.layout.rotors.iter().zip(&governed.rotors) {
            let at = places.speed.unwrap();
            assert!((b.mean_state[at] - rotor.speed).abs() < 1e-12);
            assert!(b.mean_state[at + 1].abs() < 1e-12);
        }
    }
}

/// The same bits every time, on one thread and on two.
#[test]
fn same_bits_whatever_the_threads() {
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let p: Problem = coarsened(problem("coax2d-physics"));
            let vehicle = vehicle(&p);
            sweep(&vehicle, &[level(0.0), level(15.0), level(30.0)], &Options::default(), |_| {})
        })
    };
    let first = run(1);
    assert!(first.all_on_orbit());
    for threads in [1, 2] {
        let again = run(threads);
        assert_eq!(first, again, "{threads} threads");
        for (a, b) in first.points.iter().zip(&again.points) {
            let bits = |point: &TrimPoint| -> Vec<u64> {
                point.state.iter().chain(&point.sticks).map(|value| value.to_bits()).collect()
            };
            assert_eq!(bits(a), bits(b), "{threads} threads");
        }
    }
}
