//! Text of generated files: templates, comments, numbers, and the flat order
//! in which generated code keeps the law's tables.

use super::{Input, Precision};

/// A template with every `@KEY@` replaced.
pub fn fill(template: &str, values: &[(&str, &str)]) -> String {
    values
        .iter()
        .fold(template.to_string(), |text, (key, value)| text.replace(&format!("@{key}@"), value))
}

/// Lines wrapped at blanks to a width, each with a prefix; what follows the
/// first line of an entry is set in.
pub fn comment(lines: &[String], prefix: &str, width: usize) -> String {
    let mut out = String::new();
    for entry in lines {
        // A text from a file must not end the comment it stands in.
        let entry = entry.replace("*/", "* /").replace("--", "- -");
        let mut line = String::new();
        for word in entry.split_whitespace() {
            if !line.trim().is_empty() && prefix.len() + line.len() + 1 + word.len() > width {
                out += &format!("{prefix}{line}\n");
                line = "   ".into();
            }
            if !line.is_empty() {
                line.push(' ');
            }
            line += word;
        }
        out += format!("{prefix}{line}").trim_end();
        out.push('\n');
    }
    out
}

/// The shortest decimal that reads back as the number.
pub fn number(value: f64, precision: Precision) -> String {
    match precision {
        // `+ 0.0` makes −0 to 0: they are the same coefficient.
        Precision::Double => format!("{:?}", value + 0.0),
        Precision::Float => format!("{:?}", value as f32 + 0.0),
    }
}

/// One table in the flat order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// Name of the table.
    pub name: String,
    /// Index of its first entry; entries follow by rows.
    pub offset: usize,
    /// Rows.
    pub rows: usize,
    /// Columns.
    pub columns: usize,
    /// What it is.
    pub meaning: String,
}

/// The law's tables, one list of numbers a breakpoint.
#[derive(Debug, Clone, PartialEq)]
pub struct Flat {
    /// Where each table is.
    pub places: Vec<Place>,
    /// `values[breakpoint][index]`.
    pub values: Vec<Vec<f64>>,
}

impl Flat {
    /// The flat order of the tables that the law needs.
    pub fn new(input: &Input) -> Self {
        let d = input.description;
        let mut places = Vec::new();
        let mut offset = 0;
        for t in d.law_tables() {
            let (rows, columns) = (t.rows.len(), t.columns.len());
            places.push(Place {
                name: t.name.clone(),
                offset,
                rows,
                columns,
                meaning: t.meaning.clone(),
            });
            offset += rows * columns;
        }
        let values = (0..d.speed.values.len())
            .map(|k| d.law_tables().flat_map(|t| t.values[k].iter().flatten().copied()).collect())
            .collect();
        Self { places, values }
    }

    /// Numbers a breakpoint.
    pub fn count(&self) -> usize {
        self.places.iter().map(|p| p.rows * p.columns).sum()
    }
}

/// Numbers in lines of at most a width, each line set in.
pub fn list(numbers: &[String], indent: &str, width: usize) -> String {
    let mut out = String::new();
    let mut line = indent.to_string();
    for n in numbers {
        if line.len() + n.len() + 2 > width && line.len() > indent.len() {
            out += line.trim_end();
            out.push('\n');
            line = indent.to_string();
        }
        line += n;
        line += ", ";
    }
    out += line.trim_end();
    out.push('\n');
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_wrap_and_cannot_end_early() {
        let text = comment(&["one two */ three".into(), "four".into()], " * ", 12);
        assert_eq!(text, " * one two *\n *     /\n *     three\n * four\n");
    }

    #[test]
    fn numbers_read_back() {
        for x in [0.0, -0.0, 1.0 / 3.0, -1e-300, 6.02e23] {
            assert_eq!(number(x, Precision::Double).parse::<f64>().unwrap(), x);
            let single: f32 = number(x, Precision::Float).parse().unwrap();
            assert_eq!(single, x as f32);
        }
        assert_eq!(number(-0.0, Precision::Double), "0.0");
    }
}
