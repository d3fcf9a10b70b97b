//! A Monte Carlo study: what it is, and its runs one by one.
//!
//! The runs of a study may be flown by several programs on several machines,
//! and again after an interruption. So its head says all that changes a
//! result, and two files belong together only where their heads are the same.

use std::sync::OnceLock;

use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

use super::{FlightPlan, Observer, PipelineError, fly, fly_models, models_hash, problem_hash};
use crate::lti::LtiSet;
use crate::lti::stitch::{StitchError, Stitched};
use crate::problem::{Loaded, Problem};
use crate::schedule::{Schedule, hash};
use crate::simulate::Options;
use crate::simulate::montecarlo::{Criterion, Parts, Ranges, Run, Variation};

/// Schema of a study's head and rows.
pub const STUDY_SCHEMA: &str = "coaxdesign.montecarlo/2";

/// A thing that a study is made of: its name, and a hash of all it holds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Part {
    /// Name, for people.
    pub name: String,
    /// FNV-1a hash, hexadecimal.
    pub hash: String,
}

/// What a study is: all that changes a result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StudyHead {
    /// [`STUDY_SCHEMA`].
    pub schema: String,
    /// Program and version.
    pub generator: String,
    /// The problem, with its bases and tables; or the set of linear models.
    pub problem: Part,
    /// The schedule, if a law flies.
    pub schedule: Option<Part>,
    /// The manoeuvre.
    pub maneuver: Part,
    /// Control computer, integration, hardware, as a hash of all of them.
    pub simulation: Part,
    /// What is varied in every run alike.
    pub model: Variation,
    /// Number of runs of the whole study.
    pub runs: usize,
    /// Seed of the draws.
    pub seed: u64,
    /// Ranges of what is drawn.
    pub ranges: Ranges,
    /// What makes a run a success.
    pub criterion: Criterion,
}

impl StudyHead {
    /// Where another head differs, as `path: value there, value here`; empty
    /// for the same study.
    #[must_use]
    pub fn differences(&self, other: &Self) -> Vec<String> {
        differences(other, self)
    }

    /// Hash of the head: the name of the study.
    #[must_use]
    pub fn hash(&self) -> String {
        hash([serde_json::to_string(self).unwrap_or_default().as_str()])
    }
}

/// Where what is there differs from what is here, as `path: value there, value
/// here`; empty where both are the same.
#[must_use]
pub fn differences(there: &impl Serialize, here: &impl Serialize) -> Vec<String> {
    let mut found = Vec::new();
    let [there, here] =
        [serde_json::to_value(there), serde_json::to_value(here)].map(Result::unwrap_or_default);
    compare("", &there, &here, &mut found);
    found
}

fn compare(path: &str, there: &Json, here: &Json, found: &mut Vec<String>) {
    if there == here {
        return;
    }
    if let (Json::Object(a), Json::Object(b)) = (there, here) {
        let below = |key: &str| if path.is_empty() { key.into() } else { format!("{path}.{key}") };
        for (key, value) in a {
            compare(&below(key), value, b.get(key).unwrap_or(&Json::Null), found);
        }
        for (key, value) in b.iter().filter(|(key, _)| !a.contains_key(*key)) {
            compare(&below(key), &Json::Null, value, found);
        }
        return;
    }
    found.push(format!("{path}: {there} there, {here} here"));
}

/// What a study flies.
#[derive(Debug, Clone)]
enum Craft {
    Problem(Box<Problem>),
    Models(Box<Stitched>),
}

/// A study that is ready to be flown.
#[derive(Debug, Clone)]
pub struct Study {
    head: StudyHead,
    craft: Craft,
    schedule: Option<Schedule>,
    plan: FlightPlan,
    /// Made with the first run.
    parts: OnceLock<Parts>,
}

/// Hears of nothing but the wish to stop: a run is a step by itself.
pub(super) struct StopOnly<'a>(pub &'a dyn Observer);

impl Observer for StopOnly<'_> {
    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

