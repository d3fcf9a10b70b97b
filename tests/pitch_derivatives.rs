//! M_u, M_w and M_q: smooth in speed as a wake moves over the tail, and damped by
//! a rotor whose drive train is soft.

mod common;

use coaxdesign::linear::linearize::{Options as LinearOptions, linearize};
use coaxdesign::linear::reduction::{RIGID_BODY, residualise};
use coaxdesign::problem::{DriveTrain, Problem, Wash, load};
use coaxdesign::trim::{FlightCondition, Options, sweep};
use coaxdesign::vehicle::Vehicle;
use common::{KNOT, coarsened, problem};
use std::path::Path;

const DERIVATIVES: [&str; 3] = ["u", "w", "q"];

/// M_u, M_w and M_q of the quasi-steady model over airspeed.
fn pitch_derivatives(problem: &Problem, speeds: &[f64]) -> Vec<[f64; 3]> {
    let vehicle = Vehicle::new(problem).unwrap();
    let conditions: Vec<_> =
        speeds.iter().map(|speed| FlightCondition::level(speed * KNOT)).collect();
    let points = sweep(&vehicle, &conditions, &Options::default(), |_| {}).points;
    points
        .into_iter()
        .map(|point| {
            let trim = point.into_converged().unwrap_or_else(|p| panic!("{:?}", p.status));
            let linear = linearize(&vehicle, &trim, &LinearOptions::default()).unwrap();
            let model = residualise(&linear.model.averaged(), &RIGID_BODY).unwrap().model;
            DERIVATIVES.map(|column| model.derivative("q", column).unwrap())
        })
        .collect()
}

/// Largest second difference of each over its largest size, over the square of
/// the step, 1/kt².
fn bends(values: &[[f64; 3]], step: f64) -> [f64; 3] {
    std::array::from_fn(|k| {
        let size = values.iter().map(|v| v[k].abs()).fold(0.0, f64::max);
        values
            .windows(3)
            .map(|w| (w[2][k] - 2.0 * w[1][k] + w[0][k]).abs() / (size * step * step))
            .fold(0.0, f64::max)
    })
}

/// Prints the derivatives and holds their bends below a bound, 1/kt².
fn check(name: &str, problem: &Problem, [first, last]: [f64; 2], most: [f64; 3]) {
    let step = 0.5;
    let count = ((last - first) / step).round() as usize;
    let speeds: Vec<f64> = (0..=count).map(|k| first + step * k as f64).collect();
    let values = pitch_derivatives(problem, &speeds);
    for (speed, [u, w, q]) in speeds.iter().zip(&values) {
        println!("{name} {speed:5.1} kt  M_u {u:9.5}  M_w {w:9.5}  M_q {q:9.4}");
    }
    let found = bends(&values, step);
    println!("{name}: {found:.3?} of {most:?}");
    for k in 0..3 {
        assert!(found[k] < most[k], "{name}: M_{}: {} 1/kt^2", DERIVATIVES[k], found[k]);
    }
}

/// The light helicopter with full wash on its tail, edge as given.
fn light_helicopter(edge: f64) -> Problem {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/light-helicopter.toml");
    let problem = load(&path).unwrap_or_else(|report| panic!("{report:?}")).problem;
    let mut problem = coarsened(problem);
    for wing in &mut problem.wings {
        wing.wash = Wash::Full;
    }
    problem.inflow.wash_edge = edge;
    problem
}

/// A finite tail is passed by the rear edge of the wake in slow flight: with the
/// edge's width M_u bends less than half as much as with a sharp one.
#[test]
fn the_rear_edge_of_a_wake_passes_a_tail_smoothly() {
    let wide = light_helicopter(0.15);
    check("light helicopter", &wide, [8.0, 40.0], [0.13, 0.06, 0.01]);
    let speeds: Vec<f64> = (0..=64).map(|k| 8.0 + 0.5 * f64::from(k)).collect();
    let of = |edge: f64| bends(&pitch_derivatives(&light_helicopter(edge), &speeds), 0.5)[0];
    assert!(of(0.15) < 0.5 * of(0.0));
}

/// The front edge of the skewed wake passes the tail of the CoAX 2D between 32
/// and 38 kt. M_q halves and comes back within these six knots, and M_u and M_w
/// have a peak there: it is one of the theory's straight wake, no step.
#[test]
fn the_front_edge_of_a_wake_passes_the_coax_2d_without_a_step() {
    check("CoAX 2D", &coarsened(problem("coax2d-physics")), [28.0, 44.0], [0.5, 0.3, 0.3]);
}

/// A teetering rotor at constant speed loses damping and control power as it
/// flaps; behind a soft drive train it does not. Without flapping both are one.
#[test]
fn a_soft_drive_train_keeps_pitch_damping() {
    let mut problem = light_helicopter(0.15);
    // A forward centre of gravity makes the rotor flap.
    problem.mass.center_of_gravity.fuselage_station -= 0.04;
    let damping = |drive_train: DriveTrain, speed: f64| {
        let mut problem = problem.clone();
        for rotor in &mut problem.rotors {
            rotor.drive_train = drive_train;
        }
        pitch_derivatives(&problem, &[speed])[0][2]
    };
    for speed in [0.0, 30.0] {
        let (soft, held) = (damping(DriveTrain::Soft, speed), damping(DriveTrain::Held, speed));
        println!("{speed} kt: M_q {soft:.4} soft, {held:.4} held");
        assert!(soft < held - 0.01, "{speed}: {soft} {held}");
    }
}
