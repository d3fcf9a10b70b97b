//! Sweeps: one design for each of many problems or specifications.
//!
//! A sweep changes keys of a problem file or of a specification from case to
//! case, such as the mass and the delay, and tunes a schedule for each; or it
//! verifies one schedule on all of them. As with a [`Study`](super::Study), the
//! head says all that changes a result, and a case is the same wherever and in
//! whichever order it is worked on.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value as Json, json};

use super::study::{Part, differences};
use super::{
    Observer, PipelineError, Requirements, StopOnly, TuneOptions, Tuned, Verified, problem_hash,
    tune, verification_document, verify,
};
use crate::control::axis::Channel;
use crate::problem::{self, Loaded, Report};
use crate::schedule::{Schedule, hash};

/// Schema of a sweep's head and rows.
pub const SWEEP_SCHEMA: &str = "coaxdesign.sweep/1";
/// Most cases of a sweep.
pub const MOST_CASES: usize = 100_000;
/// What a key of the specification begins with.
pub const OF_SPECIFICATION: &str = "spec.";
/// The key whose values are problems.
pub const PROBLEM: &str = "problem";
/// The key whose values are specifications.
pub const SPECIFICATION: &str = "specification";

/// Why a plan makes no sweep.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// Nothing is varied.
    #[error("nothing is varied")]
    Empty,
    /// Too much is varied.
    #[error("there are {cases} cases; at most {MOST_CASES} make a sweep")]
    TooMany {
        /// How many.
        cases: usize,
    },
    /// A key that stands twice, or has no values, or none in one case.
    #[error("the key {key:?}: {message}")]
    Key {
        /// The key.
        key: String,
        /// What is wrong.
        message: String,
    },
    /// A case whose problem or specification is wrong.
    #[error("case {case} ({varied}):\n{report}")]
    Case {
        /// Which, from 0.
        case: usize,
        /// What is varied, for people.
        varied: String,
        /// All that is wrong with it.
        report: Box<Report>,
    },
    /// The schedule cannot be written.
    #[error("the schedule cannot be written: {0}")]
    Schedule(String),
}

/// What is varied: keys, and their values in every case.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SweepPlan {
    /// Keys: of a problem file, such as `mass.mass`; of a specification, such
    /// as `spec.hardware.delay`; `problem` and `specification` themselves.
    pub keys: Vec<String>,
    /// A value of every key for each case, as a problem file would have it.
    pub cases: Vec<Vec<Json>>,
}

impl SweepPlan {
    /// Every combination of values; the last key changes fastest.
    ///
    /// # Errors
    /// Keys without values or that stand twice, and too many cases.
    pub fn grid(factors: &[(String, Vec<Json>)]) -> Result<Self, SweepError> {
        let count = factors.iter().try_fold(1usize, |n, (_, values)| n.checked_mul(values.len()));
        let cases = count.unwrap_or(usize::MAX);
        if cases > MOST_CASES {
            return Err(SweepError::TooMany { cases });
        }
        let mut plan =
            Self { keys: factors.iter().map(|f| f.0.clone()).collect(), cases: vec![Vec::new()] };
        for (key, values) in factors {
            if values.is_empty() {
                return Err(SweepError::Key {
                    key: key.clone(),
                    message: "it has no values".into(),
                });
            }
            plan.cases = plan
                .cases
                .iter()
                .flat_map(|case| {
                    values
                        .iter()
                        .map(|value| [case.as_slice(), std::slice::from_ref(value)].concat())
                })
                .collect();
        }
        plan.check()?;
        Ok(plan)
    }

