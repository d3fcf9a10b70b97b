//! What is wrong, or odd, about a problem file, in the user's terms.

use std::fmt;

use super::source::{Place, Sources};
use super::text::visible;

/// Whether a finding stops the work.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Severity {
    /// The problem cannot be used.
    Error,
    /// The problem can be used, but something about it is odd.
    Warning,
}

/// One finding.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Diagnostic {
    /// Whether it stops the work.
    pub severity: Severity,
    /// File name, line and column (from 1); line 0 where the whole file is meant.
    pub file: String,
    /// Line, from 1; 0 for the whole file.
    pub line: usize,
    /// Column in characters, from 1; 0 for the whole file.
    pub column: usize,
    /// Key path such as `rotors.upper.radius`; empty where there is none.
    pub key: String,
    /// What is wrong.
    pub message: String,
    /// What to write instead.
    pub help: String,
    /// Source line, column of the mark on it, and number of characters to mark.
    excerpt: Option<(String, usize, usize)>,
    /// Order of the file among the sources.
    order: usize,
}

impl Diagnostic {
    /// A finding at a place.
    pub(crate) fn at(
        severity: Severity,
        sources: &Sources,
        place: &Place,
        key: &str,
        message: String,
        help: String,
    ) -> Self {
        let (line, column) = sources.line_and_column(place);
        let source = &sources.files()[place.source];
        let (text, excerpt_column, marked) =
            excerpt(sources.line_text(place.source, line), column, {
                sources.slice(place).lines().next().map_or(0, |first| first.chars().count()).max(1)
            });
        Self {
            severity,
            file: source.name.clone(),
            line,
            column,
            key: key.into(),
            message,
            help,
            excerpt: Some((text, excerpt_column, marked)),
            order: place.source,
        }
    }

    /// A finding about a whole file.
    pub(crate) fn whole_file(file: &str, message: String, help: String) -> Self {
        Self {
            severity: Severity::Error,
            file: file.into(),
            line: 0,
            column: 0,
            key: String::new(),
            message,
            help,
            excerpt: None,
            order: 0,
        }
    }

    /// The finding as lines of text, with ANSI colour on request.
    pub fn render(&self, color: bool) -> String {
        let (bold, red, blue, off) = match (color, self.severity) {
            (false, _) => ("", "", "", ""),
            (true, Severity::Error) => ("\x1b[1m", "\x1b[1;31m", "\x1b[1;34m", "\x1b[0m"),
            (true, Severity::Warning) => ("\x1b[1m", "\x1b[1;33m", "\x1b[1;34m", "\x1b[0m"),
        };
        let word = match self.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
        };
        let shown = |text: &str| visible(text, false);
        let mut text = format!("{bold}{}", shown(&self.file));
        if self.line > 0 {
            text += &format!(":{}:{}", self.line, self.column);
        }
        text += &format!(": {red}{word}{off}{bold}: ");
        if !self.key.is_empty() {
            text += &format!("{}: ", shown(&self.key));
        }
        text += &format!("{}{off}\n", shown(&self.message));
        if let Some((line, column, marked)) = &self.excerpt {
            let number = self.line.to_string();
            let gutter = " ".repeat(number.len());
            // Tabs stay tabs, so that the mark stands below what it marks.
            let indent: String =
                line.chars().take(column - 1).map(|c| if c == '\t' { '\t' } else { ' ' }).collect();
            let room = line.chars().count().saturating_sub(column - 1).max(1);
            let marks = "^".repeat((*marked).min(room));
            text += &format!("  {blue}{number} |{off} {line}\n");
            text += &format!("  {blue}{gutter} |{off} {indent}{red}{marks}{off}\n");
        }
        if !self.help.is_empty() {
            text += &format!("  {blue}help:{off} {}\n", shown(&self.help));
        }
        text
    }
}

/// Longest line of a file that is shown whole, in characters.
const LONGEST_EXCERPT: usize = 400;

/// A line as a terminal can show it, with the column of a mark on it: a longer
/// one is cut to what is around the mark.
fn excerpt(line: &str, column: usize, marked: usize) -> (String, usize, usize) {
    if line.len() <= LONGEST_EXCERPT {
        return (visible(line, true), column, marked);
    }
    let before = (column - 1).min(LONGEST_EXCERPT / 4);
    let from = column - 1 - before;
    let cut: String = line.chars().skip(from).take(LONGEST_EXCERPT).collect();
    (visible(&cut, true), before + 1, marked.min(LONGEST_EXCERPT - before))
}

/// Every error of a problem file and of the files it uses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Report {
    /// Errors, by file and line.
    pub errors: Vec<Diagnostic>,
    /// Warnings found on the way.
    pub warnings: Vec<Diagnostic>,
    /// Whether the cause is that a file could not be read at all.
    pub unreadable: bool,
}

impl Report {
    pub(crate) fn new(mut findings: Vec<Diagnostic>, unreadable: bool) -> Self {
        sort(&mut findings);
        let (errors, warnings) =
            findings.into_iter().partition(|finding| finding.severity == Severity::Error);
        Self { errors, warnings, unreadable }
    }

    /// The report as text, with ANSI colour on request.
    pub fn render(&self, color: bool) -> String {
        let mut text = String::new();
        for findings in [&self.errors, &self.warnings] {
            for finding in findings.iter().take(MOST_SHOWN) {
                text += &finding.render(color);
                text.push('\n');
            }
            if let Some(more) = findings.len().checked_sub(MOST_SHOWN).filter(|more| *more > 0) {
                text += &format!("... and {more} more like these\n\n");
            }
        }
        let plural = |count: usize, noun: &str| match count {
            1 => format!("1 {noun}"),
            _ => format!("{count} {noun}s"),
        };
        text += &plural(self.errors.len(), "error");
        if !self.warnings.is_empty() {
            text += &format!(", {}", plural(self.warnings.len(), "warning"));
        }
        text.push('\n');
        text
    }
}

/// Most errors, and most warnings, that are shown: who mends these knows the
/// others.
const MOST_SHOWN: usize = 100;

/// Puts findings in the order of the files, from top to bottom.
pub(crate) fn sort(findings: &mut [Diagnostic]) {
    findings.sort_by_key(|finding| (finding.order, finding.line, finding.column));
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render(false))
    }
}

impl std::error::Error for Report {}
