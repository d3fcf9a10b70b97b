//! Who watches a pipeline at work.

/// What is being worked on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Task {
    /// Trim points; a step is a point.
    Trim,
    /// Trims and linear models; a step is a model at a speed.
    Models,
    /// Gains; one step.
    Tuning,
    /// Metrics of the result; one step.
    Verification,
    /// A flight; a step is a second of it.
    Flight,
}

impl Task {
    /// The task in words, for a progress bar.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Task::Trim => "trimming",
            Task::Models => "trim and linear models",
            Task::Tuning => "tuning",
            Task::Verification => "verification",
            Task::Flight => "flight",
        }
    }
}

/// Hears of progress and can stop the work. Every method may be called from
/// any thread; each does nothing unless it is written anew.
pub trait Observer: Sync {
    /// A task of so many steps begins. Tasks do not overlap.
    fn begin(&self, _task: Task, _steps: u64) {}

    /// A step of the task is done.
    fn advance(&self) {}

    /// The task has ended, whole or not.
    fn end(&self) {}

    /// Whether to stop. It is looked at between trims, models, control periods
    /// of a flight, and tasks; a tuning that has begun is finished. The call
    /// then returns [`PipelineError::Cancelled`](super::PipelineError::Cancelled).
    fn cancelled(&self) -> bool {
        false
    }
}

/// An observer that shows nothing and stops nothing.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Observer for Silent {}

/// Ends a task when it goes out of scope, errors included.
pub(super) struct Running<'a>(&'a dyn Observer);

impl<'a> Running<'a> {
    /// Begins a task, unless it is to be stopped.
    pub fn begin(
        observer: &'a dyn Observer,
        task: Task,
        steps: usize,
    ) -> Result<Self, super::PipelineError> {
        if observer.cancelled() {
            return Err(super::PipelineError::Cancelled);
        }
        observer.begin(task, steps as u64);
        Ok(Self(observer))
    }

    /// An error if the work is to stop.
    pub fn check(&self) -> Result<(), super::PipelineError> {
        if self.0.cancelled() { Err(super::PipelineError::Cancelled) } else { Ok(()) }
    }
}

impl Drop for Running<'_> {
    fn drop(&mut self) {
        self.0.end();
    }
}
