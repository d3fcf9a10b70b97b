//! Checks a tree against the description of the format, value by value.

use std::collections::HashMap;
use std::path::PathBuf;

use crate::units::{Kind, QuantityError, parse_quantity};

use super::Spanwise;
use super::keys::{Bounds, Key, Need, Table, Value};
use super::report::{Diagnostic, Report, Severity};
use super::source::{Place, Sources};
use super::text::{LONGEST_LINE, LONGEST_NAME, TextFault, check_line, check_name};
use super::tree::{self, Entry, Node, Value as Tree};

/// A value that has the form its key asks for, in SI and radians.
#[derive(Debug)]
pub(crate) enum Checked {
    Text(String),
    Path(PathBuf),
    Bool(bool),
    Count(usize),
    Number(f64),
    Numbers(Vec<f64>),
    Choice(&'static str),
    Spanwise(Spanwise),
    Table(CheckedTable),
    Named(Vec<(String, CheckedTable)>),
}

/// A table whose keys have been checked. A key that failed is absent; its
/// error has been reported.
#[derive(Debug)]
pub(crate) struct CheckedTable {
    /// Key path, such as `rotors.upper`.
    pub path: String,
    /// Where the table is named in the file.
    pub place: Place,
    entries: HashMap<&'static str, Item>,
}

#[derive(Debug)]
struct Item {
    value: Checked,
    place: Place,
    given: bool,
}

/// Getters give `None` for a key whose error has been reported, or that is
/// optional and absent. A key that is not in the description is a mistake of
/// the program and is refused loudly by every test that reads a file.
impl CheckedTable {
    fn get(&self, key: &str) -> Option<&Checked> {
        self.entries.get(key).map(|item| &item.value)
    }

    pub fn number(&self, key: &str) -> Option<f64> {
        match self.get(key)? {
            Checked::Number(value) => Some(*value),
            other => unreachable!("{key} is {other:?}"),
        }
    }

    pub fn numbers<const N: usize>(&self, key: &str) -> Option<[f64; N]> {
        match self.get(key)? {
            Checked::Numbers(values) => values.as_slice().try_into().ok(),
            other => unreachable!("{key} is {other:?}"),
        }
    }

    /// A list of any length.
    pub fn number_list(&self, key: &str) -> Option<Vec<f64>> {
        match self.get(key)? {
            Checked::Numbers(values) => Some(values.clone()),
            other => unreachable!("{key} is {other:?}"),
        }
    }

    pub fn text(&self, key: &str) -> Option<&str> {
        match self.get(key)? {
            Checked::Text(value) => Some(value),
            other => unreachable!("{key} is {other:?}"),
        }
    }

    pub fn path(&self, key: &str) -> Option<&PathBuf> {
        match self.get(key)? {
            Checked::Path(value) => Some(value),
            other => unreachable!("{key} is {other:?}"),
        }
    }

    pub fn flag(&self, key: &str) -> Option<bool> {
        match self.get(key)? {
            Checked::Bool(value) => Some(*value),
            other => unreachable!("{key} is {other:?}"),
        }
    }

    pub fn count(&self, key: &str) -> Option<usize> {
        match self.get(key)? {
            Checked::Count(value) => Some(*value),
            other => unreachable!("{key} is {other:?}"),
        }
    }

    pub fn choice(&self, key: &str) -> Option<&'static str> {
        match self.get(key)? {
            Checked::Choice(value) => Some(value),
            other => unreachable!("{key} is {other:?}"),
        }
    }

    pub fn spanwise(&self, key: &str) -> Option<Spanwise> {
        match self.get(key)? {
            Checked::Spanwise(value) => Some(value.clone()),
            other => unreachable!("{key} is {other:?}"),
        }
    }

    pub fn table(&self, key: &str) -> Option<&CheckedTable> {
        match self.get(key)? {
            Checked::Table(value) => Some(value),
            other => unreachable!("{key} is {other:?}"),
        }
    }

    pub fn named(&self, key: &str) -> &[(String, CheckedTable)] {
        match self.get(key) {
            Some(Checked::Named(tables)) => tables,
            Some(other) => unreachable!("{key} is {other:?}"),
            None => &[],
        }
    }

    /// Where a key's value stands; the table itself for a default.
    pub fn place(&self, key: &str) -> &Place {
        self.entries.get(key).map_or(&self.place, |item| &item.place)
    }

