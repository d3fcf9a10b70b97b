//! The tables as MAT level 5 for MATLAB, Octave and SciPy, with a loader that
//! makes a struct for scripts and Simulink; and a reader of MAT files.

use std::collections::BTreeMap;
use std::io::Read as _;

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

/// A variable of a MAT file.
#[derive(Debug, Clone, PartialEq)]
pub enum Variable {
    /// Numbers, the first index running fastest.
    Numbers {
        /// Sizes.
        dimensions: Vec<usize>,
        /// Values.
        values: Vec<f64>,
    },
    /// A text of one row.
    Text(String),
    /// A cell array of texts; empty for cells that are not texts.
    Texts(Vec<String>),
}

/// Why a MAT file cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum MatError {
    /// Not level 5.
    #[error("this is no MAT file of level 5 (MATLAB's -v6 or -v7)")]
    NotLevel5,
    /// Big-endian.
    #[error("big-endian MAT files are not read")]
    BigEndian,
    /// The file ends early or a size leads out of it.
    #[error("the MAT file is damaged at byte {0}")]
    Damaged(usize),
    /// The compressed data are damaged.
    #[error("compressed data of the MAT file are damaged")]
    Compressed,
}

/// Most bytes that a compressed variable may grow to.
const MAX_VARIABLE: u64 = 1 << 28;

mod kind {
    pub const INT8: u32 = 1;
    pub const UINT8: u32 = 2;
    pub const INT16: u32 = 3;
    pub const UINT16: u32 = 4;
    pub const INT32: u32 = 5;
    pub const UINT32: u32 = 6;
    pub const SINGLE: u32 = 7;
    pub const DOUBLE: u32 = 9;
    pub const MATRIX: u32 = 14;
    pub const COMPRESSED: u32 = 15;
    pub const UTF8: u32 = 16;
    pub const UTF16: u32 = 17;
    pub const CELL_CLASS: u8 = 1;
    pub const CHAR_CLASS: u8 = 4;
    pub const FIRST_NUMERIC_CLASS: u8 = 6;
    pub const LAST_NUMERIC_CLASS: u8 = 15;
}

/// The variables of a MAT file of level 5, compressed or not. Structs, sparse
/// and complex arrays are passed over.
///
/// # Errors
/// A file of another level, or a damaged one.
pub fn read(bytes: &[u8]) -> Result<BTreeMap<String, Variable>, MatError> {
    if bytes.len() < 128 || !bytes.starts_with(b"MATLAB 5.0") {
        return Err(MatError::NotLevel5);
    }
    match &bytes[126..128] {
        b"IM" => {}
        b"MI" => return Err(MatError::BigEndian),
        _ => return Err(MatError::NotLevel5),
    }
    let mut out = BTreeMap::new();
    let mut at = 128;
    while at < bytes.len() {
        let (tag, data, next) = element(bytes, at)?;
        // Compressed elements are not padded.
        at = if tag == kind::COMPRESSED { at + 8 + data.len() } else { next };
        let inflated;
        let body = if tag == kind::COMPRESSED {
            let mut buffer = Vec::new();
            flate2::read::ZlibDecoder::new(data)
                .take(MAX_VARIABLE)
                .read_to_end(&mut buffer)
                .map_err(|_| MatError::Compressed)?;
            inflated = buffer;
            let (tag, data, _) = element(&inflated, 0)?;
            if tag == kind::MATRIX { data } else { continue }
        } else if tag == kind::MATRIX {
            data
        } else {
            continue;
        };
        if let Some((name, variable)) = matrix(body, 0)? {
            out.insert(name, variable);
        }
    }
    Ok(out)
}

/// Type, data and the place of the next element.
fn element(bytes: &[u8], at: usize) -> Result<(u32, &[u8], usize), MatError> {
    let word = |k: usize| -> Result<u32, MatError> {
        bytes
            .get(k..k + 4)
            .and_then(|b| b.try_into().ok())
            .map(u32::from_le_bytes)
            .ok_or(MatError::Damaged(k))
    };
    let first = word(at)?;
    // The small form: size in the upper half of the tag, data in the second word.
    if first >> 16 != 0 {
        let size = (first >> 16) as usize;
        let data = bytes.get(at + 4..at + 4 + size).filter(|_| size <= 4);
        return Ok((first & 0xffff, data.ok_or(MatError::Damaged(at))?, at + 8));
    }
    let size = word(at + 4)? as usize;
    let data = bytes.get(at + 8..(at + 8).saturating_add(size)).ok_or(MatError::Damaged(at))?;
    Ok((first, data, (at + 8 + size).next_multiple_of(8)))
}

