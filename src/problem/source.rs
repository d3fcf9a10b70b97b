//! The texts that a problem was read from, and places in them.

use std::ops::Range;

/// A file that took part in a problem: itself, a base, or an airfoil table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// Name as it is shown: the path as given, or a built-in name.
    pub name: String,
    /// Its whole text.
    pub text: String,
}

/// All files of a problem, in the order they were read.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Sources {
    files: Vec<Source>,
}

/// A stretch of one source.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// Index into [`Sources::files`].
    pub(crate) source: usize,
    /// Byte range in its text.
    pub(crate) span: Range<usize>,
}

impl Sources {
    /// The files, in the order they were read.
    pub fn files(&self) -> &[Source] {
        &self.files
    }

    pub(crate) fn add(&mut self, name: &str, text: String) -> usize {
        self.files.push(Source { name: name.into(), text });
        self.files.len() - 1
    }

    /// The text at a place, cut to what the source holds.
    pub(crate) fn slice(&self, place: &Place) -> &str {
        let text = &self.files[place.source].text;
        let end = place.span.end.min(text.len());
        text.get(place.span.start.min(end)..end).unwrap_or("")
    }

    /// Line and column of a place, both from 1; columns count characters.
    pub fn line_and_column(&self, place: &Place) -> (usize, usize) {
        let text = &self.files[place.source].text;
        let mut at = place.span.start.min(text.len());
        while !text.is_char_boundary(at) {
            at -= 1;
        }
        let before = &text[..at];
        let line = before.matches('\n').count() + 1;
        let start = before.rfind('\n').map_or(0, |newline| newline + 1);
        (line, text[start..at].chars().count() + 1)
    }

    /// The place that covers one line (from 1) of a source, without its end.
    pub(crate) fn line(&self, source: usize, line: usize) -> Place {
        let text = &self.files[source].text;
        let mut start = 0;
        for (index, whole) in text.split_inclusive('\n').enumerate() {
            if index + 1 == line {
                let shown = whole.trim_end();
                return Place { source, span: start..start + shown.len() };
            }
            start += whole.len();
        }
        Place { source, span: text.len()..text.len() }
    }
}