    /// Whether a key stands in the file, rather than its default.
    pub fn given(&self, key: &str) -> bool {
        self.entries.get(key).is_some_and(|item| item.given)
    }

    /// Key path of a key.
    pub fn key_path(&self, key: &str) -> String {
        join(&self.path, key)
    }
}

/// Most tables of one kind, such as `[rotors.NAME]`: every pair of them is
/// looked at.
const MOST_NAMED: usize = 256;
/// Most unknown keys of a table for which the nearest known one is looked for.
const MOST_PROPOSALS: usize = 100;
/// Longest list.
const LONGEST_LIST: usize = 100_000;
/// Message of an absent key.
const MISSING: &str = "missing key";
/// Jaro-Winkler likeness from which one word is taken for another, misspelled.
const LIKENESS: f64 = 0.8;

fn join(path: &str, key: &str) -> String {
    if path.is_empty() { key.into() } else { format!("{path}.{key}") }
}

/// The walk through a tree.
pub(crate) struct Reader<'a> {
    pub sources: &'a Sources,
    pub findings: &'a mut Vec<Diagnostic>,
    /// Index of the source that holds defaults while they are read.
    pub defaults: usize,
    /// Whether absent keys are let pass, because syntax errors may have
    /// swallowed them.
    pub lenient: bool,
}

/// Reads a text that stands alone, without `extends`, by a table of keys;
/// `name` stands for the file in messages. `build` is told whether the text is
/// broken, so that absent keys are to be let pass.
///
/// # Errors
/// Everything that is wrong with it, at once.
pub(crate) fn read_text<T>(
    name: &str,
    text: &str,
    keys: &'static Table,
    build: impl FnOnce(&CheckedTable, &mut Reader, bool) -> Option<T>,
) -> Result<T, Report> {
    let mut sources = Sources::default();
    let source = sources.add(name, text.into());
    let mut findings = Vec::new();
    let node = tree::parse(&sources, source, &mut findings);
    let broken: Vec<usize> = findings.iter().map(|f: &Diagnostic| f.line).collect();
    let lenient = !broken.is_empty();
    let entries = match node.value {
        Tree::Table(entries) => entries,
        _ => Vec::new(),
    };
    let place = Place { source, span: 0..0 };
    let mut found = Vec::new();
    let mut reader = Reader { sources: &sources, findings: &mut found, defaults: source, lenient };
    let root = reader.table(keys, &entries, "", &place);
    let built = build(&root, &mut reader, lenient);
    // A line that is no TOML has been reported as that.
    found.retain(|f| !broken.contains(&f.line));
    findings.append(&mut found);
    let failed = findings.iter().any(|f| f.severity == Severity::Error);
    match built {
        Some(value) if !failed => Ok(value),
        _ => Err(Report::new(findings, false)),
    }
}