    fn check(&self) -> Result<(), SweepError> {
        if self.keys.is_empty() || self.cases.is_empty() {
            return Err(SweepError::Empty);
        }
        if self.cases.len() > MOST_CASES {
            return Err(SweepError::TooMany { cases: self.cases.len() });
        }
        for (place, key) in self.keys.iter().enumerate() {
            let wrong =
                |message: &str| Err(SweepError::Key { key: key.clone(), message: message.into() });
            if key.split('.').any(str::is_empty) {
                return wrong("a part of it is empty");
            }
            let below = |other: &String| {
                other == key || other.strip_prefix(key.as_str()).is_some_and(|r| r.starts_with('.'))
            };
            if self.keys.iter().enumerate().any(|(k, other)| k != place && below(other)) {
                return wrong("it is varied twice, by itself or with a key of its table");
            }
        }
        match self.cases.iter().position(|case| case.len() != self.keys.len()) {
            Some(case) => Err(SweepError::Key {
                key: self.keys.last().cloned().unwrap_or_default(),
                message: format!("case {case} has not one value for every key"),
            }),
            None => Ok(()),
        }
    }
}

/// What a sweep is: all that changes a result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SweepHead {
    /// [`SWEEP_SCHEMA`].
    pub schema: String,
    /// Program and version.
    pub generator: String,
    /// Problems, with their bases and tables.
    pub problems: Vec<Part>,
    /// Specifications.
    pub specifications: Vec<Part>,
    /// The schedule, where one is verified instead of tuning for each case.
    pub schedule: Option<Part>,
    /// Outer loops that are tuned; all of the specification where none is named.
    pub channels: Vec<String>,
    /// What is varied.
    pub plan: SweepPlan,
}

impl SweepHead {
    /// Where another head differs, as `path: value there, value here`.
    #[must_use]
    pub fn differences(&self, other: &Self) -> Vec<String> {
        differences(other, self)
    }

    /// Hash of the head: the name of the sweep.
    #[must_use]
    pub fn hash(&self) -> String {
        hash([serde_json::to_string(self).unwrap_or_default().as_str()])
    }
}

/// What a case left: its problem and specification, the schedule and its
/// verification.
#[derive(Debug, Clone)]
pub struct CaseFiles {
    /// The problem, varied.
    pub aircraft: Loaded,
    /// The specification, varied.
    pub requirements: Requirements,
    /// The schedule that was tuned or verified.
    pub schedule: Schedule,
    /// `verification.json`.
    pub verification: Json,
}

/// What a case amounts to.
#[derive(Debug, Clone)]
pub struct Case {
    /// A flat row: `case`, the keys and their values, then what came of it;
    /// [`Sweep::columns`] has names and units.
    pub row: Map<String, Json>,
    /// Its files, where there is a design.
    pub files: Option<Box<CaseFiles>>,
}

/// A sweep that is ready to be worked on.
#[derive(Debug, Clone)]
pub struct Sweep {
    head: SweepHead,
    problems: Vec<Loaded>,
    specifications: Vec<Requirements>,
    schedule: Option<Schedule>,
    options: TuneOptions,
}

/// Columns of what comes of a case, after `case` and the keys, but for those of
/// the axes.
const OUTCOME: [(&str, &str); 12] = [
    ("status", "1"),
    ("reason", "1"),
    ("missed", "1"),
    ("left_out", "1"),
    ("least_margin_percent", "%"),
    ("least_margin_axis", "1"),
    ("least_margin_speed_m_s", "m/s"),
    ("least_margin_model", "1"),
    ("least_gain_margin_db", "dB"),
    ("least_phase_margin_deg", "deg"),
    ("growth_per_s", "1/s"),
    ("authority_used_percent", "%"),
];