impl Study {
    /// A study of `runs` flights of a plan, whose variation all have in
    /// common and whose seed is that of the draws.
    ///
    /// # Errors
    /// A schedule that cannot be written, which a schedule that was read can.
    pub fn new(
        aircraft: &Loaded,
        schedule: Option<&Schedule>,
        plan: FlightPlan,
        runs: usize,
        ranges: Ranges,
        criterion: Criterion,
    ) -> Result<Self, PipelineError> {
        let part = Part { name: aircraft.problem.name.clone(), hash: problem_hash(aircraft) };
        let craft = Craft::Problem(Box::new(aircraft.problem.clone()));
        Self::of(craft, part, schedule, plan, runs, ranges, criterion)
    }

    /// As [`Study::new`], with a model stitched from a set of linear ones.
    ///
    /// # Errors
    /// As [`Study::new`], and ranges of what a set does not have.
    pub fn of_models(
        set: &LtiSet,
        model: &Stitched,
        schedule: Option<&Schedule>,
        plan: FlightPlan,
        runs: usize,
        ranges: Ranges,
        criterion: Criterion,
    ) -> Result<Self, PipelineError> {
        // What every run would refuse is refused at once.
        let widest = Variation {
            center_of_gravity: ranges.center_of_gravity,
            inflow: 1.0 + ranges.inflow,
            ..Variation::default()
        };
        plan.variation.with(&widest).stitched(model)?;
        // Mass properties are the specification's, and change results.
        let properties = format!("{:?}", model.inertia());
        let hash = hash([models_hash(set).as_str(), properties.as_str()]);
        let part = Part { name: set.name.clone(), hash };
        let craft = Craft::Models(Box::new(model.clone()));
        Self::of(craft, part, schedule, plan, runs, ranges, criterion)
    }

    fn of(
        craft: Craft,
        aircraft: Part,
        schedule: Option<&Schedule>,
        plan: FlightPlan,
        runs: usize,
        ranges: Ranges,
        criterion: Criterion,
    ) -> Result<Self, PipelineError> {
        let seed = plan.options.seed;
        let part = |name: &str, content: &str| Part { name: name.into(), hash: hash([content]) };
        // The checked manoeuvre and options stand for their texts. The seed
        // stands by itself, and the delay is the variation's.
        let options = Options { seed: 0, extra_delay: 0.0, ..plan.options.clone() };
        let rate = format!("{} Hz", options.control_rate);
        let head = StudyHead {
            schema: STUDY_SCHEMA.into(),
            generator: format!("coaxdesign {}", env!("COAXDESIGN_VERSION")),
            problem: aircraft,
            schedule: schedule
                .map(|schedule| Ok::<_, PipelineError>(part(&schedule.name, &schedule.to_json()?)))
                .transpose()?,
            maneuver: part(&plan.maneuver.title, &format!("{:?}", plan.maneuver)),
            simulation: part(&rate, &format!("{options:?}")),
            model: plan.variation,
            runs,
            seed,
            ranges,
            criterion,
        };
        Ok(Self { head, craft, schedule: schedule.cloned(), plan, parts: OnceLock::new() })
    }

    /// What the study is.
    #[must_use]
    pub fn head(&self) -> &StudyHead {
        &self.head
    }

