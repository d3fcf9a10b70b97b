//! What a schedule may hold: every number within bounds, limits in order, names
//! that every export can hold.
//!
//! A schedule is looked at as the file it is, key by key, so that no number is
//! left out, whatever the law grows to hold. A finding names its place as a
//! JSON pointer (RFC 6901) and, where the text is at hand, its line.

use std::fmt;

use serde_json::Value;

use super::Schedule;
use crate::problem::{TextFault, check_line, check_name, visible};

/// One thing that is wrong with a schedule.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Finding {
    /// Where, as a JSON pointer such as `/points/3/speed`.
    pub pointer: String,
    /// Line of the file, from 1, where it is known.
    pub line: Option<usize>,
    /// What is wrong, and what is expected.
    pub message: String,
}

/// Everything that is wrong with a schedule; at least one thing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Findings(pub Vec<Finding>);

/// Most findings that a message shows.
const MOST_SHOWN: usize = 8;

impl fmt::Display for Findings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, finding) in self.0.iter().take(MOST_SHOWN).enumerate() {
            if index > 0 {
                f.write_str("; ")?;
            }
            if let Some(line) = finding.line {
                write!(f, "line {line}, ")?;
            }
            write!(f, "{}: {}", visible(&finding.pointer, false), finding.message)?;
        }
        match self.0.len().checked_sub(MOST_SHOWN) {
            Some(more) if more > 0 => write!(f, "; and {more} more"),
            _ => Ok(()),
        }
    }
}

impl std::error::Error for Findings {}

/// Most breakpoints: each costs a table of every matrix in generated code.
const MOST_POINTS: usize = 1000;
/// Least distance of two breakpoints, m/s: closer ones are one speed given
/// twice, and the slope between them is that of rounding.
const LEAST_SPACING: f64 = 1e-6;
/// Least distance of two limits, %.
const LEAST_TRAVEL: f64 = 1e-3;
/// Bound of every number without one of its own: far beyond the largest entry
/// of any law, and so small that no sum of products of them overflows.
const LARGEST: f64 = 1e9;

/// Bounds of a number: the end of its pointer, least and largest, unit.
const BOUNDS: [(&str, f64, f64, &str); 17] = [
    ("/law/kappa", 0.0, 1.0, ""),
    ("/law/reference_delay", 0.0, 1.0, " s"),
    ("/law/roll_frequency", 0.01, 100.0, " rad/s"),
    ("/law/pitch_frequency", 0.01, 100.0, " rad/s"),
    ("/law/attitude_damping", 0.05, 10.0, ""),
    ("/law/yaw_time_constant", 0.001, 100.0, " s"),
    ("/law/heave_time_constant", 0.001, 100.0, " s"),
    ("/turn_coordination_speed", 0.0, 300.0, " m/s"),
    ("/turn_coordination_width", 0.001, 300.0, " m/s"),
    ("/hardware/actuator_bandwidth", 0.01, 1e5, " rad/s"),
    ("/hardware/actuator_damping", 0.05, 10.0, ""),
    ("/hardware/delay", 0.0, 1.0, " s"),
    ("/hardware/sensor_bandwidth", 0.01, 1e5, " rad/s"),
    ("/trim/roll", -3.2, 3.2, " rad"),
    ("/trim/pitch", -1.6, 1.6, " rad"),
    // True airspeed of a breakpoint.
    ("/speed", -100.0, 300.0, " m/s"),
    // Places in these lists follow.
    ("/trim/sticks", -1000.0, 1000.0, " %"),
];

