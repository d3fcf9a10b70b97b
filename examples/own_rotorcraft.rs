//! A rotorcraft of one's own: from its file to trims and modes.
//!
//! ```text
//! cargo run --release --example own_rotorcraft [FILE]
//! ```
//!
//! The file that comes with it is a conventional helicopter with a main and a
//! tail rotor.

use coaxdesign::linear::linearize::{Options as LinearOptions, averaged};
use coaxdesign::linear::modes::modes;
use coaxdesign::linear::reduction::{RIGID_BODY, residualise};
use coaxdesign::trim::{FlightCondition, Options, sweep};
use coaxdesign::units::{HORSEPOWER, KNOT};
use coaxdesign::vehicle::{Layout, Vehicle};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let file = std::env::args().nth(1);
    let file = file.as_deref().unwrap_or("examples/light-helicopter.toml");
    // All mistakes of a file come at once, with line and column.
    let loaded = coaxdesign::problem::load(file)?;
    let vehicle = Vehicle::new(&loaded.problem)?;

    // Each point starts from its neighbour.
    let conditions = [0.0, 20.0, 40.0, 60.0].map(|knots| FlightCondition::level(knots * KNOT));
    let trims = sweep(&vehicle, &conditions, &Options::default(), |_| {});

    println!("{}\n", loaded.problem.description);
    println!("speed kt  bank deg  pitch deg  power hp  slowest mode that grows");
    for point in trims.points {
        let body = Layout::BODY;
        let attitude = [body.roll, body.pitch].map(|k| point.mean_state[k].to_degrees());
        let (speed, power) = (point.condition.airspeed / KNOT, point.power.shaft / HORSEPOWER);
        // A trim that did not converge cannot be linearised: the compiler asks.
        let trim = match point.into_converged() {
            Ok(trim) => trim,
            Err(point) => {
                println!("{speed:8.0}  {:?}", point.status);
                continue;
            }
        };
        let full = averaged(&vehicle, &trim, &LinearOptions::default())?;
        let reduced = residualise(&full, &RIGID_BODY)?.model;
        let doubling = modes(&reduced)?
            .iter()
            .filter_map(|mode| mode.time_to_double())
            .max_by(f64::total_cmp)
            .map_or("none".to_string(), |time| format!("doubles in {time:.1} s"));
        println!("{speed:8.0}  {:8.2}  {:9.2}  {power:8.1}  {doubling}", attitude[0], attitude[1]);
    }
    Ok(())
}