impl Reader<'_> {
    pub fn error(&mut self, place: &Place, key: &str, message: String, help: String) {
        self.findings.push(Diagnostic::at(
            Severity::Error,
            self.sources,
            place,
            key,
            message,
            help,
        ));
    }

    pub fn table(
        &mut self,
        table: &'static Table,
        entries: &[Entry],
        path: &str,
        place: &Place,
    ) -> CheckedTable {
        let mut checked =
            CheckedTable { path: path.into(), place: place.clone(), entries: HashMap::new() };
        let unknown = entries.iter().filter(|entry| table.key(&entry.name).is_none());
        for (index, entry) in unknown.enumerate() {
            let nearest =
                || nearest_help(&entry.name, table.keys.iter().map(|key| key.name), "keys");
            let help = match table.moved(&entry.name) {
                Some(help) => help.to_owned(),
                None if index < MOST_PROPOSALS => nearest(),
                None => String::new(),
            };
            self.error(&entry.place, &join(path, &entry.name), "unknown key".into(), help);
        }
        let chosen = self.alternative(table, entries, path, place);
        for key in table.keys {
            let key_path = join(path, key.name);
            let entry = entries.iter().find(|entry| entry.name == key.name);
            let offered = table.alternatives.iter().any(|group| group.contains(&key.name));
            let in_choice = !offered || chosen.is_some_and(|group| group.contains(&key.name));
            if let Some(entry) = entry {
                if let Some(value) = self.value(&key.value, entry, &key_path) {
                    let item = Item { value, place: entry.node.place.clone(), given: true };
                    checked.entries.insert(key.name, item);
                }
                continue;
            }
            match key.need {
                Need::Default(text) if in_choice => {
                    let node = tree::parse_value(text, self.defaults);
                    let entry = node.map(|node| Entry {
                        name: key.name.into(),
                        place: place.clone(),
                        node,
                    });
                    let value = entry.and_then(|entry| self.value(&key.value, &entry, &key_path));
                    let value = value.unwrap_or_else(|| unreachable!("default of {key_path}"));
                    let item = Item { value, place: place.clone(), given: false };
                    checked.entries.insert(key.name, item);
                }
                Need::Required if in_choice && !self.lenient => {
                    self.error(
                        place,
                        &key_path,
                        MISSING.into(),
                        format!("add {}: {}", example(key, &key_path), first_sentence(key.doc)),
                    );
                }
                _ => {}
            }
        }
        checked
    }

    /// The group of alternative keys that a table uses.
    fn alternative(
        &mut self,
        table: &'static Table,
        entries: &[Entry],
        path: &str,
        place: &Place,
    ) -> Option<&'static [&'static str]> {
        let uses =
            |group: &&&[&str]| entries.iter().find(|entry| group.contains(&entry.name.as_str()));
        let used: Vec<_> = table.alternatives.iter().filter(|g| uses(g).is_some()).collect();
        let spelled: Vec<String> = table
            .alternatives
            .iter()
            .map(|group| match group {
                [only] => format!("`{only}`"),
                [first, .., last] => format!("`{first}` to `{last}`"),
                [] => String::new(),
            })
            .collect();
        let spelled = spelled.join(" or ");
        match used.as_slice() {
            [] if table.alternatives.is_empty() || self.lenient => None,
            [] => {
                let example = table.alternatives[0].first().and_then(|name| table.key(name));
                let example = example.map_or(String::new(), |key| {
                    format!(", such as {}", self::example(key, &join(path, key.name)))
                });
                self.error(
                    place,
                    path,
                    format!("missing key: one of {spelled} is needed"),
                    format!("add one of them{example}"),
                );
                None
            }
            [group] => Some(group),
            [first, second, ..] => {
                let (Some(one), Some(other)) = (uses(first), uses(second)) else {
                    return None;
                };
                let message = format!("`{}` and `{}` exclude one another", one.name, other.name);
                let help = format!(
                    "keep `{}` and remove `{}`, or the other way round",
                    one.name, other.name
                );
                self.error(&other.place, path, message, help);
                None
            }
        }
    }

    fn value(&mut self, value: &Value, entry: &Entry, path: &str) -> Option<Checked> {
        let node = &entry.node;
        match value {
            Value::Text => self.text(node, &entry.name, path, false),
            Value::Name => self.text(node, &entry.name, path, true),
            Value::Path => match &node.value {
                Tree::Text(text) if !text.is_empty() => Some(Checked::Path(text.into())),
                _ => {
                    let example = example_path(&entry.name);
                    self.wrong_type(node, path, "the path of a file", &example)
                }
            },
            Value::Bool => match &node.value {
                Tree::Bool(value) => Some(Checked::Bool(*value)),
                _ => {
                    self.wrong_type(node, path, "true or false", &format!("{} = true", entry.name))
                }
            },
            Value::Count(low, high) => match &node.value {
                Tree::Integer(value) => match usize::try_from(*value) {
                    Ok(count) if (*low..=*high).contains(&count) => Some(Checked::Count(count)),
                    _ => {
                        self.error(
                            &node.place,
                            path,
                            format!("{value} is out of bounds"),
                            format!("write a whole number from {low} to {high}"),
                        );
                        None
                    }
                },
                _ => {
                    let number = match node.value {
                        // `2.0` was meant as 2.
                        Tree::Float(value) if value.fract() == 0.0 && value > 0.0 => value,
                        _ => (*low).max(2) as f64,
                    };
                    let form = format!("{} = {number}", entry.name);
                    self.wrong_type(node, path, "a whole number", &form)
                }
            },
            Value::Number(bounds) => {
                let number = self.number(node, path, bounds)?;
                Some(Checked::Number(number))
            }
            Value::Quantity(kind, bounds) => {
                let number = self.quantity(node, path, *kind, bounds)?;
                Some(Checked::Number(number))
            }
            Value::Numbers(count, bounds) => {
                let form = numbers_form(&entry.name, *count);
                let items = self.list(node, path, (*count > 0).then_some(*count), &form)?;
                let values: Vec<_> =
                    items.iter().map(|item| self.number(item, path, bounds)).collect();
                Some(Checked::Numbers(values.into_iter().collect::<Option<_>>()?))
            }
            Value::Quantities(count, kind, bounds) => {
                let form = quantities_form(&entry.name, *count, *kind);
                let items = self.list(node, path, (*count > 0).then_some(*count), &form)?;
                let values = self.quantities(items, path, *kind, bounds)?;
                Some(Checked::Numbers(values))
            }
            Value::Limits(kind, bounds) => {
                let unit = kind.usual_units()[0];
                let form = format!("{} = [\"-5 {unit}\", \"5 {unit}\"]", entry.name);
                let items = self.list(node, path, Some(2), &form)?;
                let values = self.quantities(items, path, *kind, bounds)?;
                if values[0] >= values[1] {
                    self.error(
                        &node.place,
                        path,
                        "the lower limit is not below the upper".into(),
                        format!("write the lower limit first, such as {form}"),
                    );
                    return None;
                }
                Some(Checked::Numbers(values))
            }
            Value::Choice(words) => {
                let names = words.iter().map(|(word, _)| *word);
                let Tree::Text(text) = &node.value else {
                    let form = format!("{} = \"{}\"", entry.name, words[0].0);
                    return self.wrong_type(node, path, "a word", &form);
                };
                if let Some((word, _)) = words.iter().find(|(word, _)| word == text) {
                    return Some(Checked::Choice(word));
                }
                let help = nearest_help(text, names, "values");
                self.error(&node.place, path, format!("\"{text}\" is not one of the values"), help);
                None
            }
            Value::Spanwise(kind, bounds) => {
                self.spanwise(node, &entry.name, path, *kind, bounds, false).map(Checked::Spanwise)
            }
            Value::SpanwiseFromZero(kind, bounds) => {
                self.spanwise(node, &entry.name, path, *kind, bounds, true).map(Checked::Spanwise)
            }
            Value::Table(table) => {
                let Tree::Table(entries) = &node.value else {
                    return self.wrong_type(node, path, "a table", &format!("[{path}]"));
                };
                Some(Checked::Table(self.table(table, entries, path, &entry.place)))
            }
            Value::Named(table, noun) => {
                let Tree::Table(entries) = &node.value else {
                    return self.wrong_type(
                        node,
                        path,
                        "tables with names",
                        &format!("[{path}.name]"),
                    );
                };
                if let Some(first) = entries.get(MOST_NAMED) {
                    self.error(
                        &first.place,
                        path,
                        format!("{} tables where {MOST_NAMED} are the most", entries.len()),
                        format!(
                            "no aircraft and no flight of interest has so many: keep at most \
                                 {MOST_NAMED}"
                        ),
                    );
                    return None;
                }
                let mut tables = Vec::new();
                for entry in entries {
                    let path = join(path, &entry.name);
                    if !is_identifier(&entry.name) {
                        let shown: String = entry.name.chars().take(LONGEST_NAME).collect();
                        self.error(
                            &entry.place,
                            &path,
                            format!("\"{shown}\" cannot name a {noun}"),
                            format!(
                                "a name begins with a letter and holds letters, digits and `_`, \
                                 at most {LONGEST_NAME} of them, such as `upper`"
                            ),
                        );
                    }
                    if let Tree::Table(inner) = &entry.node.value {
                        let before = self.findings.len();
                        let checked = self.table(table, inner, &path, &entry.place);
                        if !self.misspelled(before, entry, entries, &path, noun) {
                            tables.push((entry.name.clone(), checked));
                        }
                    } else {
                        self.wrong_type(&entry.node, &path, "a table", &format!("[{path}]"));
                    }
                }
                Some(Checked::Named(tables))
            }
        }
    }

    /// Whether an incomplete table of an extending file is a misspelled one of
    /// its base. One error that says so then takes the place of an error for
    /// each missing key.
    fn misspelled(
        &mut self,
        before: usize,
        entry: &Entry,
        siblings: &[Entry],
        path: &str,
        noun: &str,
    ) -> bool {
        let incomplete = self.findings[before..].iter().any(|f| f.message == MISSING);
        let meant = siblings.iter().find(|sibling| {
            sibling.place.source != entry.place.source
                && strsim::jaro_winkler(&sibling.name, &entry.name) > LIKENESS
        });
        let Some(meant) = meant.filter(|_| incomplete) else {
            return false;
        };
        self.findings.truncate(before);
        self.error(
            &entry.place,
            path,
            format!("no {noun} of the base has this name, and for a new one keys are missing"),
            format!("did you mean `{}`? A new {noun} needs all keys without a default", meant.name),
        );
        true
    }

    fn wrong_type(
        &mut self,
        node: &Node,
        path: &str,
        expected: &str,
        form: &str,
    ) -> Option<Checked> {
        self.error(
            &node.place,
            path,
            format!("{} where {expected} is expected", node.value.noun()),
            format!("write {form}"),
        );
        None
    }

    fn text(&mut self, node: &Node, name: &str, path: &str, is_name: bool) -> Option<Checked> {
        let Tree::Text(text) = &node.value else {
            return self.wrong_type(node, path, "a text", &format!("{name} = \"...\""));
        };
        let check = if is_name { check_name(text) } else { check_line(text) };
        let fault = match check {
            Ok(()) => return Some(Checked::Text(text.clone())),
            Err(fault) => fault,
        };
        let mut place = node.place.clone();
        if let TextFault::Character { column, .. } = &fault {
            // Marks the character itself, where the text stands in the file as it is read:
            // without escapes, behind one quote.
            let written = self.sources.slice(&node.place);
            if written.get(1..written.len().saturating_sub(1)) == Some(text) {
                let before: usize = text.chars().take(column - 1).map(char::len_utf8).sum();
                place.span = place.span.start + 1 + before..place.span.start + 2 + before;
            }
        }
        let (message, help) = match &fault {
            TextFault::Empty => {
                ("an empty text".into(), format!("write some text, such as {name} = \"CoAX 2D\""))
            }
            fault if is_name => (
                format!("this name cannot stand in every export: {fault}"),
                format!(
                    "a name holds letters from A to Z, digits, blanks and `-_.`, at most \
                     {LONGEST_NAME} of them, such as {name} = \"CoAX 2D\""
                ),
            ),
            fault => (
                format!("this text cannot be shown: {fault}"),
                format!("write one line of at most {LONGEST_LINE} characters"),
            ),
        };
        self.error(&place, path, message, help);
        None
    }

    fn list<'n>(
        &mut self,
        node: &'n Node,
        path: &str,
        count: Option<usize>,
        form: &str,
    ) -> Option<&'n [Node]> {
        let Tree::Array(items) = &node.value else {
            self.wrong_type(node, path, "a list", form);
            return None;
        };
        if items.len() > LONGEST_LIST {
            self.error(
                &node.place,
                path,
                format!("a list of {} where {LONGEST_LIST} values are the most", items.len()),
                format!("write {form}"),
            );
            return None;
        }
        if let Some(count) = count.filter(|count| *count != items.len()) {
            self.error(
                &node.place,
                path,
                format!("a list of {} where {count} values are expected", items.len()),
                format!("write {form}"),
            );
            return None;
        }
        Some(items)
    }

    fn number(&mut self, node: &Node, path: &str, bounds: &Bounds) -> Option<f64> {
        let number = match &node.value {
            Tree::Integer(value) => *value as f64,
            Tree::Float(value) => *value,
            Tree::Text(text) => {
                self.error(
                    &node.place,
                    path,
                    format!("the text \"{text}\" where a plain number is expected"),
                    format!("write a number without quotes or unit, {}", words(bounds)),
                );
                return None;
            }
            other => {
                self.error(
                    &node.place,
                    path,
                    format!("{} where a plain number is expected", other.noun()),
                    format!("write a number without quotes or unit, {}", words(bounds)),
                );
                return None;
            }
        };
        self.within(node, path, number, Kind::Dimensionless, bounds)
    }

    fn quantities(
        &mut self,
        items: &[Node],
        path: &str,
        kind: Kind,
        bounds: &Bounds,
    ) -> Option<Vec<f64>> {
        // Every item is looked at before the first fault ends the list.
        let values: Vec<_> =
            items.iter().map(|item| self.quantity(item, path, kind, bounds)).collect();
        values.into_iter().collect()
    }

    fn quantity(&mut self, node: &Node, path: &str, kind: Kind, bounds: &Bounds) -> Option<f64> {
        let result = match &node.value {
            Tree::Text(text) => parse_quantity(text, kind),
            Tree::Float(value) if !value.is_finite() => {
                Err(QuantityError::NotFinite { text: self.sources.slice(&node.place).into(), kind })
            }
            Tree::Integer(_) | Tree::Float(_) => {
                Err(QuantityError::Bare { text: self.sources.slice(&node.place).into(), kind })
            }
            other => {
                let unit = kind.usual_units()[0];
                self.error(
                    &node.place,
                    path,
                    format!("{} where {} is expected", other.noun(), kind.noun()),
                    format!("write a number and its unit, such as \"10 {unit}\""),
                );
                return None;
            }
        };
        match result {
            Ok(value) => self.within(node, path, value, kind, bounds),
            Err(error) => {
                self.error(&node.place, path, error.to_string(), error.help());
                None
            }
        }
    }

    fn within(
        &mut self,
        node: &Node,
        path: &str,
        value: f64,
        kind: Kind,
        bounds: &Bounds,
    ) -> Option<f64> {
        if !value.is_finite() {
            self.error(
                &node.place,
                path,
                format!("`{}` is not a finite number", self.sources.slice(&node.place)),
                format!("write a number {}", words(bounds)),
            );
            return None;
        }
        if inside(value, kind, bounds) {
            return Some(value);
        }
        let shown = self.sources.slice(&node.place).to_string();
        self.error(
            &node.place,
            path,
            format!("{shown} is out of bounds"),
            format!("write a value {}", words(bounds)),
        );
        None
    }

    fn spanwise(
        &mut self,
        node: &Node,
        name: &str,
        path: &str,
        kind: Kind,
        bounds: &Bounds,
        from_zero: bool,
    ) -> Option<Spanwise> {
        let Tree::Table(entries) = &node.value else {
            let value = self.quantity(node, path, kind, bounds)?;
            return Some(if from_zero {
                Spanwise { station: vec![0.0, 1.0], value: vec![0.0, value] }
            } else {
                Spanwise { station: vec![0.0], value: vec![value] }
            });
        };
        let unit = kind.usual_units()[0];
        let form =
            format!("{name} = {{ station = [0.2, 1.0], value = [\"8 {unit}\", \"5 {unit}\"] }}");
        for entry in entries {
            if !matches!(entry.name.as_str(), "station" | "value") {
                let help = nearest_help(&entry.name, ["station", "value"].into_iter(), "keys");
                self.error(&entry.place, &join(path, &entry.name), "unknown key".into(), help);
            }
        }
        let find = |key: &str| entries.iter().find(|entry| entry.name == key);
        let (Some(station), Some(value)) = (find("station"), find("value")) else {
            self.error(
                &node.place,
                path,
                "missing key: both `station` and `value` are needed".into(),
                format!("write {form}"),
            );
            return None;
        };
        let station_path = join(path, "station");
        let unit_interval = Bounds { low: Some(("0", true)), high: Some(("1", true)) };
        let stations = self.list(&station.node, &station_path, None, &form)?;
        let values = self.list(&value.node, &join(path, "value"), None, &form)?;
        let places: Vec<&Place> = stations.iter().map(|item| &item.place).collect();
        let numbers: Vec<_> =
            stations.iter().map(|item| self.number(item, &station_path, &unit_interval)).collect();
        let quantities = self.quantities(values, &join(path, "value"), kind, bounds);
        let numbers: Vec<f64> = numbers.into_iter().collect::<Option<_>>()?;
        let quantities = quantities?;
        if numbers.is_empty() || numbers.len() != quantities.len() {
            self.error(
                &value.node.place,
                path,
                format!("{} stations and {} values", numbers.len(), quantities.len()),
                format!("give one value a station, and at least one, such as {form}"),
            );
            return None;
        }
        if let Some(index) = (1..numbers.len()).find(|&i| numbers[i] <= numbers[i - 1]) {
            self.error(
                places[index],
                &station_path,
                "stations do not increase".into(),
                format!("put the stations in increasing order, such as {form}"),
            );
            return None;
        }
        Some(Spanwise { station: numbers, value: quantities })
    }
}