/// Everything that is wrong with a schedule; empty if nothing is.
pub(super) fn check(schedule: &Schedule) -> Vec<Finding> {
    let mut found = Vec::new();
    let value = match serde_json::to_value(schedule) {
        Ok(value) => value,
        Err(error) => {
            found.push(finding("", format!("it cannot be written: {error}")));
            return found;
        }
    };
    walk(&value, &mut String::new(), &mut found);
    let mut text = |pointer: &str, text: &str, check: fn(&str) -> Result<(), TextFault>| {
        if let Err(fault) = check(text) {
            let help = "a name holds letters from A to Z, digits, blanks and `-_.`";
            let help = if pointer == "/name" { format!(" ({help})") } else { String::new() };
            found.push(finding(pointer, format!("{fault}{help}")));
        }
    };
    text("/name", &schedule.name, check_name);
    text("/provenance/generator", &schedule.provenance.generator, check_line);
    text("/provenance/problem_hash", &schedule.provenance.problem_hash, check_name);
    text("/provenance/specification_hash", &schedule.provenance.specification_hash, check_name);
    text("/interpolation", &schedule.interpolation, check_line);
    for (quantity, unit) in &schedule.units {
        let pointer = format!("/units/{}", escaped(quantity));
        text(&pointer, quantity, check_line);
        text(&pointer, unit, check_line);
    }
    for (index, [low, high]) in schedule.stick_limits.iter().enumerate() {
        let pointer = format!("/stick_limits/{index}");
        if high - low < LEAST_TRAVEL {
            found.push(finding(
                &pointer,
                format!("the lower limit {low} % is not below the upper, {high} %"),
            ));
        }
    }
    let points = &schedule.points;
    if points.is_empty() {
        found.push(finding("/points", "there is no breakpoint".into()));
    }
    if points.len() > MOST_POINTS {
        let message = format!("{} breakpoints where {MOST_POINTS} are the most", points.len());
        found.push(finding("/points", message));
    }
    for (index, pair) in points.windows(2).enumerate() {
        // Numbers that are none have been found above.
        if pair[1].speed - pair[0].speed < LEAST_SPACING {
            found.push(finding(
                &format!("/points/{}/speed", index + 1),
                format!(
                    "{} m/s follows {} m/s: speeds must increase strictly",
                    pair[1].speed, pair[0].speed
                ),
            ));
        }
    }
    found
}

fn finding(pointer: &str, message: String) -> Finding {
    Finding { pointer: pointer.into(), line: None, message }
}

/// A key as a part of a JSON pointer.
fn escaped(key: &str) -> String {
    key.replace('~', "~0").replace('/', "~1")
}

/// Looks at every number.
fn walk(value: &Value, pointer: &mut String, found: &mut Vec<Finding>) {
    let length = pointer.len();
    match value {
        Value::Object(entries) => {
            for (key, value) in entries {
                pointer.push('/');
                *pointer += &escaped(key);
                walk(value, pointer, found);
                pointer.truncate(length);
            }
        }
        Value::Array(items) => {
            for (index, value) in items.iter().enumerate() {
                *pointer += &format!("/{index}");
                walk(value, pointer, found);
                pointer.truncate(length);
            }
        }
        // A number that is none is written as `null`.
        Value::Null => found.push(finding(pointer, "a number that is not finite".into())),
        Value::Number(number) => {
            let number = number.as_f64().unwrap_or(f64::NAN);
            let (low, high, unit) = bounds(pointer);
            if !(low..=high).contains(&number) {
                let message = format!("{number:?}{unit}; expected {low} to {high}{unit}");
                found.push(finding(pointer, message));
            }
        }
        Value::Bool(_) | Value::String(_) => {}
    }
}

/// Bounds and unit of the number at a pointer.
fn bounds(pointer: &str) -> (f64, f64, &'static str) {
    // The place in a list says nothing of its bounds.
    let named = pointer.trim_end_matches(|c: char| c.is_ascii_digit() || c == '/');
    let of = |path: &str| BOUNDS.iter().find(|(end, ..)| path.ends_with(end));
    match of(pointer).or_else(|| of(named)) {
        Some(&(_, low, high, unit)) => (low, high, unit),
        None if named.ends_with("/stick_limits") => (-1000.0, 1000.0, " %"),
        None => (-LARGEST, LARGEST, ""),
    }
}

