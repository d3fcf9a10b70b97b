//! Text of generated files: templates, comments, numbers, and the flat order
//! in which generated code keeps the law's tables.

use super::{Input, Precision};
use crate::problem::visible;

/// A template with every `@KEY@` replaced, in one pass: a value that happens to
/// hold a key stays as it is. What is between two `@` and no key stays too.
pub fn fill(template: &str, values: &[(&str, &str)]) -> String {
    let mut out = String::with_capacity(template.len());
    let mut rest = template;
    while let Some(at) = rest.find('@') {
        out += &rest[..at];
        let behind = &rest[at + 1..];
        let found = behind.find('@').and_then(|end| {
            let value = values.iter().find(|(key, _)| *key == &behind[..end])?.1;
            Some((value, &behind[end + 1..]))
        });
        let (value, next) = found.unwrap_or(("@", behind));
        out += value;
        rest = next;
    }
    out + rest
}

/// Lines wrapped at blanks to a width, each with a prefix; what follows the
/// first line of an entry is set in. The text is made harmless by [`remark`].
pub fn comment(lines: &[String], prefix: &str, width: usize) -> String {
    let mut out = String::new();
    for entry in lines {
        let entry = remark(entry);
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

/// A text that can stand in a comment of every language that is written here
/// and ends none of them: C, C++, Rust, Lua, Python (a docstring), MATLAB,
/// XML, and lines behind `#`.
pub fn remark(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut last = ' ';
    for c in visible(text, false).chars() {
        let c = match c {
            // Ends a docstring.
            '"' => '\'',
            // Hides what ends one; at the end of a line joins the next.
            '\\' => '/',
            c => c,
        };
        let acts = matches!(
            (last, c),
            // Ends or begins a comment of C or Rust, or a long one of Lua.
            ('*', '/') | ('/', '*' | '/') | (']', ']') | ('[', '[')
            // Ends one of XML, or begins one of Lua.
            | ('-', '-')
            // C replaces three signs by one.
            | ('?', '?')
        );
        if acts {
            out.push(' ');
        }
        out.push(c);
        last = c;
    }
    out
}

/// A text inside `"..."` of XML.
pub fn xml(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in visible(text, false).chars() {
        match c {
            '&' => out += "&amp;",
            '<' => out += "&lt;",
            '>' => out += "&gt;",
            '"' => out += "&quot;",
            '\'' => out += "&apos;",
            _ => out.push(c),
        }
    }
    out
}

/// A text in quotes that C, Lua and Python read alike.
pub fn quoted(text: &str) -> String {
    format!("\"{}\"", remark(text))
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
    fn a_value_that_holds_a_key_is_not_filled_again() {
        let values = [("NAME", "@CODE@ @NAME@"), ("CODE", "run()")];
        assert_eq!(fill("a @NAME@ b @CODE@", &values), "a @CODE@ @NAME@ b run()");
        assert_eq!(fill("f = @(x) x; @CODE@ @", &values), "f = @(x) x; run() @");
        assert_eq!(fill("@@CODE@@", &values), "@run()@");
    }

    proptest::proptest! {
        /// No text ends the comment or the quotes that it stands in.
        #[test]
        fn texts_stay_where_they_stand(text in "(\\PC|[\"'\\\\*/<>&?\\[\\]\n\r\t\0-]){0,60}") {
            let shown = remark(&text);
            for end in ["*/", "/*", "//", "--", "]]", "[[", "\"", "\\", "??", "\n", "\r"] {
                proptest::prop_assert!(!shown.contains(end), "{end:?} in {shown:?}");
            }
            let quoted = quoted(&text);
            proptest::prop_assert_eq!(quoted.matches('"').count(), 2);
            let escaped = xml(&text);
            proptest::prop_assert!(!escaped.contains(['<', '>', '"', '\'']));
            let document = format!("<a b=\"{escaped}\"/>");
            let mut reader = quick_xml::Reader::from_str(&document);
            let event = reader.read_event().unwrap();
            let quick_xml::events::Event::Empty(element) = event else { panic!("{document}") };
            let value = element.attributes().next().unwrap().unwrap();
            let value = quick_xml::escape::unescape(&value.value).unwrap();
            proptest::prop_assert_eq!(value.as_ref(), visible(&text, false));
        }
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