/// Whether a name can stand in keys of results.
fn is_identifier(name: &str) -> bool {
    name.len() <= LONGEST_NAME
        && name.starts_with(|c: char| c.is_ascii_alphabetic())
        && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// Whether a number in SI is within bounds.
fn inside(value: f64, kind: Kind, bounds: &Bounds) -> bool {
    let bound = |text: &str| {
        parse_quantity(text, kind).unwrap_or_else(|error| unreachable!("bound {text}: {error}"))
    };
    let above = bounds.low.is_none_or(|(low, included)| {
        let low = bound(low);
        value > low || (included && value == low)
    });
    let below = bounds.high.is_none_or(|(high, included)| {
        let high = bound(high);
        value < high || (included && value == high)
    });
    above && below
}

/// Bounds in words: `from 0 to 1`, `above 0 ft and at most 200 ft`.
pub(crate) fn words(bounds: &Bounds) -> String {
    match (bounds.low, bounds.high) {
        (Some((low, true)), Some((high, true))) => format!("from {low} to {high}"),
        (Some((low, true)), Some((high, false))) => format!("from {low} to below {high}"),
        (Some((low, false)), Some((high, true))) => format!("above {low} and at most {high}"),
        (Some((low, false)), Some((high, false))) => format!("above {low} and below {high}"),
        (Some((low, true)), None) => format!("at least {low}"),
        (Some((low, false)), None) => format!("above {low}"),
        (None, Some((high, true))) => format!("at most {high}"),
        (None, Some((high, false))) => format!("below {high}"),
        (None, None) => "of any size".into(),
    }
}

/// `did you mean ...?` where something is close, and the list of what there
/// is where nothing is, or where the list is short.
pub fn nearest_help<'a>(given: &str, known: impl Iterator<Item = &'a str>, what: &str) -> String {
    let known: Vec<&str> = known.collect();
    let lower = given.to_lowercase();
    let mut best: Option<(&str, f64)> = None;
    for name in &known {
        let likeness = strsim::jaro_winkler(&lower, &name.to_lowercase());
        if best.is_none_or(|(_, most)| likeness > most) {
            best = Some((name, likeness));
        }
    }
    let list = known.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    match best {
        Some((name, likeness)) if likeness > LIKENESS => {
            format!("did you mean `{name}`? The {what} here are {list}")
        }
        _ => format!("the {what} here are {list}"),
    }
}

