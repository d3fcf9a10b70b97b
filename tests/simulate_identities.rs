//! Flights that must agree with one another, whatever the aircraft.

use coaxdesign::problem::builtin_named;
use coaxdesign::simulate::maneuver::{self, Maneuver};
use coaxdesign::simulate::{Flight, Options, Simulator, Status};
use coaxdesign::trim::{ConvergedTrim, FlightCondition, Guess, trim};
use coaxdesign::units::KNOT;
use coaxdesign::vehicle::{Layout, Vehicle};
use std::sync::LazyLock;

/// The paper's aircraft without interactions, whose tables take long to build.
static VEHICLE: LazyLock<Vehicle> = LazyLock::new(|| {
    let mut problem = builtin_named("coax2d").unwrap().problem;
    problem.inflow.interactions = false;
    Vehicle::new(&problem).unwrap()
});

/// Level flight at 40 kt.
static CRUISE: LazyLock<ConvergedTrim> = LazyLock::new(|| {
    let condition = FlightCondition::level(40.0 * KNOT);
    let guess = Guess::estimate(&VEHICLE, &condition);
    trim(&VEHICLE, condition, &guess, &Default::default()).into_converged().unwrap()
});

fn options() -> Options {
    let specification = coaxdesign::control::spec::builtin().unwrap();
    Options::new(specification.hardware, specification.pitch_rate_limit)
}

fn doublet(extra: &str) -> Maneuver {
    let text = format!(
        "title = \"doublet\"\nduration = \"3 s\"\nmode = \"open_loop\"\n\
         [start]\nairspeed = \"40 kt\"\n\
         [inputs.a]\nstick = \"lat\"\nshape = \"doublet\"\nstart = \"0.5 s\"\namplitude = \"1 %\"\n\
         [inputs.b]\nstick = \"col\"\nshape = \"pulse\"\nstart = \"1 s\"\namplitude = \"3 %\"\n{extra}"
    );
    maneuver::parse("doublet", &text).unwrap_or_else(|report| panic!("{report}"))
}

/// States at the end of a flight, and its position and heading.
fn flown(maneuver: &Maneuver, options: &Options) -> (Vec<f64>, [f64; 3], f64) {
    let mut flight = Flight::new(&VEHICLE, &CRUISE, None, maneuver, options).unwrap();
    assert_eq!(flight.fly(|_| {}), Status::Completed);
    let s = &flight.simulator;
    (s.state().to_vec(), s.position(), s.heading())
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    let scales = VEHICLE.layout.states.iter().map(|state| state.scale);
    a.iter().zip(b).zip(scales).map(|((a, b), s)| ((a - b) / s).abs()).fold(0.0, f64::max)
}

/// With sticks at their trim the aircraft stays on the orbit of its trim:
/// after a whole number of periods it is where it began. (The bare aircraft
/// is unstable, so what is left of the discretisation grows.)
#[test]
fn trimmed_flight_stays_on_its_orbit() {
    let options = Options {
        // Control periods that divide the rotor's period.
        control_rate: 10.0 / VEHICLE.period,
        ..options()
    };
    let mut simulator = Simulator::new(&VEHICLE, &CRUISE, &options).unwrap();
    for _ in 0..200 {
        simulator.advance(CRUISE.point().sticks).unwrap();
    }
    let moved = largest_difference(simulator.state(), &CRUISE.point().state);
    assert!(moved < 1e-4, "{moved}");
}

/// Halving the step changes the answer by less and less, and the default step
/// is fine enough: the error after three seconds of manoeuvring is below one
/// part in a thousand of the states' usual changes.
#[test]
fn halving_the_step_converges() {
    let maneuver = doublet("");
    let at =
        |steps_per_revolution| flown(&maneuver, &Options { steps_per_revolution, ..options() }).0;
    let (coarse, middle, fine) = (at(36), at(72), at(288));
    let (first, second) = (largest_difference(&coarse, &fine), largest_difference(&middle, &fine));
    assert!(first < 1e-3, "{first}");
    assert!(second < 0.3 * first, "{first} {second}");
}

