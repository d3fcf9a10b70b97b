//! Progress on standard error, for a person at a terminal only.

use std::io::IsTerminal as _;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A progress bar that draws nothing when nobody would see it: when standard
/// error is not a terminal, or when the user asked for quiet.
#[derive(Debug, Clone)]
pub struct Progress {
    bar: ProgressBar,
}

impl Progress {
    /// A bar of `length` steps named `task`.
    #[must_use]
    pub fn new(task: &str, length: u64, quiet: bool) -> Self {
        let visible = !quiet && std::io::stderr().is_terminal();
        let target =
            if visible { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(length), target);
        // The template is a constant, so that an error in it is caught by the test.
        if let Ok(style) = ProgressStyle::with_template(TEMPLATE) {
            bar.set_style(style);
        }
        bar.set_message(task.to_string());
        Self { bar }
    }

    /// Whether anyone sees the bar.
    #[must_use]
    pub fn is_visible(&self) -> bool {
        !self.bar.is_hidden()
    }

    /// One step is done. May be called from any thread.
    pub fn advance(&self) {
        self.bar.inc(1);
    }

    /// Steps done so far.
    #[must_use]
    pub fn position(&self) -> u64 {
        self.bar.position()
    }

    /// Says what is being worked on now.
    pub fn say(&self, what: &str) {
        self.bar.set_message(what.to_string());
    }

    /// Writes a line above the bar, and only if the bar is visible.
    pub fn line(&self, text: &str) {
        self.bar.println(text);
    }

    /// Removes the bar.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

const TEMPLATE: &str = "{msg:30!} [{bar:30}] {pos}/{len} {elapsed}";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quiet_is_quiet_and_still_counts() {
        let progress = Progress::new("trim", 3, true);
        assert!(!progress.is_visible());
        progress.advance();
        progress.advance();
        assert_eq!(progress.position(), 2);
        progress.finish();
    }

    #[test]
    fn the_template_is_valid() {
        assert!(ProgressStyle::with_template(TEMPLATE).is_ok());
    }
}
