//! `designs/coax2d` is what the code makes of the built-in problem and
//! specification: `coaxdesign tune-gains -o designs/coax2d --force`.

use coaxdesign::control::models::build;
use coaxdesign::control::plant::Inversion;
use coaxdesign::control::spec;
use coaxdesign::control::verify::{Row, Verification, verify};
use coaxdesign::problem::builtin_named;
use coaxdesign::schedule::{Schedule, hash};
use coaxdesign::units::KNOT;

/// Trims differ by parts in 10⁷ with the solver's path, which the metrics see
/// some hundredfold; a change of the model or of the gains shows far above.
const TOLERANCE: f64 = 1e-4;

const COMMAND: &str = "regenerate with `coaxdesign tune-gains -o designs/coax2d --force`";

fn read(name: &str) -> String {
    let path = format!("{}/designs/coax2d/{name}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"))
}

fn schedule() -> Schedule {
    Schedule::from_json(&read("schedule.json")).unwrap_or_else(|e| panic!("{e}; {COMMAND}"))
}

/// A design of another problem or specification than those of this tree is
/// stale, whatever its numbers are.
#[test]
fn the_design_is_of_these_inputs() {
    let problem = builtin_named("coax2d").unwrap_or_else(|r| panic!("{r}"));
    let p = schedule().provenance;
    let texts = hash(problem.sources.files().iter().map(|f| f.text.as_str()));
    assert_eq!(p.problem_hash, texts, "the problem has changed; {COMMAND}");
    assert_eq!(p.specification_hash, hash([spec::BUILTIN]), "the targets have changed; {COMMAND}");
}

/// Numbers of a row that do not hang on which requirement happens to bind.
fn numbers(r: &Row) -> [Option<f64>; 9] {
    [
        r.drb_rad_s,
        Some(r.drp_db),
        r.crossover_rad_s,
        r.gm_up_db,
        r.gm_down_db,
        r.pm_deg,
        Some(r.disk_margin),
        Some(r.activity),
        r.bandwidth_rad_s,
    ]
}

/// Freshly computed models at two breakpoints and between, from trims that go
/// through the same speeds as those of the design: the same inversion and the
/// same verification as in the files.
#[test]
fn the_design_is_what_the_code_makes() {
    let problem = builtin_named("coax2d").unwrap_or_else(|r| panic!("{r}")).problem;
    let mut spec = spec::builtin().unwrap_or_else(|r| panic!("{r}"));
    let kept: Verification = serde_json::from_value({
        let mut v: serde_json::Value = serde_json::from_str(&read("verification.json")).unwrap();
        for extra in ["authority", "explanations", "prices", "left_out"] {
            v.as_object_mut().unwrap().remove(extra);
        }
        v
    })
    .unwrap();
    let schedule = schedule();
    let table = schedule.law().unwrap();
    assert_eq!(kept.passed, schedule.requirements_met);
    assert!(kept.stability.iter().all(|s| s.passed));

    spec.models.truncate(1);
    let speeds: Vec<f64> = (0..=18).map(|k| 5.0 * f64::from(k) * KNOT).collect();
    let mut built =
        build(&problem, &spec.models, &speeds, &|| ()).unwrap_or_else(|e| panic!("{e}"));
    assert!(built.left_out.is_empty());
    let looked_at = [20.0, 25.0, 90.0].map(|kt| kt * KNOT);
    let near = |speed: f64| looked_at.iter().any(|at| (at - speed).abs() < 1e-6);
    built.set.plants.retain(|plants| near(plants[0].speed));
    assert_eq!(built.set.plants.len(), looked_at.len());
    for plants in [&built.set.plants[0], &built.set.plants[2]] {
        let (fresh, held) =
            (Inversion::new(&plants[0]).unwrap(), table.at(plants[0].speed).inversion);
        for (name, a, b) in [
            ("decoupling", fresh.decoupling, held.decoupling),
            ("allocation", fresh.allocation, held.allocation),
        ] {
            assert!((a - b).amax() < TOLERANCE * b.amax(), "{name} differs: {a}{b}{COMMAND}");
        }
        assert!((fresh.feedback - held.feedback).amax() < TOLERANCE * held.feedback.amax());
    }
    let found = verify(&table, &built.set, &spec.hardware, &spec).unwrap();
    assert!(!found.rows.is_empty());
    for r in &found.rows {
        let same = |k: &&Row| {
            k.axis == r.axis && k.model == r.model && (k.speed_m_s - r.speed_m_s).abs() < 1e-6
        };
        let k = kept.rows.iter().find(same).unwrap_or_else(|| {
            panic!("no row for {} at {:.2} m/s; {COMMAND}", r.axis, r.speed_m_s)
        });
        for (a, b) in numbers(r).into_iter().zip(numbers(k)) {
            match (a, b) {
                (Some(a), Some(b)) => assert!(
                    (a - b).abs() <= TOLERANCE * b.abs().max(1.0),
                    "{} at {:.2} m/s: {a} now, {b} in the file; {COMMAND}",
                    r.axis,
                    r.speed_m_s
                ),
                (a, b) => assert_eq!(a, b, "{} at {:.2} m/s; {COMMAND}", r.axis, r.speed_m_s),
            }
        }
        assert_eq!(r.passed, k.passed);
    }
}