/// The line, from 1, on which the value at a JSON pointer begins in a text that
/// is known to be JSON; `None` where there is no such value.
pub(super) fn line_of(text: &str, pointer: &str) -> Option<usize> {
    let mut scanner = Scanner { bytes: text.as_bytes(), at: 0 };
    let unescape = |part: &str| part.replace("~1", "/").replace("~0", "~");
    for part in pointer.split('/').skip(1) {
        scanner.enter(&unescape(part))?;
    }
    scanner.blanks();
    let before = &scanner.bytes[..scanner.at.min(scanner.bytes.len())];
    Some(before.iter().filter(|byte| **byte == b'\n').count() + 1)
}

/// Walks over JSON without reading it.
struct Scanner<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Scanner<'_> {
    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    fn blanks(&mut self) {
        while self.peek().is_some_and(|byte| byte.is_ascii_whitespace()) {
            self.at += 1;
        }
    }

    /// The text of a string at this place, and the place behind it.
    fn string(&mut self) -> Option<String> {
        let from = self.at;
        self.skip()?;
        serde_json::from_slice(&self.bytes[from..self.at]).ok()
    }

    /// To the place behind the value that begins here.
    fn skip(&mut self) -> Option<()> {
        self.blanks();
        let mut depth = 0usize;
        loop {
            match self.peek()? {
                b'"' => {
                    self.at += 1;
                    while self.peek()? != b'"' {
                        self.at += if self.peek()? == b'\\' { 2 } else { 1 };
                    }
                }
                b'{' | b'[' => depth += 1,
                b'}' | b']' => depth = depth.checked_sub(1)?,
                byte if depth == 0 && !byte.is_ascii_whitespace() && byte != b',' => {
                    // A bare word or a number.
                    while self
                        .peek()
                        .is_some_and(|byte| byte.is_ascii_alphanumeric() || b"+-.".contains(&byte))
                    {
                        self.at += 1;
                    }
                    return Some(());
                }
                _ => {}
            }
            self.at += 1;
            if depth == 0 {
                return Some(());
            }
        }
    }

    /// To the value of a key, or at an index.
    fn enter(&mut self, part: &str) -> Option<()> {
        self.blanks();
        let open = self.peek()?;
        self.at += 1;
        let mut index = 0;
        loop {
            self.blanks();
            if matches!(self.peek()?, b'}' | b']') {
                return None;
            }
            let meant = if open == b'{' {
                let key = self.string()?;
                self.blanks();
                if self.peek()? != b':' {
                    return None;
                }
                self.at += 1;
                self.blanks();
                key == part
            } else {
                part.parse() == Ok(index)
            };
            if meant {
                return Some(());
            }
            let before = self.at;
            self.skip()?;
            self.blanks();
            if self.peek()? == b',' {
                self.at += 1;
            }
            if self.at == before {
                return None;
            }
            index += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::schedule;
    use super::super::{Schedule, ScheduleError};
    use super::*;

    /// The findings of a schedule's text with one value replaced.
    fn findings(pointer: &str, value: Value) -> Vec<Finding> {
        let mut json: Value = serde_json::to_value(schedule()).unwrap();
        *json.pointer_mut(pointer).unwrap_or_else(|| panic!("{pointer}")) = value;
        let text = serde_json::to_string_pretty(&json).unwrap();
        match Schedule::from_json(&text) {
            Err(ScheduleError::Findings(findings)) => findings.0,
            other => panic!("{pointer}: {other:?}"),
        }
    }

    /// What went wrong in trials, and its kind.
    #[test]
    fn absurd_values_are_refused_with_their_place() {
        for (pointer, value, part) in [
            ("/stick_limits/0", serde_json::json!([100.0, -100.0]), "not below the upper"),
            ("/stick_limits/2", serde_json::json!([5.0, 5.0]), "not below the upper"),
            ("/stick_limits/1/0", serde_json::json!(-1e9), "expected -1000 to 1000 %"),
            ("/hardware/delay", serde_json::json!(1e9), "1000000000.0 s; expected 0 to 1 s"),
            ("/hardware/delay", serde_json::json!(-0.1), "expected 0 to 1 s"),
            ("/hardware/sensor_bandwidth", serde_json::json!(0.0), "expected 0.01"),
            ("/law/kappa", serde_json::json!(1.5), "expected 0 to 1"),
            ("/law/yaw_time_constant", serde_json::json!(5e-324), "expected 0.001"),
            ("/turn_coordination_width", serde_json::json!(0.0), "expected 0.001"),
            ("/points/1/speed", serde_json::json!(0.0), "must increase strictly"),
            ("/points/1/speed", serde_json::json!(-5.0), "must increase strictly"),
            ("/points/0/speed", serde_json::json!(1e300), "expected -100 to 300 m/s"),
            ("/points/0/trim/sticks/3", serde_json::json!(1e308), "expected -1000 to 1000 %"),
            ("/points/0/trim/velocity_body/0", serde_json::json!(1e300), "expected"),
            ("/points/1/matrices/decoupling/2/1", serde_json::json!(1e300), "expected"),
            ("/points/0/gains/roll/k_p", serde_json::json!(-1e300), "expected"),
            ("/name", serde_json::json!("@PLACES@"), "character 1 is `@`"),
            ("/provenance/generator", serde_json::json!("a\u{1b}[2Jb"), "character 2 is U+001B"),
            ("/provenance/problem_hash", serde_json::json!("*/ system()"), "character 1 is `*`"),
            ("/units", serde_json::json!({"x\n": "m"}), "U+000A"),
            ("/points", serde_json::json!([]), "no breakpoint"),
        ] {
            let found = findings(pointer, value.clone());
            assert!(found[0].message.contains(part), "{pointer} = {value}: {found:?}");
            assert!(found[0].pointer.starts_with(pointer), "{found:?}");
            assert!(found[0].line.is_some(), "{found:?}");
        }
    }

    /// Every number of a schedule is looked at: whichever is made absurd is found.
    #[test]
    fn no_number_is_left_out() {
        fn numbers(value: &Value, pointer: String, out: &mut Vec<String>) {
            match value {
                Value::Object(o) => {
                    o.iter().for_each(|(k, v)| numbers(v, format!("{pointer}/{k}"), out));
                }
                Value::Array(a) => {
                    a.iter()
                        .enumerate()
                        .for_each(|(i, v)| numbers(v, format!("{pointer}/{i}"), out));
                }
                Value::Number(_) => out.push(pointer),
                _ => {}
            }
        }
        let json = serde_json::to_value(schedule()).unwrap();
        let mut places = Vec::new();
        numbers(&json, String::new(), &mut places);
        assert!(places.len() > 400);
        for place in places {
            let found = findings(&place, serde_json::json!(1e305));
            assert!(found.iter().any(|f| f.pointer == place), "{place}: {found:?}");
        }
    }

    /// A number that is none cannot be written, exported or flown.
    #[test]
    fn numbers_that_are_none_are_found_in_memory() {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let mut other = schedule();
            other.points[0].trim.pitch = value;
            let found = check(&other);
            assert_eq!(found.len(), 1, "{found:?}");
            assert_eq!(found[0].pointer, "/points/0/trim/pitch");
            assert!(other.to_json().is_err());
        }
        assert_eq!(check(&schedule()), []);
    }

    #[test]
    fn lines_are_those_of_the_text() {
        let text = "{\n \"a\": [1, {\"b\\\"\": \"}\"},\n  {\"b\": 2}],\n \"a/b\":\n 3}";
        assert_eq!(line_of(text, ""), Some(1));
        assert_eq!(line_of(text, "/a"), Some(2));
        assert_eq!(line_of(text, "/a/1/b\""), Some(2));
        assert_eq!(line_of(text, "/a/2/b"), Some(3));
        assert_eq!(line_of(text, "/a~1b"), Some(5));
        for absent in ["/a/3", "/c", "/a/0/x", "/a/2/b/0"] {
            assert_eq!(line_of(text, absent), None, "{absent}");
        }
    }

    proptest::proptest! {
        /// The walk ends on any text.
        #[test]
        fn any_text_has_lines_or_none(text in "[\\[\\]{}\",:0-9a\\\\ \n]{0,60}") {
            for pointer in ["", "/0", "/a/0", "/a"] {
                let _ = line_of(&text, pointer);
            }
        }
    }
}
