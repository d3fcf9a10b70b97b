//! The reference page of the problem format, written from its description.

use super::keys::{Key, Need, ROOT, Table, Value};
use super::read::words;
use crate::units::Kind;

const HEAD: &str = "\
# Problem files

<!-- Written by the program from `src/problem/keys.rs`; a test keeps it so.
     To change it, change the description there and run
     `COAXDESIGN_BLESS=1 cargo test --test problem_files`. -->

A problem file describes a rotorcraft and the modelling choices to fly it with,
in [TOML](https://toml.io). `coaxdesign new FILE` writes a commented one to start
from, `coaxdesign check FILE` says what was understood, and `coaxdesign schema`
writes a JSON Schema with which editors complete and check the files. The files
under `problems/` are examples; `coax2d.toml` is also the built-in default.

## Quantities

A number that measures something carries its unit, as a text: `\"10.66 ft\"`,
`\"-4 deg\"`, `\"446 slug ft^2\"`. A bare number there is an error, and so is a unit
of another dimension. Units multiply with a space, `*`, `·` or `-`, take powers
(`^2`, `²`), and each divisor has its own slash: `\"3 m/s/s\"`. A number may stand in
a divisor: `\"0.5 rad/100%\"` is 0.005 rad for each percent of stick travel.

* `lb` is a mass or a force, as the place demands. A mass may also be given as a
  weight in `lbf`: it is the mass that weighs so much under standard gravity.
* Angles and percent of stick travel count as dimensions: `\"47.65 1/s\"` is no
  angular rate, and an angle is no angle per stick travel.
* `Hz` and `rpm` are cycles, so that `\"1 Hz\"` is 2π rad/s.
* A number without a unit is written as a number: `tip_loss = 0.97`.
";

const SPAN: &str = "
## Along the span

Chord and twist are either one quantity or a table over the span:
`{ station = [0.2, 1.0], value = [\"0.8 ft\", \"0.6 ft\"] }`. Stations are fractions
of the span (of the radius for a rotor), strictly increasing from 0 to 1 at most;
between them the value is linear, beyond them constant. One quantity is constant
along the span, except for the twist of a rotor: there it is the value at the tip
of a straight line from zero at the shaft axis.

## Extending a file

`extends = \"coax2d.toml\"` starts from another file, named relative to the file
that says so; bases may extend others in turn. Tables merge key by key, and
everything else replaces what the base had: to move one rotor it is enough to
write

```toml
extends = \"coax2d.toml\"

[rotors.upper]
position.fuselage_station = \"0 ft\"
```

Where keys exclude one another, such as an airfoil table and a lift slope,
choosing one drops the other of the base. Paths of tables are relative to the
file that names them.

## Errors and warnings

All errors of a file are reported at once, each with its line, column and key,
and with what to write instead. Keys that are not known are errors. Values that
can be used but look odd are warnings of `coaxdesign check`.
";

/// The whole page, as Markdown.
pub fn markdown() -> String {
    let mut page = String::from(HEAD);
    page += &units();
    page += SPAN;
    page += "\n## Keys\n";
    let mut tables = vec![(vec![String::new()], &ROOT)];
    let mut next = 0;
    while next < tables.len() {
        let (paths, table) = tables[next].clone();
        for path in &paths {
            find_tables(table, path, &mut tables);
        }
        next += 1;
    }
    for (paths, table) in &tables {
        section(&mut page, paths, table);
    }
    page
}

/// The usual units of every kind that some key uses.
fn units() -> String {
    let mut kinds = Vec::new();
    collect_kinds(&ROOT, &mut kinds);
    let mut text = String::from("\n| quantity | usual units |\n|---|---|\n");
    for kind in Kind::ALL.iter().filter(|kind| kinds.contains(kind)) {
        let units: Vec<String> =
            kind.usual_units().iter().map(|unit| format!("`{unit}`")).collect();
        text += &format!("| {} | {} |\n", kind.noun(), units.join(", "));
    }
    text + "\nAny product of known units of the right dimension will do. The known units are "
        + &crate::units::unit_names().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
        + ".\n"
}

fn collect_kinds(table: &Table, kinds: &mut Vec<Kind>) {
    for key in table.keys {
        match key.value {
            Value::Quantity(kind, _)
            | Value::Quantities(_, kind, _)
            | Value::Limits(kind, _)
            | Value::Spanwise(kind, _)
            | Value::SpanwiseFromZero(kind, _) => kinds.push(kind),
            Value::Table(below) | Value::Named(below, _) => collect_kinds(below, kinds),
            _ => {}
        }
    }
}

/// Notes the tables below one, each once with all the places it has.
fn find_tables(table: &'static Table, path: &str, tables: &mut Vec<(Vec<String>, &'static Table)>) {
    for key in table.keys {
        let (below, inner) = match key.value {
            Value::Table(inner) => (join(path, key.name), inner),
            Value::Named(inner, _) => (join(path, key.name) + ".NAME", inner),
            _ => continue,
        };
        match tables.iter_mut().find(|(_, known)| std::ptr::eq(*known, inner)) {
            Some((paths, _)) if paths.contains(&below) => {}
            Some((paths, _)) => paths.push(below),
            None => tables.push((vec![below], inner)),
        }
    }
}

