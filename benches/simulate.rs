//! The paper's manoeuvre, 30 s of flight, under the committed design.

use coaxdesign::problem::builtin_named;
use coaxdesign::schedule::Schedule;
use coaxdesign::simulate::flight::Autopilot;
use coaxdesign::simulate::{Flight, Options, maneuver};
use coaxdesign::trim::{Guess, trim};
use coaxdesign::vehicle::Vehicle;
use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;

fn manoeuvre(criterion: &mut Criterion) {
    let problem = builtin_named("coax2d").expect("a built-in problem").problem;
    let vehicle = Vehicle::new(&problem).expect("a built-in vehicle");
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/designs/coax2d/schedule.json");
    let text = std::fs::read_to_string(path).expect("the committed design");
    let schedule = Schedule::from_json(&text).expect("a schedule");
    let table = schedule.law().expect("a law");
    let law = Autopilot { table, stick_limits: schedule.stick_limits };
    let flown = maneuver::builtin("accel-climb-turn").expect("built in").expect("valid");
    let condition = flown.start.condition;
    let guess = Guess::estimate(&vehicle, &condition);
    let start = trim(&vehicle, condition, &guess, &Default::default())
        .into_converged()
        .expect("a trim to start from");
    let options = Options::new(schedule.hardware, 1.0);
    criterion.bench_function("30 s of the paper's manoeuvre", |bencher| {
        bencher.iter(|| {
            let flight = Flight::new(&vehicle, &start, Some(&law), &flown, &options);
            black_box(flight.map(|mut flight| flight.fly(|_| {})))
        });
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = manoeuvre
}
criterion_main!(benches);
