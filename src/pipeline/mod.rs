//! The whole way of a design as library calls: trim, models, tuning,
//! verification, flights.
//!
//! The command line, the tests and bindings to other languages call these
//! functions, so that all of them make the same design.
//!
//! | function | from | to |
//! |---|---|---|
//! | [`trim`] | a problem, conditions | trim points over speed |
//! | [`models`] | a problem, speeds | reduced linear models over speed |
//! | [`plants`] | a problem, a specification, speeds | what tuning and verification work on |
//! | [`tune`] | a problem, [`Requirements`] | [`Tuned`]: schedule, verification, explanations |
//! | [`tune_models`], [`verify_models`] | the same for linear models from elsewhere | |
//! | [`verify`] | a schedule, a problem, a specification | [`Verified`] |
//! | [`fly`] | a problem, a schedule, a [`FlightPlan`] | [`Flown`]: metrics, and every row on the way |
//! | [`Study`] | a problem, a schedule, a [`FlightPlan`] | its runs, one by one, varied |
//! | [`Sweep`] | problems, specifications, a [`SweepPlan`] | a design for each case, one by one |
//! | [`crate::export::export`] | a schedule | files of other programs |
//!
//! Every function takes an [`Observer`], which hears of progress and can stop
//! the work; [`Silent`] does neither. Results do not depend on the observer
//! nor on the number of threads.
//!
//! [`directory`] is the form in which a design keeps all that made it, and
//! [`DirectoryLock`] keeps a second writer out.
//!
//! A schedule with the same bytes as `coaxdesign tune-gains` writes:
//!
//! ```no_run
//! use coaxdesign::pipeline::{Requirements, Silent, TuneOptions, tune};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let aircraft = coaxdesign::problem::load("mine.toml")?;
//! let tuned = tune(&aircraft, &Requirements::builtin()?, &TuneOptions::default(), &Silent)?;
//! std::fs::write("schedule.json", tuned.schedule.to_json()?)?;
//! # Ok(())
//! # }
//! ```

pub mod directory;
mod error;
mod lock;
mod observer;
mod requirements;
mod stages;
mod study;
mod sweep;
mod tuning;

use study::StopOnly;

pub use error::PipelineError;
pub use lock::{DirectoryLock, LockError};
pub use observer::{Observer, Silent, Task};
pub use requirements::{Requirements, models_hash, problem_hash};
pub use stages::{FlightPlan, Flown, fly, fly_models, models, trim};
pub use study::{Part, STUDY_SCHEMA, Study, StudyHead, differences};
pub use sweep::{Case, CaseFiles, SWEEP_SCHEMA, Sweep, SweepError, SweepHead, SweepPlan};
pub use tuning::{
    PRICE_SHOWN, TuneOptions, Tuned, Verified, blade_controls, plants, plants_of_models, tune,
    tune_models, verification_document, verification_speeds, verify, verify_models,
};
