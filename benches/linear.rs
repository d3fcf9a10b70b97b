//! How long linear models take: one periodic model of a trim at hand (target
//! 5 ms), and the whole flight envelope with trims, reductions and frequency
//! responses (target 1.5 s on two cores).

use std::hint::black_box;

use coaxdesign::linear::frequency::{frequency_response, log_grid};
use coaxdesign::linear::linearize::{Options, linearize};
use coaxdesign::linear::reduction::{RIGID_BODY, residualise};
use coaxdesign::problem::builtin;
use coaxdesign::trim::{self, ConvergedTrim, FlightCondition, sweep};
use coaxdesign::units::KNOT;
use coaxdesign::vehicle::Vehicle;
use criterion::{Criterion, criterion_group, criterion_main};
use rayon::prelude::*;

fn vehicle() -> Vehicle {
    let problem = builtin().unwrap_or_else(|report| panic!("{report:?}")).problem;
    Vehicle::new(&problem).unwrap_or_else(|error| panic!("{error}"))
}

fn trims(vehicle: &Vehicle, knots: impl Iterator<Item = f64>) -> Vec<ConvergedTrim> {
    let conditions: Vec<FlightCondition> =
        knots.map(|speed| FlightCondition::level(speed * KNOT)).collect();
    sweep(vehicle, &conditions, &trim::Options::default(), |_| {})
        .points
        .into_iter()
        .map(|point| point.into_converged().unwrap_or_else(|point| panic!("{:?}", point.status)))
        .collect()
}

fn periodic_model(c: &mut Criterion) {
    let vehicle = vehicle();
    for trim in trims(&vehicle, [0.0, 60.0].into_iter()) {
        let knots = trim.point().condition.airspeed / KNOT;
        c.bench_function(&format!("periodic model at {knots:.0} kt"), |bench| {
            bench.iter(|| black_box(linearize(&vehicle, &trim, &Options::default()).unwrap()));
        });
    }
}

fn envelope(c: &mut Criterion) {
    let on = vehicle();
    let off = on.with_interactions(false).unwrap_or_else(|error| panic!("{error}"));
    let omega = log_grid(0.1, 30.0, 200).unwrap();
    let mut group = c.benchmark_group("envelope");
    group.sample_size(10);
    group.bench_function("19 speeds, on and off: trim, linearise, reduce, respond", |bench| {
        bench.iter(|| {
            let models: Vec<_> = [&on, &off]
                .into_par_iter()
                .flat_map(|vehicle| {
                    trims(vehicle, (0..19).map(|k| 5.0 * f64::from(k)))
                        .into_par_iter()
                        .map(|trim| {
                            let full = linearize(vehicle, &trim, &Options::default())
                                .unwrap()
                                .model
                                .averaged();
                            let reduced = residualise(&full, &RIGID_BODY).unwrap();
                            (reduced, frequency_response(&full, &omega).unwrap())
                        })
                        .collect::<Vec<_>>()
                })
                .collect();
            black_box(models)
        });
    });
    group.finish();
}

criterion_group!(benches, periodic_model, envelope);
criterion_main!(benches);
