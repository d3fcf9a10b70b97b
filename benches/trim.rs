//! Trim points, sweeps and linear models of the CoAX 2D; a trim of a hexacopter,
//! at most 5 ms.

use coaxdesign::linear::linearize;
use coaxdesign::problem::builtin_named;
use coaxdesign::trim::{FlightCondition, Guess, Options, sweep, trim};
use coaxdesign::units::KNOT;
use coaxdesign::vehicle::Vehicle;
use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;

fn level(knots: f64) -> FlightCondition {
    FlightCondition::level(knots * KNOT)
}

fn vehicle() -> Vehicle {
    let problem = builtin_named("coax2d").expect("a built-in problem").problem;
    Vehicle::new(&problem).expect("a built-in vehicle")
}

/// A trim from its neighbour 5 kt below.
fn point(criterion: &mut Criterion) {
    let vehicle = vehicle();
    let options = Options::default();
    let start = level(40.0);
    let neighbour = trim(&vehicle, start, &Guess::estimate(&vehicle, &start), &options);
    assert!(neighbour.on_orbit(), "{:?}", neighbour.status);
    let guess = neighbour.guess();
    criterion.bench_function("trim from a neighbour", |bencher| {
        bencher.iter(|| black_box(trim(&vehicle, level(45.0), black_box(&guess), &options)));
    });
}

/// A hexacopter at 5 m/s from nothing.
fn hexacopter(criterion: &mut Criterion) {
    let problem = builtin_named("firefly").expect("a built-in problem").problem;
    let vehicle = Vehicle::new(&problem).expect("a built-in vehicle");
    let condition = FlightCondition::level(5.0);
    criterion.bench_function("trim of a hexacopter", |bencher| {
        bencher.iter(|| {
            let guess = Guess::estimate(&vehicle, &condition);
            black_box(trim(&vehicle, condition, &guess, &Options::default()))
        });
    });
}

/// 19 speeds with interactions on and off, one thread each, from the problem
/// file to the last point: what the command line does.
fn whole_sweep(criterion: &mut Criterion) {
    let conditions: Vec<FlightCondition> = (0..19).map(|k| level(5.0 * f64::from(k))).collect();
    let mut group = criterion.benchmark_group("sweep");
    group.sample_size(10);
    group.bench_function("38 points, vehicle included", |bencher| {
        bencher.iter(|| {
            let on = vehicle();
            let off = on.with_interactions(false).expect("a built-in vehicle");
            let run = |vehicle: &Vehicle| sweep(vehicle, &conditions, &Options::default(), |_| {});
            let (with, without) = rayon::join(|| run(&on), || run(&off));
            assert!(with.all_on_orbit() && without.all_on_orbit());
            black_box((with, without))
        });
    });
    group.finish();
}

/// The periodic linear model of one trim.
fn linear_model(criterion: &mut Criterion) {
    let vehicle = vehicle();
    let condition = level(40.0);
    let guess = Guess::estimate(&vehicle, &condition);
    let point = trim(&vehicle, condition, &guess, &Options::default());
    let orbit = point.into_converged().expect("a trim that converges");
    let options = linearize::Options::default();
    criterion.bench_function("linearize", |bencher| {
        bencher.iter(|| black_box(linearize::linearize(&vehicle, &orbit, &options)));
    });
}

criterion_group!(benches, point, whole_sweep, linear_model, hexacopter);
criterion_main!(benches);
