//! The UH-60A against the trims and derivatives of an independent run of
//! J-GenHel's equations; see `docs/validation/uh60a.md`.

use coaxdesign::linear::linearize::linearize;
use coaxdesign::problem::builtin_named;
use coaxdesign::trim::{FlightCondition, Lateral, Options, TrimPoint, sweep};
use coaxdesign::units::KNOT;
use coaxdesign::vehicle::{Layout, Vehicle};

fn trims(speeds: &[f64]) -> (Vehicle, Vec<TrimPoint>) {
    let problem = builtin_named("uh60a").unwrap().problem;
    let vehicle = Vehicle::new(&problem).unwrap();
    let condition = |&knots: &f64| FlightCondition {
        airspeed: knots * KNOT,
        lateral: if knots < 60.0 { Lateral::Sideslip(0.0) } else { Lateral::Bank(0.0) },
        ..FlightCondition::level(0.0)
    };
    let conditions: Vec<FlightCondition> = speeds.iter().map(condition).collect();
    let points = sweep(&vehicle, &conditions, &Options::default(), |_| {}).points;
    (vehicle, points)
}

#[test]
fn shows_trims() {
    let (vehicle, points) = trims(&[0.0, 20.0, 40.0, 60.0, 80.0, 100.0, 120.0, 140.0, 160.0]);
    for point in &points {
        let m = &point.mean_state;
        let body = Layout::BODY;
        let at = |name: &str| m[vehicle.layout.state(name).unwrap()].to_degrees();
        println!(
            "{:5.0} {} {:9.1e} it {:3} st {:4} phi {:6.2} th {:6.2} beta {:6.2} lat {:6.2} lon {:6.2} col {:6.2} ped {:6.2} t0 {:6.2} t1c {:6.2} t1s {:6.2} ttr {:6.2} b0 {:5.2} b1c {:5.2} b1s {:5.2} tb0 {:5.2} T {:7.0} Q {:7.0} Ttr {:6.0} hp {:6.0} imb {:8.1e}",
            point.condition.airspeed / KNOT,
            point.status.word(),
            point.residual_norm,
            point.iterations,
            point.steps,
            m[body.roll].to_degrees(),
            m[body.pitch].to_degrees(),
            point.sideslip.to_degrees(),
            point.sticks[0],
            point.sticks[1],
            point.sticks[2],
            point.sticks[3],
            point.rotors[0].pitch[0].to_degrees(),
            point.rotors[0].pitch[1].to_degrees(),
            point.rotors[0].pitch[2].to_degrees(),
            point.rotors[1].pitch[0].to_degrees() - 5.0,
            at("main.beta_0"),
            at("main.beta_1c"),
            at("main.beta_1s"),
            at("tail.beta_0"),
            point.rotors[0].thrust / 4.4482216,
            point.rotors[0].torque / 1.3558179,
            point.rotors[1].thrust / 4.4482216,
            point.power.shaft / 745.7,
            point.power.imbalance(),
        );
        if !point.on_orbit() {
            println!("{:?}", point.status);
        }
    }
    for index in [0, 4] {
        let Ok(trim) = points[index].clone().into_converged() else { continue };
        let model = linearize(&vehicle, &trim, &Default::default()).unwrap().model.averaged();
        let eigenvalues = model.a().clone().complex_eigenvalues();
        println!("{eigenvalues:.3?}");
        let reduced = coaxdesign::linear::reduction::residualise(
            &model,
            &["u", "v", "w", "p", "q", "r", "phi", "theta"],
        );
        if let Ok(reduced) = reduced {
            println!("{:.4}", reduced.model.a());
            println!("{:.4}", reduced.model.b());
            println!("{:.3?}", reduced.model.a().clone().complex_eigenvalues());
        }
    }
}
