//! The stitched model in flight: the same simulator as the vehicle's.

#[path = "common/sets.rs"]
mod sets;

use coaxdesign::control::plant::Hardware;
use coaxdesign::lti::stitch::{StitchError, Stitched};
use coaxdesign::pipeline::{FlightPlan, PipelineError, Silent, fly_models};
use coaxdesign::simulate::flight::FlightError;
use coaxdesign::simulate::montecarlo::Variation;
use coaxdesign::simulate::{Airframe, Flight, Maneuver, Options, Start, Status, maneuver};
use coaxdesign::trim::{FlightCondition, Lateral};
use coaxdesign::units::KNOT;
use nalgebra::{DMatrix, DVector};
use sets::uh60a;

/// Hardware that does nothing at frequencies of flight. The delay is the hold's
/// half period.
const FAST: Hardware = Hardware {
    actuator_bandwidth: 1e5,
    actuator_damping: 0.8,
    delay: 0.0005,
    sensor_bandwidth: 3000.0,
};

fn options() -> Options {
    Options { control_rate: 1000.0, ..Options::new(FAST, 1.0) }
}

fn open_loop(text: &str) -> Maneuver {
    let head = "title = \"t\"\nduration = \"3 s\"\nmode = \"open_loop\"\n";
    maneuver::parse("t", &format!("{head}{text}")).unwrap_or_else(|report| panic!("{report}"))
}

/// Flies an open-loop manoeuvre from steady flight; the states at every period.
fn flown(model: &Stitched, speed: f64, maneuver: &Maneuver) -> Vec<Vec<f64>> {
    let start = model.steady(&FlightCondition::level(speed)).unwrap();
    let start = Start::from(&start);
    let mut flight = Flight::of(Airframe::from(model), &start, None, maneuver, &options()).unwrap();
    let mut seen = Vec::new();
    let status = flight.fly(|flight| seen.push(flight.simulator.state().to_vec()));
    assert_eq!(status, Status::Completed);
    seen
}

/// Every trim of the set, and one between two of them, is steady flight.
#[test]
fn trims_are_steady_flight() {
    let set = uh60a();
    let model = Stitched::new(&set, None).unwrap();
    let still = open_loop("");
    for speed in set.speeds().into_iter().chain([50.0 * KNOT, 97.0 * KNOT]) {
        let states = flown(&model, speed, &still);
        let (first, last) = (&states[0], &states[states.len() - 1]);
        for (a, b) in first.iter().zip(last) {
            assert!((a - b).abs() < 1e-9, "{speed} m/s: {first:?} became {last:?}");
        }
    }
}

/// A small pulse of a stick moves the stitched model as the point model's own
/// x' = A x + B δ says, solved exactly.
#[test]
fn small_motions_are_those_of_the_point_model() {
    let set = uh60a();
    let model = Stitched::new(&set, None).unwrap();
    for (stick, name) in ["lat", "lon", "col", "ped"].into_iter().enumerate() {
        let text = format!(
            "[inputs.a]\nstick = \"{name}\"\nshape = \"step\"\nstart = \"0 s\"\namplitude = \"0.001 %\"\n"
        );
        let pulse = open_loop(&text);
        for point in &set.models {
            let states = flown(&model, point.speed, &pulse);
            let n = point.model.states().len();
            let mut m = DMatrix::zeros(n + 1, n + 1);
            m.view_mut((0, 0), (n, n)).copy_from(point.model.a());
            m.view_mut((0, n), (n, 1)).copy_from(&point.model.b().column(stick));
            let step = (m * 1e-3).exp();
            let mut x = DVector::zeros(n + 1);
            x[n] = 0.001;
            let (mut apart, mut size) = (vec![0.0f64; n], vec![0.0f64; n]);
            for state in &states {
                for k in 0..n {
                    apart[k] = apart[k].max((state[k] - states[0][k] - x[k]).abs());
                    size[k] = size[k].max(x[k].abs());
                }
                x = &step * x;
            }
            let largest = size.iter().copied().fold(0.0, f64::max);
            for k in 0..n {
                let bound = 1e-3 * size[k].max(0.03 * largest);
                assert!(
                    apart[k] < bound,
                    "{} {name} state {k}: {} of {}",
                    point.label,
                    apart[k],
                    size[k]
                );
            }
        }
    }
}

