//! The kept designs are what the code makes of the built-in problems and the
//! specifications beside them.

use coaxdesign::control::axis::Channel;
use coaxdesign::control::models::build;
use coaxdesign::control::plant::{Inversion, ModelSet};
use coaxdesign::control::spec;
use coaxdesign::control::verify::{Row, Verification, verify};
use coaxdesign::problem::{Loaded, builtin_named};
use coaxdesign::schedule::{Schedule, hash};
use coaxdesign::units::KNOT;

/// Trims differ by parts in 10⁷ with the solver's path, which the metrics see
/// some hundredfold; a change of the model or of the gains shows far above.
const TOLERANCE: f64 = 1e-4;

fn read(path: &str) -> String {
    let path = format!("{}/{path}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// A kept design of a built-in problem.
struct Kept {
    /// Its aircraft.
    aircraft: &'static str,
    /// Its directory.
    design: &'static str,
    /// The specification that it is tuned to.
    specification: &'static str,
    /// Two breakpoints and a speed between others at which its models are computed
    /// anew, m/s.
    looked_at: [f64; 3],
}

const COAX2D: [f64; 3] = [20.0 * KNOT, 25.0 * KNOT, 90.0 * KNOT];

const KEPT: [Kept; 4] = [
    Kept {
        aircraft: "coax2d",
        design: "designs/coax2d",
        specification: "problems/hq.toml",
        looked_at: COAX2D,
    },
    Kept {
        aircraft: "coax2d",
        design: "designs/coax2d-level1",
        specification: "problems/hq-level1.toml",
        looked_at: COAX2D,
    },
    Kept {
        aircraft: "uh60a",
        design: "designs/uh60a",
        specification: "problems/hq-uh60a.toml",
        looked_at: [0.0, 45.0 * KNOT, 100.0 * KNOT],
    },
    Kept {
        aircraft: "firefly",
        design: "designs/firefly",
        specification: "problems/hq-multicopter.toml",
        looked_at: [0.0, 3.75, 10.0],
    },
];

impl Kept {
    fn read(&self, name: &str) -> String {
        read(&format!("{}/{name}", self.design))
    }

    fn schedule(&self) -> Schedule {
        Schedule::from_json(&self.read("schedule.json"))
            .unwrap_or_else(|e| panic!("{e}; {}", self.command()))
    }

    fn specification(&self) -> String {
        read(self.specification)
    }

    fn command(&self) -> String {
        format!(
            "regenerate with `coaxdesign tune-gains {} --spec {} -o {} --force`",
            self.aircraft, self.specification, self.design
        )
    }

    fn problem(&self) -> Loaded {
        builtin_named(self.aircraft).unwrap_or_else(|r| panic!("{r}"))
    }
}

/// A design of another problem or specification than those of this tree is
/// stale, whatever its numbers are.
#[test]
fn the_designs_are_of_these_inputs() {
    for kept in KEPT {
        let problem = kept.problem();
        let texts = hash(problem.sources.files().iter().map(|f| f.text.as_str()));
        let (p, command) = (kept.schedule().provenance, kept.command());
        assert_eq!(p.problem_hash, texts, "the problem has changed; {command}");
        let targets = hash([kept.specification().as_str()]);
        assert_eq!(p.specification_hash, targets, "the targets have changed; {command}");
    }
    assert_eq!(KEPT[0].specification(), spec::BUILTIN);
}

/// Every target of the kept designs is met, with Level 1 in every axis for the
/// faster hardware, and no model has been left out.
#[test]
fn the_designs_meet_their_targets() {
    for kept in KEPT {
        let v: serde_json::Value = serde_json::from_str(&kept.read("verification.json")).unwrap();
        assert_eq!(v["passed"], true, "{}", kept.design);
        assert!(v["left_out"].as_array().unwrap().is_empty(), "{}", kept.design);
        assert!(kept.schedule().requirements_met);
    }
    // Usual figures of Level 1: docs/specs.md.
    let level_1 = spec::parse("hq-level1.toml", &KEPT[1].specification()).unwrap();
    let usual =
        [(Channel::Roll, 0.9), (Channel::Pitch, 0.5), (Channel::Yaw, 0.7), (Channel::Heave, 1.0)];
    for (channel, drb) in usual {
        let asked = level_1.channels.iter().find(|c| c.channel == channel).unwrap();
        assert!(asked.spec.nominal.drb.unwrap() >= drb, "{channel:?}");
    }
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

/// Freshly computed models at two breakpoints and between: the same inversion and
/// the same verification as in the files.
#[test]
fn the_designs_are_what_the_code_makes() {
    for kept in KEPT {
        let spec = spec::parse(kept.specification, &kept.specification()).unwrap();
        let built = build(&kept.problem().problem, &spec.models[..1], &kept.looked_at, &|| ())
            .unwrap_or_else(|e| panic!("{}: {e}", kept.design));
        assert!(built.left_out.is_empty());
        assert_eq!(built.set.plants.len(), kept.looked_at.len());
        holds(&kept, &built.set);
    }
}

fn holds(kept: &Kept, set: &ModelSet) {
    let command = kept.command();
    let mut spec = spec::parse(kept.specification, &kept.specification()).unwrap();
    spec.models.truncate(1);
    let verification: Verification = serde_json::from_value({
        let mut v: serde_json::Value =
            serde_json::from_str(&kept.read("verification.json")).unwrap();
        for extra in ["authority", "explanations", "prices", "left_out"] {
            v.as_object_mut().unwrap().remove(extra);
        }
        v
    })
    .unwrap();
    assert!(verification.stability.iter().all(|s| s.passed));
    let table = kept.schedule().law().unwrap();
    for plants in [&set.plants[0], &set.plants[2]] {
        let (fresh, held) =
            (Inversion::new(&plants[0]).unwrap(), table.at(plants[0].speed).inversion);
        for (name, a, b) in [
            ("decoupling", fresh.decoupling, held.decoupling),
            ("allocation", fresh.allocation, held.allocation),
        ] {
            assert!((a - b).amax() < TOLERANCE * b.amax(), "{name} differs: {a}{b}{command}");
        }
        assert!((fresh.feedback - held.feedback).amax() < TOLERANCE * held.feedback.amax());
    }
    let found = verify(&table, set, &spec.hardware, &spec).unwrap();
    assert!(!found.rows.is_empty());
    for r in &found.rows {
        let same = |k: &&Row| {
            k.axis == r.axis && k.model == r.model && (k.speed_m_s - r.speed_m_s).abs() < 1e-6
        };
        let k = verification.rows.iter().find(same).unwrap_or_else(|| {
            panic!("no row for {} at {:.2} m/s; {command}", r.axis, r.speed_m_s)
        });
        for (a, b) in numbers(r).into_iter().zip(numbers(k)) {
            match (a, b) {
                (Some(a), Some(b)) => assert!(
                    (a - b).abs() <= TOLERANCE * b.abs().max(1.0),
                    "{} at {:.2} m/s: {a} now, {b} in the file; {command}",
                    r.axis,
                    r.speed_m_s
                ),
                (a, b) => assert_eq!(a, b, "{} at {:.2} m/s; {command}", r.axis, r.speed_m_s),
            }
        }
        assert_eq!(r.passed, k.passed);
    }
}

/// The kept designs are directories that hold all that made them: the inputs
/// of this tree, to the byte.
#[test]
fn the_designs_hold_their_inputs() {
    use coaxdesign::pipeline::Requirements;
    use coaxdesign::pipeline::directory::{DesignInputs, Note};
    use std::path::Path;
    for kept in KEPT {
        let problem = kept.problem();
        let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join(kept.design);
        let inside = DesignInputs::read(&directory).unwrap_or_else(|e| panic!("{e}")).unwrap();
        let provenance = kept.schedule().provenance;
        assert_eq!(inside.note.aircraft.problem.hash, provenance.problem_hash);
        assert_eq!(inside.note.specification.hash, provenance.specification_hash);
        assert_eq!(inside.requirements.text, kept.specification(), "{}", kept.command());
        let spec = Requirements::parse("spec.toml", &kept.specification()).unwrap();
        let fresh = Note::new(&problem, &spec);
        assert_eq!(inside.note.aircraft, fresh.aircraft, "{}", kept.command());
        for (name, bytes) in fresh.files(&problem, &spec) {
            assert_eq!(std::fs::read(directory.join(&name)).unwrap(), bytes, "{name}");
        }
    }
}
