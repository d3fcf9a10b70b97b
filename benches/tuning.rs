//! Joint tuning on the test bed: 10 speeds, four axes, nominal or five models.
//! The split between assembly and the conic solver is printed once each.

use coaxdesign::control::{design, spec, testbed};
use criterion::{Criterion, criterion_group, criterion_main};

fn bench(c: &mut Criterion) {
    let speeds: Vec<f64> = (0..10).map(|k| f64::from(k) * 8.7).collect();
    let mut spec = spec::builtin().expect("the built-in specification is valid");
    spec.channels.retain(|c| !c.channel.is_outer());
    let mut group = c.benchmark_group("tuning");
    group.sample_size(10);
    for (name, robust) in [("10x1x4", false), ("10x5x4", true)] {
        let set = testbed::model_set(&speeds, robust);
        let once = design::design(&spec, &set, &[], &[]).expect("the test bed can be tuned");
        let s = once.tuning.stats;
        println!(
            "{name}: {} programs, at most {} rows, solver {:.2} s, assembly {:.2} s of thread time",
            s.programs, s.largest_rows, s.solver_time, s.assembly_time
        );
        group.bench_function(name, |b| b.iter(|| design::design(&spec, &set, &[], &[])));
    }
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