/// Flight through air that moves steadily is flight through still air, seen
/// from a ground that moves.
#[test]
fn steady_wind_only_moves_the_ground() {
    let still = doublet("");
    let windy = doublet("[wind]\nspeed = \"20 kt\"\nfrom = \"60 deg\"\nup = \"3 ft/s\"\n");
    let (a, position_a, heading_a) = flown(&still, &options());
    let (b, position_b, heading_b) = flown(&windy, &options());
    // All states but the velocity over the ground agree.
    let from = Layout::BODY.rate;
    for ((a, b), s) in a.iter().zip(&b).zip(&VEHICLE.layout.states).skip(from) {
        assert!((a - b).abs() < 1e-8 * s.scale, "{}: {a} {b}", s.name);
    }
    assert!((heading_a - heading_b).abs() < 1e-9);
    let time = still.duration;
    for ((b, a), wind) in position_b.iter().zip(position_a).zip(windy.weather.wind) {
        assert!((b - a - wind * time).abs() < 1e-6);
    }
}

/// There is no special direction over the ground.
#[test]
fn heading_turns_the_track_and_nothing_else() {
    let (a, position, heading) = flown(&doublet(""), &options());
    let mut east = doublet("");
    east.start.heading = std::f64::consts::FRAC_PI_2;
    let (b, turned, turned_heading) = flown(&east, &options());
    assert_eq!(a, b);
    assert!((turned_heading - heading - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
    assert!((turned[0] + position[1]).abs() < 1e-9);
    assert!((turned[1] - position[0]).abs() < 1e-9);
}

/// The same seed gives the same bits; another seed other turbulence.
#[test]
fn turbulence_repeats_by_seed() {
    let rough = doublet("[turbulence]\nwind_at_20_ft = \"15 kt\"\n");
    let at = |seed| flown(&rough, &Options { seed, ..options() });
    assert_eq!(at(7), at(7));
    assert!(largest_difference(&at(7).0, &at(8).0) > 1e-3);
    // The air's turning is felt beside its velocity, which is the same.
    let plain = doublet("[turbulence]\nwind_at_20_ft = \"15 kt\"\nrates = false\n");
    let without = flown(&plain, &Options { seed: 7, ..options() });
    assert!(largest_difference(&at(7).0, &without.0) > 1e-3);
}

/// The transport delay that is simulated is the one asked for, to half a tick.
#[test]
fn delay_is_the_one_asked_for() {
    for control_rate in [50.0, 100.0, 137.0, 400.0] {
        let options = Options { control_rate, ..options() };
        let simulator = Simulator::new(&VEHICLE, &CRUISE, &options).unwrap();
        let asked = options.hardware.delay;
        let tick = 0.5 * simulator.integration_step();
        assert!((simulator.delay() - asked).abs() <= 0.5 * tick + 1e-12, "{control_rate}");
    }
    // Holding a command for a period takes longer than this delay by itself.
    let slow = Options { control_rate: 10.0, ..options() };
    assert!(Simulator::new(&VEHICLE, &CRUISE, &slow).is_err());
}

/// A flight that leaves its limits or its senses says which state did so and
/// when, and never shows a value that is not finite.
#[test]
fn departures_are_named() {
    let hard = doublet(
        "[inputs.c]\nstick = \"lon\"\nshape = \"step\"\nstart = \"0.2 s\"\namplitude = \"60 %\"\n",
    );
    let long = Maneuver { duration: 60.0, ..hard.clone() };
    let mut flight = Flight::new(&VEHICLE, &CRUISE, None, &long, &options()).unwrap();
    let status = flight.fly(|flight| {
        assert!(flight.simulator.state().iter().all(|x| x.is_finite()));
    });
    let Status::Diverged(departure) = &status else { panic!("{status:?}") };
    assert!(departure.time > 0.2 && departure.time < 60.0, "{departure:?}");
    assert!(departure.value.is_finite());

    let mut limited = long;
    limited.limits.pitch = Some(20f64.to_radians());
    let mut flight = Flight::new(&VEHICLE, &CRUISE, None, &limited, &options()).unwrap();
    let status = flight.fly(|_| {});
    let Status::Limit(departure) = &status else { panic!("{status:?}") };
    assert_eq!(departure.state, "theta");
}