fn join(path: &str, key: &str) -> String {
    if path.is_empty() { key.into() } else { format!("{path}.{key}") }
}

fn section(page: &mut String, paths: &[String], table: &Table) {
    let title = match paths {
        [top] if top.is_empty() => "Top level".into(),
        _ => paths.iter().map(|path| format!("`[{path}]`")).collect::<Vec<_>>().join(", "),
    };
    *page += &format!("\n### {title}\n\n{}\n\n", table.doc);
    if let [group, rest @ ..] = table.alternatives {
        let rest: Vec<String> = rest.iter().map(|other| listed(other)).collect();
        *page +=
            &format!("Exactly one of {} and {} is given.\n\n", listed(group), rest.join(" and "));
    }
    *page += "| key | value | default | meaning |\n|---|---|---|---|\n";
    for key in table.keys {
        *page += &format!(
            "| `{}` | {} | {} | {} |\n",
            key.name,
            value(key, &paths[0]),
            need(key),
            key.doc
        );
    }
}

fn listed(group: &[&str]) -> String {
    match group {
        [only] => format!("`{only}`"),
        _ => {
            let names: Vec<String> = group.iter().map(|name| format!("`{name}`")).collect();
            format!("the group {}", names.join(", "))
        }
    }
}

fn need(key: &Key) -> String {
    match key.need {
        Need::Required => "required".into(),
        Need::Default("{}") if matches!(key.value, Value::Named(..)) => "none".into(),
        Need::Default("{}") => "all defaults".into(),
        Need::Default(text) => format!("`{text}`"),
        Need::Optional(without) => format!("none: {without}"),
    }
}

fn value(key: &Key, path: &str) -> String {
    let below = join(path, key.name);
    match &key.value {
        Value::Text => "text".into(),
        Value::Name => "name".into(),
        Value::Path => "path of a file".into(),
        Value::Bool => "`true` or `false`".into(),
        Value::Count(low, high) => format!("whole number, {low} to {high}"),
        Value::Number(bounds) => format!("number, {}", words(bounds)),
        Value::Numbers(0, bounds) => {
            format!("list of one or more numbers, each {}", words(bounds))
        }
        Value::Numbers(count, bounds) => format!("list of {count} numbers, each {}", words(bounds)),
        Value::Quantity(kind, bounds) => format!("{}, {}", kind.noun(), words(bounds)),
        Value::Quantities(0, kind, bounds) => {
            format!("list of one or more, each {}, {}", kind.noun(), words(bounds))
        }
        Value::Quantities(count, kind, bounds) => {
            format!("list of {count}, each {}, {}", kind.noun(), words(bounds))
        }
        Value::Limits(kind, bounds) => {
            format!("lower and upper limit, each {}, {}", kind.noun(), words(bounds))
        }
        Value::Choice(choices) => choices
            .iter()
            .map(|(word, meaning)| format!("`\"{word}\"`: {meaning}"))
            .collect::<Vec<_>>()
            .join("; "),
        Value::Spanwise(kind, bounds) | Value::SpanwiseFromZero(kind, bounds) => {
            format!("{} along the span, {}", kind.noun(), words(bounds))
        }
        Value::Table(_) => format!("table `[{below}]`"),
        Value::Named(_, noun) => format!("tables `[{below}.NAME]`, one a {noun}"),
    }
}