/// In a steady wind the motion through the air is that of still air.
#[test]
fn a_steady_wind_only_carries_the_aircraft_along() {
    let model = Stitched::new(&uh60a(), None).unwrap();
    let input =
        "[inputs.a]\nstick = \"lon\"\nshape = \"step\"\nstart = \"0.5 s\"\namplitude = \"1 %\"\n";
    let wind = "[wind]\nspeed = \"20 kt\"\nfrom = \"90 deg\"\n";
    let start = Start::from(&model.steady(&FlightCondition::level(40.0 * KNOT)).unwrap());
    let fly = |text: &str| {
        let maneuver = open_loop(text);
        let mut flight = Flight::of((&model).into(), &start, None, &maneuver, &options()).unwrap();
        assert_eq!(flight.fly(|_| {}), Status::Completed);
        let s = &flight.simulator;
        (s.airspeed(), s.state()[6], s.state()[7], s.position(), s.wind())
    };
    let (still, windy) = (fly(input), fly(&format!("{input}{wind}")));
    assert!((still.0 - windy.0).abs() < 1e-6, "{} {}", still.0, windy.0);
    assert!((still.1 - windy.1).abs() < 1e-7 && (still.2 - windy.2).abs() < 1e-7);
    for k in 0..3 {
        let carried = still.3[k] + 3.0 * windy.4[k];
        assert!((windy.3[k] - carried).abs() < 1e-4, "{k}: {} {carried}", windy.3[k]);
    }
    assert!((windy.4[1] + 20.0 * KNOT).abs() < 1e-9);
}

/// What only a problem has is refused, and said.
#[test]
fn what_models_do_not_have_is_refused() {
    let model = Stitched::new(&uh60a(), None).unwrap();
    let plan = |maneuver: Maneuver, variation| FlightPlan {
        maneuver,
        variation,
        options: options(),
        every: 1,
    };
    let fly = |plan: &FlightPlan| {
        fly_models::<PipelineError>(&model, None, plan, &Silent, |_, _| Ok(())).unwrap_err()
    };
    let d = Variation::default();
    for variation in [
        Variation { inflow: 1.1, ..d },
        Variation { interactions: Some(false), ..d },
        Variation { governor: Some(1.0), ..d },
    ] {
        let error = fly(&plan(open_loop(""), variation));
        assert!(matches!(error, PipelineError::Stitch(StitchError::NotVaried { .. })), "{error}");
    }
    let error = fly(&plan(open_loop(""), Variation { center_of_gravity: 0.1, ..d }));
    assert!(error.to_string().contains("[models_from.mass]"), "{error}");
    let error = fly(&plan(open_loop("engine_out = \"1 s\"\n"), d));
    assert!(matches!(error, PipelineError::Flight(FlightError::NoEngine)), "{error}");
    let sideslip =
        FlightCondition { lateral: Lateral::Sideslip(0.1), ..FlightCondition::level(20.0) };
    assert_eq!(model.steady(&sideslip), Err(StitchError::Lateral));
}

/// Twice the inertia halves the angular acceleration that a stick gives, and
/// leaves the trim.
#[test]
fn inertia_varies_apart_from_mass() {
    let model = Stitched::new(&uh60a(), None).unwrap();
    let slow = Variation { inertia: 2.0, ..Variation::default() }.stitched(&model).unwrap();
    let condition = FlightCondition::level(60.0 * KNOT);
    let (a, b) = (model.steady(&condition).unwrap(), slow.steady(&condition).unwrap());
    for (x, y) in a.state.iter().zip(&b.state) {
        // The trims of the set are level to as many digits as they have.
        assert!((x - y).abs() < 1e-5, "{a:?} {b:?}");
    }
    let rates = |model: &Stitched, lat: f64| {
        let (mut work, mut rates) = (model.lookup(), vec![0.0; model.order()]);
        let sticks = [a.sticks[0] + lat, a.sticks[1], a.sticks[2], a.sticks[3]];
        model.rates(&a.state, &sticks, [0.0; 3], [0.0; 3], &mut work, &mut rates);
        rates
    };
    let (nominal, halved) = (rates(&model, 1.0), rates(&slow, 1.0));
    assert!(nominal[3] > 0.01);
    assert!((nominal[3] - 2.0 * halved[3]).abs() < 1e-6, "{nominal:?} {halved:?}");
    assert!((nominal[1] - halved[1]).abs() < 1e-6);
}