    /// Flies run `index`, from 0. It is the same whichever other runs are
    /// flown, by whichever machine. A varied aircraft that does not trim is a
    /// run with the status `no_trim`.
    ///
    /// # Errors
    /// A flight that cannot begin, or an observer that stops.
    pub fn run(&self, index: usize, observer: &dyn Observer) -> Result<Run, PipelineError> {
        let head = &self.head;
        let parts = self.parts.get_or_init(|| Parts::new(head.runs, head.seed));
        let (drawn, seed) = parts.draw(index, &head.ranges);
        let variation = head.model.with(&drawn);
        let plan = FlightPlan {
            maneuver: self.plan.maneuver.clone(),
            variation,
            options: Options { seed, ..self.plan.options.clone() },
            // No history.
            every: u64::MAX,
        };
        let nothing = |_: &[_], _: &[f64]| Ok(());
        let schedule = self.schedule.as_ref();
        let observer = StopOnly(observer);
        let flown = match &self.craft {
            Craft::Problem(problem) => fly(problem, schedule, &plan, &observer, nothing),
            Craft::Models(model) => fly_models(model, schedule, &plan, &observer, nothing),
        };
        match flown {
            Ok(flown) => {
                let mut run = Run::flown(index, seed, variation, &flown.metrics);
                run.success = head.criterion.met(&run);
                Ok(run)
            }
            Err(PipelineError::NoTrim(_) | PipelineError::Stitch(StitchError::Trim { .. })) => {
                Ok(Run::without_trim(index, seed, variation))
            }
            Err(error) => Err(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::Silent;
    use crate::simulate::maneuver;

    const TEXT: &str = "title = \"t\"\nduration = \"0.2 s\"\nmode = \"open_loop\"\n";

    fn study(model: Variation, text: &str, seed: u64, runs: usize) -> Study {
        let aircraft = crate::problem::builtin().unwrap();
        let mut plan = FlightPlan::new(maneuver::parse("t", text).unwrap(), None).unwrap();
        plan.variation = model;
        plan.options.seed = seed;
        let criterion = Criterion { velocity_peak: 5.0, saturated: 0.5 };
        Study::new(&aircraft, None, plan, runs, Ranges::default(), criterion).unwrap()
    }

    /// Each thing that changes a result shows in the head, by its name.
    #[test]
    fn a_head_names_what_differs() {
        let nominal = study(Variation::default(), TEXT, 1, 4);
        let here = nominal.head();
        assert_eq!(here.differences(here), Vec::<String>::new());
        let d = Variation::default();
        for (name, model) in [
            ("model.mass", Variation { mass: 1.1, ..d }),
            ("model.inertia", Variation { inertia: 1.1, ..d }),
            ("model.center_of_gravity", Variation { center_of_gravity: 0.01, ..d }),
            ("model.inflow", Variation { inflow: 0.9, ..d }),
            ("model.governor", Variation { governor: Some(1.0), ..d }),
            ("model.interactions", Variation { interactions: Some(false), ..d }),
            ("model.turbulence", Variation { turbulence: Some(1.0), ..d }),
            ("model.delay", Variation { delay: 0.01, ..d }),
            ("model.gust", Variation { gust: [1.0, 0.0, 0.0], ..d }),
        ] {
            let other = study(model, TEXT, 1, 4);
            let found = here.differences(other.head());
            assert_eq!(found.len(), 1, "{found:?}");
            assert!(found[0].starts_with(&format!("{name}: ")), "{found:?}");
            assert_ne!(here.hash(), other.head().hash());
        }
        let other = study(d, &TEXT.replace("0.2", "0.3"), 2, 5);
        let found = here.differences(other.head());
        let names: Vec<&str> = found.iter().filter_map(|text| text.split(':').next()).collect();
        assert_eq!(names, ["maneuver.hash", "runs", "seed"]);
        let mut other = here.clone();
        other.generator = "coaxdesign 99".into();
        assert!(here.differences(&other)[0].starts_with("generator: \"coaxdesign 99\" there"));
    }

    #[test]
    fn a_run_is_the_same_alone_and_again() {
        let study = study(Variation::default(), TEXT, 3, 50);
        let run = study.run(7, &Silent).unwrap();
        assert_eq!(run, study.run(7, &Silent).unwrap());
        assert_eq!(run.run, 7);
        assert_eq!(run.status, "completed");
        assert_ne!(run, study.run(8, &Silent).unwrap());
    }

    /// What all runs have in common comes on top of what is drawn.
    #[test]
    fn the_common_variation_is_on_top() {
        let heavy = Variation { mass: 1.2, delay: 0.01, ..Variation::default() };
        let (a, b) = (study(Variation::default(), TEXT, 3, 9), study(heavy, TEXT, 3, 9));
        let (a, b) = (a.run(2, &Silent).unwrap(), b.run(2, &Silent).unwrap());
        assert!((b.variation.mass / a.variation.mass - 1.2).abs() < 1e-12);
        assert!((b.variation.delay - a.variation.delay - 0.01).abs() < 1e-12);
        assert_eq!(a.seed, b.seed);
    }
}
