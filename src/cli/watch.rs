//! Progress of the pipeline on standard error.

use std::sync::Mutex;

use coaxdesign::pipeline::{Observer, Task};
use coaxdesign::report::progress::Progress;

/// Shows every task as a bar, for a person at a terminal.
#[derive(Debug, Default)]
pub struct Watch {
    quiet: bool,
    bar: Mutex<Option<Progress>>,
}

impl Watch {
    /// A watch that shows nothing where `quiet`.
    pub fn new(quiet: bool) -> Self {
        Self { quiet, bar: Mutex::default() }
    }

    fn with_bar(&self, action: impl FnOnce(&mut Option<Progress>)) {
        // A bar that a panic left behind is as good as any.
        action(&mut self.bar.lock().unwrap_or_else(std::sync::PoisonError::into_inner));
    }
}

impl Observer for Watch {
    fn begin(&self, task: Task, steps: u64) {
        self.with_bar(|bar| *bar = Some(Progress::new(task.name(), steps, self.quiet)));
    }

    fn advance(&self) {
        self.with_bar(|bar| bar.iter().for_each(Progress::advance));
    }

    fn end(&self) {
        self.with_bar(|bar| bar.take().iter().for_each(Progress::finish));
    }
}