impl Sweep {
    /// A sweep over problems and specifications, each with a label. A plan
    /// chooses among several by its keys `problem` and `specification`. With a
    /// schedule, this is verified in every case; without, one is tuned.
    ///
    /// Every value is tried once in a problem or specification, so that a
    /// mistake is said at once.
    ///
    /// # Errors
    /// [`SweepError`].
    pub fn new(
        problems: Vec<(String, Loaded)>,
        specifications: Vec<(String, Requirements)>,
        schedule: Option<Schedule>,
        options: TuneOptions,
        plan: SweepPlan,
    ) -> Result<Self, SweepError> {
        plan.check()?;
        let text = schedule.as_ref().map(Schedule::to_json).transpose();
        let text = text.map_err(|error| SweepError::Schedule(error.to_string()))?;
        let law = schedule.as_ref().zip(text).map(|(schedule, text)| Part {
            name: schedule.name.clone(),
            hash: hash([text.as_str()]),
        });
        let head = SweepHead {
            schema: SWEEP_SCHEMA.into(),
            generator: format!("coaxdesign {}", env!("CARGO_PKG_VERSION")),
            problems: problems
                .iter()
                .map(|(name, p)| Part { name: name.clone(), hash: problem_hash(p) })
                .collect(),
            specifications: specifications
                .iter()
                .map(|(name, s)| Part { name: name.clone(), hash: s.hash() })
                .collect(),
            schedule: law,
            channels: options.channels.iter().map(|c| c.name().to_string()).collect(),
            plan,
        };
        let sweep = Self {
            head,
            problems: problems.into_iter().map(|p| p.1).collect(),
            specifications: specifications.into_iter().map(|s| s.1).collect(),
            schedule,
            options,
        };
        sweep.choices()?;
        for case in sweep.telling() {
            sweep.inputs(case).map_err(|report| SweepError::Case {
                case,
                varied: sweep.varied(case),
                report: Box::new(report),
            })?;
        }
        Ok(sweep)
    }

    /// What the sweep is.
    #[must_use]
    pub fn head(&self) -> &SweepHead {
        &self.head
    }

    /// Names of the row's columns, and their units; `1` for none. Values of
    /// keys are as a file has them, with their units.
    #[must_use]
    pub fn columns(&self) -> Vec<(String, String)> {
        let keys = self.head.plan.keys.iter().map(|key| (key.clone(), "1".to_string()));
        let outcome = OUTCOME.iter().map(|(name, unit)| ((*name).to_string(), (*unit).to_string()));
        let axes =
            Channel::ALL.iter().map(|c| (format!("{}_margin_percent", c.name()), "%".to_string()));
        std::iter::once(("case".to_string(), "1".to_string()))
            .chain(keys)
            .chain(outcome)
            .chain(axes)
            .collect()
    }

    /// The values of a case, for people.
    #[must_use]
    pub fn varied(&self, case: usize) -> String {
        let plan = &self.head.plan;
        let values = plan.keys.iter().zip(&plan.cases[case]).map(|(key, value)| match value {
            Json::String(text) => format!("{key} = {text}"),
            other => format!("{key} = {other}"),
        });
        values.collect::<Vec<_>>().join(", ")
    }

    /// Works on a case. That there is no design is a row too, which says why.
    ///
    /// # Errors
    /// [`PipelineError::Cancelled`] alone.
    ///
    /// # Panics
    /// Where there is no such case.
    pub fn run(&self, case: usize, observer: &dyn Observer) -> Result<Case, PipelineError> {
        let observer = StopOnly(observer);
        match self.attempt(case, &observer) {
            Ok((files, verified)) => {
                let row = self.row(case, Ok(&verified));
                Ok(Case { row, files: Some(Box::new(files)) })
            }
            Err(PipelineError::Cancelled) => Err(PipelineError::Cancelled),
            Err(error) => Ok(Case { row: self.row(case, Err(&error.to_string())), files: None }),
        }
    }