fn quantities_form(name: &str, count: usize, kind: Kind) -> String {
    let unit = kind.usual_units()[0];
    let items = vec![format!("\"10 {unit}\""); count.max(1)];
    format!("{name} = [{}]", items.join(", "))
}

/// A key that names a file, as it could stand in a file.
fn example_path(key: &str) -> String {
    match key {
        "extends" => format!("{key} = \"coax2d.toml\""),
        _ => format!("{key} = \"airfoils/naca23012.c81\""),
    }
}

/// A key as it could stand in a file.
fn example(key: &Key, path: &str) -> String {
    let name = key.name;
    match &key.value {
        Value::Text | Value::Name => format!("{name} = \"...\""),
        Value::Path => example_path(name),
        Value::Bool => format!("{name} = true"),
        Value::Count(low, _) => format!("{name} = {}", (*low).max(2)),
        Value::Number(_) => format!("{name} = 0.5"),
        Value::Quantity(kind, _) | Value::Spanwise(kind, _) | Value::SpanwiseFromZero(kind, _) => {
            format!("{name} = \"10 {}\"", kind.usual_units()[0])
        }
        Value::Numbers(count, _) => numbers_form(name, *count),
        Value::Quantities(count, kind, _) => quantities_form(name, *count, *kind),
        Value::Limits(kind, _) => quantities_form(name, 2, *kind),
        Value::Choice(words) => format!("{name} = \"{}\"", words[0].0),
        Value::Table(_) => format!("[{path}]"),
        Value::Named(_, _) => format!("[{path}.name]"),
    }
}

/// A list of plain numbers, two where any number of them may stand.
fn numbers_form(name: &str, count: usize) -> String {
    let count = if count == 0 { 2 } else { count };
    format!("{name} = [{}]", vec!["1.0"; count].join(", "))
}

fn first_sentence(doc: &str) -> String {
    let end = doc.find(". ").unwrap_or(doc.trim_end_matches('.').len());
    let sentence = doc[..end].trim_end_matches('.');
    let mut chars = sentence.chars();
    chars.next().map_or(String::new(), |first| first.to_lowercase().chain(chars).collect())
}
