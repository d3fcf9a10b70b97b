//! The texts that a problem was read from, and places in them.

use std::ops::Range;
use std::path::{Path, PathBuf};

/// A file that took part in a problem: itself, a base, or an airfoil table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// Name as it is shown: the path as given, or a built-in name.
    pub name: String,
    /// Where it was read: on disk or among the built-in files; the name where
    /// it is a text alone.
    pub path: PathBuf,
    /// Its whole text.
    pub text: String,
}

/// All files of a problem, in the order they were read.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Sources {
    files: Vec<Source>,
    /// Byte at which each line of each file begins: places are looked up for
    /// every finding, and a file can have many.
    lines: Vec<Vec<usize>>,
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
        self.add_at(name, Path::new(name), text)
    }

    pub(crate) fn add_at(&mut self, name: &str, path: &Path, text: String) -> usize {
        let ends = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n');
        self.lines.push(std::iter::once(0).chain(ends.map(|(at, _)| at + 1)).collect());
        self.files.push(Source { name: name.into(), path: path.into(), text });
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
        let line = self.lines[place.source].partition_point(|start| *start <= at);
        let start = self.lines[place.source][line - 1];
        (line, text[start..at].chars().count() + 1)
    }

    /// Text of a line (from 1) of a source, without its end.
    pub(crate) fn line_text(&self, source: usize, line: usize) -> &str {
        let place = self.line(source, line);
        &self.files[source].text[place.span]
    }

    /// The place that covers one line (from 1) of a source, without its end.
    pub(crate) fn line(&self, source: usize, line: usize) -> Place {
        let text = &self.files[source].text;
        let starts = &self.lines[source];
        let Some(&start) = line.checked_sub(1).and_then(|index| starts.get(index)) else {
            return Place { source, span: text.len()..text.len() };
        };
        let end = starts.get(line).copied().unwrap_or(text.len());
        Place { source, span: start..start + text[start..end].trim_end().len() }
    }
}