    fn attempt(
        &self,
        case: usize,
        observer: &dyn Observer,
    ) -> Result<(CaseFiles, Verified), PipelineError> {
        let (aircraft, requirements) = self.inputs(case)?;
        let json = |document: Result<Json, serde_json::Error>| document.unwrap_or(Json::Null);
        let (schedule, verification, verified) = match &self.schedule {
            Some(schedule) => {
                let specification = &requirements.specification;
                let verified = verify(schedule, &aircraft.problem, specification, observer)?;
                let document = json(verification_document(&verified, &[], &[]));
                (schedule.clone(), document, verified)
            }
            None => {
                let tuned = tune(&aircraft, &requirements, &self.options, observer)?;
                let document = json(tuned.verification_document());
                let Tuned { schedule, verified, .. } = tuned;
                (schedule, document, verified)
            }
        };
        Ok((CaseFiles { aircraft, requirements, schedule, verification }, verified))
    }

    fn row(&self, case: usize, came: Result<&Verified, &str>) -> Map<String, Json> {
        let plan = &self.head.plan;
        let mut row = Map::new();
        row.insert("case".into(), json!(case));
        row.extend(plan.keys.iter().cloned().zip(plan.cases[case].iter().cloned()));
        for (name, _) in self.columns().into_iter().skip(row.len()) {
            row.insert(name, Json::Null);
        }
        let mut put = |name: &str, value: Json| row[name] = value;
        let verified = match came {
            Ok(verified) => verified,
            Err(reason) => {
                put("status", json!("no_design"));
                put("reason", json!(reason));
                return row;
            }
        };
        let verification = &verified.verification;
        put("status", json!(if verified.met() { "met" } else { "missed" }));
        put("missed", json!(verification.rows.iter().filter(|r| !r.passed).count()));
        put("left_out", json!(verified.left_out.len()));
        let margins =
            || verification.rows.iter().filter_map(|r| Some((r.design_margin_percent?, r)));
        if let Some((least, of)) = margins().min_by(|a, b| a.0.total_cmp(&b.0)) {
            put("least_margin_percent", json!(least));
            put("least_margin_axis", json!(of.axis));
            put("least_margin_speed_m_s", json!(of.speed_m_s));
            put("least_margin_model", json!(of.model));
        }
        let least = |values: &mut dyn Iterator<Item = f64>| values.min_by(f64::total_cmp);
        let rows = &verification.rows;
        let gain = |db: Option<f64>| db.map(f64::abs);
        put(
            "least_gain_margin_db",
            json!(least(
                &mut rows.iter().flat_map(|r| [gain(r.gm_up_db), gain(r.gm_down_db)]).flatten()
            )),
        );
        put("least_phase_margin_deg", json!(least(&mut rows.iter().filter_map(|r| r.pm_deg))));
        let growth = verification.stability.iter().map(|s| s.growth_per_s);
        put("growth_per_s", json!(growth.max_by(f64::total_cmp)));
        let used = verified.authority.iter().map(|a| a.used_percent);
        put("authority_used_percent", json!(used.max_by(f64::total_cmp)));
        for channel in Channel::ALL {
            let name = channel.name();
            let least = least(&mut margins().filter(|m| m.1.axis == name).map(|m| m.0));
            put(&format!("{name}_margin_percent"), json!(least));
        }
        row
    }

    /// Cases that between them have every value of every key.
    fn telling(&self) -> Vec<usize> {
        let plan = &self.head.plan;
        let mut seen: Vec<Vec<&Json>> = vec![Vec::new(); plan.keys.len()];
        let mut found = Vec::new();
        for (index, case) in plan.cases.iter().enumerate() {
            let mut new = false;
            for (known, value) in seen.iter_mut().zip(case) {
                if !known.contains(&value) {
                    known.push(value);
                    new = true;
                }
            }
            if new {
                found.push(index);
            }
        }
        found
    }

