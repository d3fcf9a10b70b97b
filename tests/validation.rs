//! The validation page: every identity, for all built-in problems; what the
//! paper says of its curves; hypotheses, which a user can repeat.

mod common;
#[path = "common/program.rs"]
mod program;

use std::path::Path;

use coaxdesign::studies::coax2d::appendix::{Condition, appendix};
use coaxdesign::studies::coax2d::claims;
use coaxdesign::studies::coax2d::eigenvalues::pair_eigenvalues;
use coaxdesign::studies::coax2d::hypotheses::{
    BASE, FOLDER, Figure, Findings, HARMONICS, STUDIES, Study,
};
use coaxdesign::trim::{FlightCondition, Options, sweep};
use coaxdesign::validation::{LevelFlight, identities};
use common::{KNOT, problem, vehicle};
use program::{code, err, out};
use serde_json::Value;

#[test]
fn identities_hold() {
    for name in ["coax2d", "coax2d-appendix", "coax2d-physics"] {
        let list = identities(&problem(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(list.len() >= 20, "{name}: only {} identities", list.len());
        for identity in &list {
            println!(
                "{name}: {}, {}: {:.1e} of {:.1e}",
                identity.statement, identity.case, identity.error, identity.tolerance
            );
            assert!(identity.holds(), "{name}: {identity:?}");
        }
    }
}

/// The paper's words about Figs. 13 to 16 and Table 2, on the problem that
/// reproduces it most closely. Those that miss are named on the page.
#[test]
fn val_the_paper_in_words() {
    let problem = problem(BASE);
    let conditions: Vec<FlightCondition> =
        (0..19).map(|k| FlightCondition::level(5.0 * f64::from(k) * KNOT)).collect();
    let points = |on: bool| {
        let mut problem = problem.clone();
        problem.inflow.interactions = on;
        sweep(&vehicle(&problem), &conditions, &Options::default(), |_| {}).points
    };
    let mut claims = claims::trim_claims(&points(true), &points(false));
    let [on, off] = [true, false].map(|on| LevelFlight::of(&problem, 0.0, on).unwrap());
    claims.extend(claims::eigenvalue_claims(&on.reduced, &off.reduced).unwrap());
    let changes = claims::response_changes(&on.averaged, &off.averaged).unwrap();
    claims.extend(claims::response_claims(&changes));
    assert!(claims.len() >= 30, "{}", claims.len());
    let missed: Vec<&str> =
        claims.iter().filter(|claim| !claim.holds()).map(|claim| claim.text.as_str()).collect();
    assert_eq!(missed, MISSED, "{claims:#?}");
}

/// Claims of the paper that our closest reproduction does not bear out.
const MISSED: [&str; 3] = [
    "collective, on over off, largest beyond 60 kt",
    "off: real roots that decay, two at least: rate of the second",
    "heave: gain on over off, least",
];

/// Modes of the printed matrices that ours must meet, of all of them.
#[test]
fn val_printed_eigenvalues() {
    for (condition, knots, met) in [(Condition::Hover, 0.0, 1), (Condition::Forward, 70.0, 2)] {
        let ours = LevelFlight::of(&problem(BASE), knots, true).unwrap().reduced;
        let pairs = pair_eigenvalues(&appendix(condition).unwrap(), &ours).unwrap();
        let agreeing = pairs.iter().filter(|pair| pair.agrees()).count();
        assert!(agreeing >= met, "{condition:?}: {agreeing} of {}: {pairs:#?}", pairs.len());
        // Ours have the printed structure: no pair stands for two real roots.
        for pair in &pairs {
            assert_eq!(pair.printed.im == 0.0, pair.ours.im == 0.0, "{pair:?}");
            assert_eq!(pair.printed.re < 0.0, pair.ours.re < 0.0, "{pair:?}");
        }
    }
}

/// A figure of the page and the command that the page names give the same.
#[test]
fn hypotheses_can_be_repeated_by_a_command() {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    for study in STUDIES.iter().filter(|study| ["rates", "forward"].contains(&study.name)) {
        let findings = study.run().unwrap();
        assert_eq!(findings.trials[0].name, BASE);
        let trial = findings.trials.iter().find(|trial| trial.name != BASE).unwrap();
        let speed = format!("{} kt", study.condition.implied_speed_kt());
        let file = format!("{FOLDER}/{}.toml", trial.name);
        let line = ["linearize", &file, "--speed", &speed, "--reduce", "residualize"];
        let shown = program::program(here, &[&line[..], &["--format", "json", "-q"]].concat());
        assert_eq!(code(&shown), 0, "{}", err(&shown));
        let model: Value = serde_json::from_str(out(&shown)).unwrap();
        let place = |key: &str, name: &str| {
            let list = model[key].as_array().unwrap();
            list.iter().position(|channel| channel["name"] == name)
        };
        for (figure, value) in study.figures.iter().zip(&trial.values) {
            let Figure::Entry(row, column) = *figure else { continue };
            let i = place("states", row).unwrap();
            let entry = match place("states", column) {
                Some(j) => &model["a"][i][j],
                None => &model["b"][i][place("inputs", column).unwrap()],
            };
            let entry = entry.as_f64().unwrap();
            // The trim has another neighbour, and the average is good to 1e-3.
            assert!(
                (entry - value).abs() < 2e-3 * value.abs().max(0.01),
                "{} {figure:?}: {entry} and {value}",
                trial.name
            );
        }
    }
}

/// A study that has been run.
struct Tried {
    study: &'static Study,
    findings: Findings,
}

impl Tried {
    fn new(name: &str) -> Self {
        let study = STUDIES.iter().find(|study| study.name == name).unwrap();
        Self { study, findings: study.run().unwrap() }
    }

    fn place(&self, row: &'static str, column: &'static str) -> usize {
        let entry = Figure::Entry(row, column);
        self.study.figures.iter().position(|figure| *figure == entry).unwrap()
    }

    fn value(&self, trial: &str, row: &'static str, column: &'static str) -> f64 {
        let trial = self.findings.trials.iter().find(|t| t.name == trial).unwrap();
        trial.values[self.place(row, column)]
    }

    fn print(&self, row: &'static str, column: &'static str) -> f64 {
        self.findings.printed[self.place(row, column)]
    }

    fn miss(&self, trial: &str, row: &'static str, column: &'static str) -> f64 {
        (self.value(trial, row, column) - self.print(row, column)).abs()
    }
}

/// What is concluded from the hypotheses on the rate derivatives.
#[test]
fn val_hypotheses_on_rate_derivatives() {
    let rates = Tried::new("rates");
    // The slip of sign brings X_q and M_q nearer to print and moves X_q away
    // from −Y_p, which no right model of a hovering pair does.
    for (row, column) in [("u", "q"), ("q", "q")] {
        assert!(rates.miss(BASE, row, column) < 0.3 * rates.miss("changed-sign", row, column));
    }
    let unlike = |trial| rates.value(trial, "u", "q") + rates.value(trial, "v", "p");
    assert!(unlike("changed-sign").abs() < 0.01 && unlike(BASE) > 0.3);
    // With it all four that the pair's own damping sets are near print: the
    // farthest is Y_p, 10 % off.
    for (row, column) in [("u", "q"), ("v", "p"), ("p", "p"), ("q", "q")] {
        let (miss, print) = (rates.miss(BASE, row, column), rates.print(row, column).abs());
        assert!(miss < 0.12 * print, "({row}, {column}): {miss} of {print}");
    }
    // The slip parts X_p and Y_q as in print the more of the rim the rule of the
    // coefficients sees: converged integrals a strip, circles that hold the rim
    // half of one. Print has 0.2365 and −0.0294.
    let apart = |trial| rates.value(trial, "u", "p") - rates.value(trial, "v", "q");
    let print = rates.print("u", "p") - rates.print("v", "q");
    assert!(apart("changed-sign").abs() < 0.1 * print);
    assert!(apart("changed-sign") < apart("converged-rule"));
    assert!(apart("converged-rule") < apart(BASE) && apart(BASE) < print);
    assert!(rates.value(BASE, "v", "q") < 0.0);
    // Harmonics residualised bring what is left nearer.
    for (row, column) in [("u", "p"), ("q", "p"), ("p", "q")] {
        let [with, without] = [HARMONICS, BASE].map(|trial| rates.miss(trial, row, column));
        assert!(with < without, "({row}, {column}): {with} {without}");
    }
}

/// Half sums and differences that a pair has because it is the same from all
/// sides are near print: X_q and Y_p within 10 %, X_p and Y_q within 20 %, X_v
/// and Y_u within 0.0015 1/s. What tells fore and aft from sideways is the
/// slip's.
#[test]
fn val_what_two_axes_share() {
    let symmetry = STUDIES.iter().find(|study| study.name == "symmetry").unwrap();
    let findings = symmetry.run().unwrap();
    let figures = |name: &str| &findings.trials.iter().find(|t| t.name == name).unwrap().values;
    let (print, ours) = (&findings.printed, figures(BASE));
    for (k, tolerance) in [(0, 0.1 * print[0]), (2, 0.2 * print[2]), (4, 0.0015)] {
        assert!((ours[k] - print[k]).abs() < tolerance, "{k}: {} and {}", ours[k], print[k]);
    }
    // A right pair has nothing to tell its axes apart but the tilt of its shafts.
    let right = figures("changed-sign");
    for apart in [1, 3, 5] {
        assert!(right[apart].abs() < 0.03 * print[apart].abs(), "{apart}: {right:?}");
    }
    assert!((ours[1] - print[1]).abs() < 0.1 * print[1], "{ours:?}");
}

/// Print's Y_r and L_r, within 10 %, are those of the small-angle teeter
/// equation. The exact one leaves the flapped disks where they are when the
/// airframe yaws beneath them: no side force of yaw rate.
#[test]
fn val_hypotheses_on_the_teeter_equation() {
    let yaw = Tried::new("yaw");
    for (row, column) in [("v", "r"), ("p", "r")] {
        assert!(yaw.miss(BASE, row, column) < 0.1 * yaw.print(row, column).abs());
        assert!(yaw.miss("exact-teeter", row, column) > 0.2 * yaw.print(row, column).abs());
    }
    let y_r = yaw.value("exact-teeter", "v", "r");
    assert!(y_r.abs() < 0.001, "{y_r} ft/s");
}

/// Eleven circles give printed thrust and inflow of both rotors, to half a
/// percent and 1.5 %; converged integrals miss the lower rotor's.
#[test]
fn val_hypotheses_on_the_interference_coefficients() {
    let study = STUDIES.iter().find(|study| study.name == "hover").unwrap();
    let findings = study.run().unwrap();
    let off = |name: &str, figure: Figure| {
        let k = study.figures.iter().position(|f| *f == figure).unwrap();
        let trial = findings.trials.iter().find(|t| t.name == name).unwrap();
        (trial.values[k] / findings.printed[k] - 1.0).abs()
    };
    for rotor in [0, 1] {
        assert!(off(BASE, Figure::Thrust(rotor)) < 0.005, "{rotor}");
        assert!(off(BASE, Figure::Inflow(rotor)) < 0.015, "{rotor}");
    }
    assert!(off("converged-rule", Figure::Thrust(1)) > 0.015);
    assert!(off("converged-rule", Figure::Inflow(1)) > 0.025);
}

/// A pair that is the same from all sides has X_v = −Y_u. Print has both of one
/// sign, and the slip of sign with converged coefficients near it: within
/// 0.002 1/s of 0.0098 and 0.0045 1/s.
#[test]
fn val_hypotheses_on_lateral_speed_derivatives() {
    let speed = Tried::new("speed");
    for (row, column) in [("u", "v"), ("v", "u")] {
        let miss = speed.miss("converged-rule", row, column);
        assert!(miss < 0.002, "({row}, {column}): {miss}");
    }
    let sum = speed.value("changed-sign", "u", "v") + speed.value("changed-sign", "v", "u");
    assert!(sum.abs() < 2e-4, "{sum}");
}