fn numbers(tag: u32, data: &[u8]) -> Option<Vec<f64>> {
    fn each<const N: usize>(data: &[u8], convert: fn([u8; N]) -> f64) -> Vec<f64> {
        data.chunks_exact(N).filter_map(|c| c.try_into().ok().map(convert)).collect()
    }
    Some(match tag {
        kind::INT8 => each(data, |b: [u8; 1]| f64::from(i8::from_le_bytes(b))),
        kind::UINT8 | kind::UTF8 => each(data, |b: [u8; 1]| f64::from(b[0])),
        kind::INT16 => each(data, |b| f64::from(i16::from_le_bytes(b))),
        kind::UINT16 | kind::UTF16 => each(data, |b| f64::from(u16::from_le_bytes(b))),
        kind::INT32 => each(data, |b| f64::from(i32::from_le_bytes(b))),
        kind::UINT32 => each(data, |b| f64::from(u32::from_le_bytes(b))),
        kind::SINGLE => each(data, |b| f64::from(f32::from_le_bytes(b))),
        kind::DOUBLE => each(data, f64::from_le_bytes),
        _ => return None,
    })
}

/// Cells within cells that are followed.
const MAX_DEPTH: usize = 4;

/// Name and contents of an array; `None` for one that is passed over.
fn matrix(body: &[u8], depth: usize) -> Result<Option<(String, Variable)>, MatError> {
    if depth > MAX_DEPTH {
        return Ok(None);
    }
    let (_, flags, at) = element(body, 0)?;
    let (_, sizes, at) = element(body, at)?;
    let (_, name, mut at) = element(body, at)?;
    let name = String::from_utf8_lossy(name).into_owned();
    let class = *flags.first().ok_or(MatError::Damaged(0))?;
    let complex = flags.get(1).is_some_and(|f| f & 0x08 != 0);
    let dimensions: Vec<usize> =
        numbers(kind::INT32, sizes).unwrap_or_default().iter().map(|d| *d as usize).collect();
    let count = dimensions.iter().try_fold(1_usize, |n, d| n.checked_mul(*d));
    let count = count.ok_or(MatError::Damaged(0))?;
    match class {
        kind::CELL_CLASS => {
            let mut texts = Vec::new();
            for _ in 0..count {
                let (tag, cell, next) = element(body, at)?;
                at = next;
                let inner = if tag == kind::MATRIX && !cell.is_empty() {
                    matrix(cell, depth + 1)?
                } else {
                    None
                };
                texts.push(match inner {
                    Some((_, Variable::Text(text))) => text,
                    _ => String::new(),
                });
            }
            Ok(Some((name, Variable::Texts(texts))))
        }
        kind::CHAR_CLASS => {
            let (tag, data, _) = element(body, at)?;
            let text = if tag == kind::UTF8 {
                String::from_utf8_lossy(data).into_owned()
            } else {
                let units: Vec<u16> =
                    numbers(tag, data).unwrap_or_default().iter().map(|c| *c as u16).collect();
                String::from_utf16_lossy(&units)
            };
            Ok(Some((name, Variable::Text(text))))
        }
        kind::FIRST_NUMERIC_CLASS..=kind::LAST_NUMERIC_CLASS if !complex => {
            let (tag, data, _) = element(body, at)?;
            match numbers(tag, data) {
                Some(values) if values.len() == count => {
                    Ok(Some((name, Variable::Numbers { dimensions, values })))
                }
                _ => Err(MatError::Damaged(at)),
            }
        }
        _ => Ok(None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let mut file = MatFile::new();
        let values: Vec<f64> = (0..24).map(|k| f64::from(k) / 7.0).collect();
        file.array("cube", &[2, 3, 4], &values);
        file.text("t", "größer");
        file.text("none", "");
        file.cell_of_text("cells", &["a", "", "b c"]);
        let read = read(&file.into_bytes()).unwrap();
        assert_eq!(read["cube"], Variable::Numbers { dimensions: vec![2, 3, 4], values });
        assert_eq!(read["t"], Variable::Text("größer".into()));
        assert_eq!(read["none"], Variable::Text(String::new()));
        assert_eq!(read["cells"], Variable::Texts(vec!["a".into(), String::new(), "b c".into()]));
    }

    /// Damage anywhere is an error or a file of fewer variables, never a panic.
    #[test]
    fn damaged_files_do_not_panic() {
        let mut file = MatFile::new();
        file.array("x", &[2, 2], &[1.0, 2.0, 3.0, 4.0]);
        file.cell_of_text("cells", &["a", "b"]);
        let sound = file.into_bytes();
        for cut in 0..sound.len() {
            let _ = read(&sound[..cut]);
        }
        for at in 128..sound.len() {
            for byte in [0, 1, 0x7f, 0xff] {
                let mut bytes = sound.clone();
                bytes[at] = byte;
                let _ = read(&bytes);
            }
        }
        assert!(matches!(read(b"MATLAB 7.3"), Err(MatError::NotLevel5)));
        assert!(matches!(read(&sound[..140]), Err(MatError::Damaged(_))));
    }
}