    /// That the plan names problems and specifications that are there.
    fn choices(&self) -> Result<(), SweepError> {
        let head = &self.head;
        for (name, parts) in [(PROBLEM, &head.problems), (SPECIFICATION, &head.specifications)] {
            let labels: Vec<&str> = parts.iter().map(|part| part.name.as_str()).collect();
            let wrong = |message: String| SweepError::Key { key: name.into(), message };
            let Some(place) = head.plan.keys.iter().position(|key| key == name) else {
                match labels.len() {
                    1 => continue,
                    count => return Err(wrong(format!("there are {count}, and none is chosen"))),
                }
            };
            for value in head.plan.cases.iter().map(|case| &case[place]) {
                if !value.as_str().is_some_and(|value| labels.contains(&value)) {
                    let known = labels.join(", ");
                    return Err(wrong(format!("there is no {value}; there are {known}")));
                }
            }
        }
        Ok(())
    }

    /// Problem and specification of a case.
    fn inputs(&self, case: usize) -> Result<(Loaded, Requirements), Report> {
        let plan = &self.head.plan;
        let values = || plan.keys.iter().zip(&plan.cases[case]);
        let chosen = |name: &str, parts: &[Part]| {
            let label =
                values().find(|(key, _)| *key == name).and_then(|(_, value)| value.as_str());
            parts.iter().position(|part| Some(part.name.as_str()) == label).unwrap_or(0)
        };
        let base = &self.problems[chosen(PROBLEM, &self.head.problems)];
        let requirements = &self.specifications[chosen(SPECIFICATION, &self.head.specifications)];
        let of_problem: Vec<(&str, &Json)> = values()
            .filter(|(key, _)| {
                *key != PROBLEM && *key != SPECIFICATION && !key.starts_with(OF_SPECIFICATION)
            })
            .map(|(key, value)| (key.as_str(), value))
            .collect();
        let of_specification: Vec<(&str, &Json)> = values()
            .filter_map(|(key, value)| Some((key.strip_prefix(OF_SPECIFICATION)?, value)))
            .collect();
        let aircraft = if of_problem.is_empty() {
            base.clone()
        } else {
            varied_problem(base, case, &of_problem)?
        };
        let requirements = if of_specification.is_empty() {
            requirements.clone()
        } else {
            varied_requirements(requirements, case, &of_specification)?
        };
        Ok((aircraft, requirements))
    }
}

/// Puts values at dotted keys of a table; tables on the way are made. What
/// stands in the way is replaced: the checks of the format say what is wrong.
fn put_all(table: &mut toml::Table, values: &[(&str, &Json)]) {
    for (key, value) in values {
        put(table, key, value);
    }
}

fn put(table: &mut toml::Table, key: &str, value: &Json) {
    let Some((first, rest)) = key.split_once('.') else {
        // Null alone has no form in TOML; it takes a value away.
        match toml::Value::try_from(value) {
            Ok(value) => table.insert(key.to_string(), value),
            Err(_) => table.remove(key),
        };
        return;
    };
    let below = table.entry(first.to_string()).or_insert(toml::Value::Boolean(false));
    if !below.is_table() {
        *below = toml::Value::Table(toml::Table::new());
    }
    if let toml::Value::Table(below) = below {
        put(below, rest, value);
    }
}

/// `name-case-0012.toml` for `name.toml`.
fn case_name(name: &str, case: usize) -> String {
    let stem = Path::new(name).file_stem().map_or("file".into(), |s| s.to_string_lossy());
    format!("{stem}-case-{case:04}.toml")
}

/// A problem that extends the base by some keys.
fn varied_problem(base: &Loaded, case: usize, values: &[(&str, &Json)]) -> Result<Loaded, Report> {
    let mut files: Vec<(String, String)> =
        base.sources.files().iter().map(|file| (file.name.clone(), file.text.clone())).collect();
    let name = files.first().map_or(String::new(), |file| file.0.clone());
    let mut table = toml::Table::new();
    let own = Path::new(&name).file_name().map_or(name.clone(), |n| n.to_string_lossy().into());
    table.insert("extends".into(), toml::Value::String(own));
    put_all(&mut table, values);
    let beside = Path::new(&name).with_file_name(case_name(&name, case));
    files.insert(0, (beside.display().to_string(), table.to_string()));
    problem::reload(&files)
}

