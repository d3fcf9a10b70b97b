//! The tables as MAT level 5 for MATLAB, Octave and SciPy, with a loader that
//! makes a struct for scripts and Simulink.

use super::description::SCHEMA;
use super::text::{comment, fill};
use super::{File, Input};
use crate::linear::io::MatFile;

const LOADER: &str = include_str!("templates/load.m");

/// MAT file and loader.
pub(super) fn files(input: &Input) -> Vec<File> {
    let (d, name) = (input.description, &input.options.name);
    let mut mat = MatFile::new();
    let cell = |mat: &mut MatFile, name: &str, texts: &[String]| {
        mat.cell_of_text(name, &texts.iter().map(String::as_str).collect::<Vec<_>>());
    };
    let number = |mat: &mut MatFile, name: &str, x: f64| mat.array(name, &[1, 1], &[x]);
    mat.text("schema", &d.schema);
    mat.text("name", &d.name);
    number(&mut mat, "requirements_met", f64::from(d.requirements_met));
    cell(&mut mat, "warnings", &d.warnings);
    mat.text("generator", &d.provenance.generator);
    mat.text("problem_hash", &d.provenance.problem_hash);
    mat.text("specification_hash", &d.provenance.specification_hash);
    let rules: Vec<String> = d.rules.iter().map(|(k, v)| format!("{k}: {v}")).collect();
    cell(&mut mat, "rules", &rules);
    mat.array("speed", &[d.speed.values.len(), 1], &d.speed.values);
    mat.text("speed_unit", &d.speed.unit);
    let of_constants = |pick: fn(&super::description::Constant) -> &String| -> Vec<String> {
        d.constants.iter().map(|c| pick(c).clone()).collect()
    };
    cell(&mut mat, "constant_names", &of_constants(|c| &c.name));
    cell(&mut mat, "constant_units", &of_constants(|c| &c.unit));
    cell(&mut mat, "constant_meanings", &of_constants(|c| &c.meaning));
    let values: Vec<f64> = d.constants.iter().map(|c| c.value).collect();
    mat.array("constant_values", &[values.len(), 1], &values);
    let of_tables = |pick: fn(&super::description::Table) -> &String| -> Vec<String> {
        d.tables.iter().map(|t| pick(t).clone()).collect()
    };
    cell(&mut mat, "table_names", &of_tables(|t| &t.name));
    cell(&mut mat, "table_meanings", &of_tables(|t| &t.meaning));
    for t in &d.tables {
        let (rows, columns) = (t.rows.len(), t.columns.len());
        // The first index runs fastest.
        let by_columns: Vec<f64> = t
            .values
            .iter()
            .flat_map(|m| (0..columns).flat_map(move |j| m.iter().map(move |row| row[j])))
            .collect();
        mat.array(&t.name, &[rows, columns, t.values.len()], &by_columns);
        cell(&mut mat, &format!("{}_rows", t.name), &t.rows);
        cell(&mut mat, &format!("{}_columns", t.name), &t.columns);
        let units: Vec<String> =
            (0..columns).flat_map(|j| t.units.iter().map(move |row| row[j].clone())).collect();
        cell(&mut mat, &format!("{}_units", t.name), &units);
    }
    let loader = fill(
        LOADER,
        &[
            ("BANNER", &comment(&d.banner(), "%   ", 96)),
            ("SCHEMA", SCHEMA),
            ("U", &name.to_uppercase()),
            ("P", name),
        ],
    );
    vec![
        File { name: format!("{name}.mat"), bytes: mat.into_bytes() },
        File::text(format!("{name}_load.m"), loader),
    ]
}
