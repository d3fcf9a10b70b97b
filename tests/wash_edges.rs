//! Rotor wash on tails and bodies: as the wake moves over them with speed, what
//! a linear model says of pitch changes smoothly.

mod common;

use coaxdesign::linear::linearize::{Options as LinearOptions, linearize};
use coaxdesign::linear::reduction::{RIGID_BODY, residualise};
use coaxdesign::problem::{Problem, load};
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

/// Around the speed at which the wake leaves the tail.
fn check(name: &str, problem: &Problem, first: f64, count: usize, most: [f64; 3]) {
    let step = 1.0;
    let speeds: Vec<f64> = (0..count).map(|k| first + step * k as f64).collect();
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

fn light_helicopter() -> Problem {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/light-helicopter.toml");
    load(&path).unwrap_or_else(|report| panic!("{report:?}")).problem
}

#[test]
fn the_light_helicopter_keeps_its_derivatives_smooth() {
    check("light helicopter", &coarsened(light_helicopter()), 26.0, 28, [0.1, 0.1, 0.1]);
}

#[test]
fn the_coax_2d_by_physics_keeps_its_derivatives_smooth() {
    check("CoAX 2D", &coarsened(problem("coax2d-physics")), 14.0, 28, [0.1, 0.1, 0.1]);
}
