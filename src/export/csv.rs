//! The description as CSV, one number a line.
//!
//! Columns `quantity,row,column,speed,unit,value`. Lines without a speed do
//! not depend on it; lines without a unit are text.

use serde::{Deserialize, Serialize};

use super::description::Description;
use super::{ExportError, File, Input};

/// One line.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// Table, constant or text.
    pub quantity: String,
    /// Row of a table; key of a text.
    pub row: String,
    /// Column of a table.
    pub column: String,
    /// True airspeed, m/s; empty if it does not depend on it.
    pub speed: String,
    /// Unit; empty for text.
    pub unit: String,
    /// Value.
    pub value: String,
}

/// Lines of a description: texts, constants, tables.
pub fn lines(description: &Description) -> Vec<Line> {
    let d = description;
    let text = |quantity: &str, row: &str, value: &str| Line {
        quantity: quantity.into(),
        row: row.into(),
        column: String::new(),
        speed: String::new(),
        unit: String::new(),
        value: value.into(),
    };
    let p = &d.provenance;
    let mut out = vec![
        text("schema", "", &d.schema),
        text("name", "", &d.name),
        text("requirements_met", "", &d.requirements_met.to_string()),
        text("provenance", "generator", &p.generator),
        text("provenance", "problem_hash", &p.problem_hash),
        text("provenance", "specification_hash", &p.specification_hash),
    ];
    out.extend(d.warnings.iter().map(|w| text("warning", "", w)));
    out.extend(d.rules.iter().map(|(topic, rule)| text("rule", topic, rule)));
    out.extend(
        d.constants
            .iter()
            .map(|c| Line { unit: c.unit.clone(), ..text(&c.name, "", &format!("{:?}", c.value)) }),
    );
    for t in &d.tables {
        for (k, speed) in d.speed.values.iter().enumerate() {
            for (i, row) in t.rows.iter().enumerate() {
                for (j, column) in t.columns.iter().enumerate() {
                    out.push(Line {
                        quantity: t.name.clone(),
                        row: row.clone(),
                        column: column.clone(),
                        speed: format!("{speed:?}"),
                        unit: t.units[i][j].clone(),
                        value: format!("{:?}", t.values[k][i][j]),
                    });
                }
            }
        }
    }
    out
}

pub(super) fn files(input: &Input) -> Result<Vec<File>, ExportError> {
    let failed =
        |e: &dyn std::fmt::Display| ExportError::Format { format: "csv", reason: e.to_string() };
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    for line in lines(input.description) {
        writer.serialize(line).map_err(|e| failed(&e))?;
    }
    let bytes = writer.into_inner().map_err(|e| failed(&e))?;
    Ok(vec![File { name: format!("{}.csv", input.options.name), bytes }])
}