/// A specification with some keys changed.
fn varied_requirements(
    base: &Requirements,
    case: usize,
    values: &[(&str, &Json)],
) -> Result<Requirements, Report> {
    // The text has been read before, so it is valid.
    let mut table: toml::Table = base.text.parse().unwrap_or_default();
    put_all(&mut table, values);
    Requirements::parse(&case_name(&base.name, case), &table.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::Silent;

    /// One speed, one model, the inner axes: what is tuned in a second.
    fn small() -> Requirements {
        let mut requirements = Requirements::builtin().unwrap().nominal_only();
        let mut table: toml::Table = requirements.text.parse().unwrap();
        put_all(&mut table, &[("schedule.speeds", &json!(["0 kt"]))]);
        table.remove("models");
        requirements.text = format!("{table}\n[models.nominal]\nclass = \"nominal\"\n");
        Requirements::parse("small.toml", &requirements.text).unwrap()
    }

    fn sweep(plan: SweepPlan, schedule: Option<Schedule>) -> Result<Sweep, SweepError> {
        Sweep::new(
            vec![("coax2d".into(), problem::builtin().unwrap())],
            vec![("small".into(), small())],
            schedule,
            TuneOptions::default(),
            plan,
        )
    }

    fn grid(factors: &[(&str, Json)]) -> SweepPlan {
        let factors: Vec<(String, Vec<Json>)> = factors
            .iter()
            .map(|(key, values)| ((*key).to_string(), values.as_array().unwrap().clone()))
            .collect();
        SweepPlan::grid(&factors).unwrap()
    }

    #[test]
    fn a_grid_has_every_combination_once() {
        let plan = grid(&[("a.b", json!([1, 2])), ("c", json!(["x", "y", "z"]))]);
        assert_eq!(plan.keys, ["a.b", "c"]);
        assert_eq!(plan.cases.len(), 6);
        assert_eq!(plan.cases[4], [json!(2), json!("y")]);
        let refused = |factors: &[(&str, Json)]| {
            let factors: Vec<(String, Vec<Json>)> = factors
                .iter()
                .map(|(k, v)| ((*k).to_string(), v.as_array().unwrap().clone()))
                .collect();
            SweepPlan::grid(&factors).unwrap_err().to_string()
        };
        assert!(refused(&[]).contains("nothing is varied"));
        assert!(refused(&[("a", json!([]))]).contains("has no values"));
        assert!(refused(&[("a", json!([1])), ("a", json!([2]))]).contains("varied twice"));
        assert!(refused(&[("a", json!([1])), ("a.b", json!([2]))]).contains("varied twice"));
        assert!(refused(&[("a..b", json!([1]))]).contains("empty"));
        let many: Vec<Json> = (0..400).map(Json::from).collect();
        let many = json!(many);
        assert!(refused(&[("a", many.clone()), ("b", many)]).contains("160000"));
    }

    /// The case's problem is the base's but for what is varied.
    #[test]
    fn a_case_changes_what_is_varied_and_nothing_else() {
        let plan = grid(&[
            ("mass.mass", json!(["250 kg", "300 kg"])),
            ("spec.hardware.delay", json!(["20 ms"])),
        ]);
        let sweep = sweep(plan, None).unwrap();
        let (aircraft, requirements) = sweep.inputs(1).unwrap();
        let mut expected = problem::builtin().unwrap().problem;
        assert_ne!(expected.mass.mass, 300.0);
        expected.mass.mass = 300.0;
        assert_eq!(format!("{:?}", aircraft.problem), format!("{expected:?}"));
        assert!((requirements.specification.hardware.delay - 0.02).abs() < 1e-12);
        let mut base = small().specification;
        base.hardware.delay = requirements.specification.hardware.delay;
        assert_eq!(requirements.specification, base);
        assert_ne!(problem_hash(&aircraft), problem_hash(&sweep.inputs(0).unwrap().0));
    }

    #[test]
    fn mistakes_are_said_before_anything_runs() {
        let said = |plan| sweep(plan, None).unwrap_err().to_string();
        let unknown = said(grid(&[("mass.mas", json!(["250 kg"]))]));
        assert!(unknown.contains("case 0 (mass.mas = 250 kg)"), "{unknown}");
        assert!(unknown.contains("mass.mas: unknown key"), "{unknown}");
        let unit = said(grid(&[("mass.mass", json!(["250 kg", "250 ft"]))]));
        assert!(unit.contains("case 1"), "{unit}");
        let spec = said(grid(&[("spec.hardware.dely", json!(["20 ms"]))]));
        assert!(spec.contains("delay"), "{spec}");
        let problem = said(grid(&[("problem", json!(["other"]))]));
        assert!(problem.contains("there are coax2d"), "{problem}");
    }

    /// A heavier or later aircraft leaves less margin; a case alone is the case
    /// among others; an aircraft that cannot fly is a row with a reason.
    #[test]
    fn rows_say_what_came_of_each_case() {
        let plan = grid(&[("spec.hardware.delay", json!(["20 ms", "60 ms"]))]);
        let tuned = sweep(plan.clone(), None).unwrap();
        let first = tuned.run(0, &Silent).unwrap();
        let law = first.files.clone().unwrap().schedule;
        assert_eq!(first.row, tuned.run(0, &Silent).unwrap().row);
        let names: Vec<String> = tuned.columns().into_iter().map(|c| c.0).collect();
        assert_eq!(first.row.keys().cloned().collect::<Vec<_>>(), names);
        assert_eq!(first.row["case"], 0);
        assert_eq!(first.row["spec.hardware.delay"], "20 ms");
        // The schedule of the first case, verified with each delay.
        let verified = sweep(plan, Some(law)).unwrap();
        let margins: Vec<f64> = (0..2)
            .map(|k| {
                let row = verified.run(k, &Silent).unwrap().row;
                row["least_phase_margin_deg"].as_f64().unwrap()
            })
            .collect();
        assert!(margins[1] < margins[0] - 1.0, "{margins:?}");
        assert_eq!(
            verified.run(0, &Silent).unwrap().row["least_margin_percent"],
            first.row["least_margin_percent"]
        );
        let heavy = sweep(grid(&[("mass.mass", json!(["5000 kg"]))]), None).unwrap();
        let row = heavy.run(0, &Silent).unwrap().row;
        assert_eq!(row["status"], "no_design");
        assert!(row["reason"].as_str().unwrap().contains("trim"), "{}", row["reason"]);
    }

    /// The head knows everything that changes a row.
    #[test]
    fn the_head_tells_sweeps_apart() {
        let plan = grid(&[("mass.mass", json!(["250 kg"]))]);
        let one = sweep(plan.clone(), None).unwrap();
        assert!(one.head().differences(sweep(plan.clone(), None).unwrap().head()).is_empty());
        let other = sweep(grid(&[("mass.mass", json!(["260 kg"]))]), None).unwrap();
        let found = one.head().differences(other.head()).join("\n");
        assert!(found.contains("cases") && found.contains("260 kg"), "{found}");
        let mut specification = small();
        specification.text += "\n# more\n";
        let third = Sweep::new(
            vec![("coax2d".into(), problem::builtin().unwrap())],
            vec![("small".into(), specification)],
            None,
            TuneOptions { channels: vec![Channel::ALL[4]], explain_all: false },
            plan,
        )
        .unwrap();
        let found = one.head().differences(third.head()).join("\n");
        assert!(found.contains("specifications") && found.contains("channels"), "{found}");
        assert_ne!(one.head().hash(), third.head().hash());
        let text = serde_json::to_string(one.head()).unwrap();
        assert_eq!(&serde_json::from_str::<SweepHead>(&text).unwrap(), one.head());
    }
}
