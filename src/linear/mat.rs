//! Reads MAT files of level 5, as MATLAB, Octave and SciPy write them.

use std::collections::BTreeMap;
use std::io::Read as _;

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
    /// A cell array of texts, or the rows of a character matrix; empty for
    /// cells that are empty.
    Texts(Vec<String>),
    /// A cell array that holds other things than texts; `None` for cells that
    /// are passed over.
    Cells(Vec<Option<Variable>>),
    /// A struct array, one element a set of fields. A plain struct has one
    /// element.
    Structs(Vec<BTreeMap<String, Variable>>),
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
    pub const STRUCT_CLASS: u8 = 2;
    pub const CHAR_CLASS: u8 = 4;
    pub const FIRST_NUMERIC_CLASS: u8 = 6;
    pub const LAST_NUMERIC_CLASS: u8 = 15;
}

/// The variables of a MAT file of level 5, compressed or not. Objects, sparse
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
    let (_, name, at) = element(body, at)?;
    let name = String::from_utf8_lossy(name).into_owned();
    let class = *flags.first().ok_or(MatError::Damaged(0))?;
    let complex = flags.get(1).is_some_and(|f| f & 0x08 != 0);
    let dimensions: Vec<usize> =
        numbers(kind::INT32, sizes).unwrap_or_default().iter().map(|d| *d as usize).collect();
    let count = dimensions.iter().try_fold(1_usize, |n, d| n.checked_mul(*d));
    let count = count.ok_or(MatError::Damaged(0))?;
    match class {
        kind::CELL_CLASS => Ok(Some((name, cells(body, at, count, depth)?))),
        kind::STRUCT_CLASS => Ok(Some((name, structs(body, at, count, depth)?))),
        kind::CHAR_CLASS => {
            let (tag, data, _) = element(body, at)?;
            let rows = dimensions.first().copied().unwrap_or(0);
            let text = if tag == kind::UTF8 {
                String::from_utf8_lossy(data).into_owned()
            } else {
                let units: Vec<u16> =
                    numbers(tag, data).unwrap_or_default().iter().map(|c| *c as u16).collect();
                String::from_utf16_lossy(&units)
            };
            if rows <= 1 {
                return Ok(Some((name, Variable::Text(text))));
            }
            // A matrix of characters, the first index running fastest.
            let all: Vec<char> = text.chars().collect();
            if all.len() != count {
                return Err(MatError::Damaged(at));
            }
            let row = |i: usize| -> String { all.iter().skip(i).step_by(rows).collect() };
            let texts = (0..rows).map(|i| row(i).trim_end().to_owned()).collect();
            Ok(Some((name, Variable::Texts(texts))))
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

/// The next array within another, `None` for one that is empty or passed over.
fn inner(body: &[u8], at: usize, depth: usize) -> Result<(Option<Variable>, usize), MatError> {
    let (tag, data, next) = element(body, at)?;
    let found =
        if tag == kind::MATRIX && !data.is_empty() { matrix(data, depth + 1)? } else { None };
    Ok((found.map(|(_, variable)| variable), next))
}

fn cells(body: &[u8], mut at: usize, count: usize, depth: usize) -> Result<Variable, MatError> {
    let mut found = Vec::new();
    for _ in 0..count {
        let (variable, next) = inner(body, at, depth)?;
        at = next;
        found.push(variable);
    }
    // An empty cell is an empty text, or an empty array of numbers.
    let empty = |v: &Variable| matches!(v, Variable::Numbers { values, .. } if values.is_empty());
    let textual = |v: &Option<Variable>| match v {
        None | Some(Variable::Text(_)) => true,
        Some(other) => empty(other),
    };
    Ok(if found.iter().all(textual) {
        Variable::Texts(
            found
                .into_iter()
                .map(|v| if let Some(Variable::Text(text)) = v { text } else { String::new() })
                .collect(),
        )
    } else {
        Variable::Cells(found)
    })
}

fn structs(body: &[u8], at: usize, count: usize, depth: usize) -> Result<Variable, MatError> {
    let (tag, length, at) = element(body, at)?;
    let length = numbers(tag, length)
        .and_then(|l| l.first().copied())
        .filter(|l| *l >= 1.0)
        .ok_or(MatError::Damaged(at))? as usize;
    let (_, names, mut at) = element(body, at)?;
    let names: Vec<String> = names
        .chunks(length)
        .map(|name| {
            let end = name.iter().position(|b| *b == 0).unwrap_or(name.len());
            String::from_utf8_lossy(&name[..end]).into_owned()
        })
        .collect();
    let mut elements = Vec::new();
    // A struct without fields takes no room, whatever its size says.
    for _ in 0..if names.is_empty() { 0 } else { count } {
        let mut fields = BTreeMap::new();
        for name in &names {
            let (variable, next) = inner(body, at, depth)?;
            at = next;
            if let Some(variable) = variable {
                fields.insert(name.clone(), variable);
            }
        }
        elements.push(fields);
    }
    Ok(Variable::Structs(elements))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::io::MatFile;

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

    /// Tag, data and padding.
    fn put(out: &mut Vec<u8>, tag: u32, data: &[u8]) {
        out.extend(tag.to_le_bytes());
        out.extend((data.len() as u32).to_le_bytes());
        out.extend(data);
        out.resize(out.len().next_multiple_of(8), 0);
    }

    /// Flags, sizes and name of an array, by the format's description.
    fn head(class: u8, name: &str, sizes: &[i32]) -> Vec<u8> {
        let mut out = Vec::new();
        put(&mut out, 6, &[class, 0, 0, 0, 0, 0, 0, 0]);
        let sizes: Vec<u8> = sizes.iter().flat_map(|s| s.to_le_bytes()).collect();
        put(&mut out, kind::INT32, &sizes);
        put(&mut out, kind::INT8, name.as_bytes());
        out
    }

    fn scalar(value: f64) -> Vec<u8> {
        let mut out = head(6, "", &[1, 1]);
        put(&mut out, kind::DOUBLE, &value.to_le_bytes());
        out
    }

    /// A struct array, a cell of matrices and a matrix of characters, as MATLAB
    /// writes them.
    #[test]
    fn structs_cells_and_character_matrices() {
        let mut file = MatFile::new().into_bytes();
        let mut body = head(kind::STRUCT_CLASS, "s", &[1, 2]);
        put(&mut body, kind::INT32, &8_i32.to_le_bytes());
        put(&mut body, kind::INT8, b"a\0\0\0\0\0\0\0bee\0\0\0\0\0");
        for value in [1.0, 2.0, 3.0, 4.0] {
            put(&mut body, kind::MATRIX, &scalar(value));
        }
        put(&mut file, kind::MATRIX, &body);
        let mut body = head(kind::CELL_CLASS, "c", &[2, 1]);
        put(&mut body, kind::MATRIX, &scalar(5.0));
        put(&mut body, kind::MATRIX, &[]);
        put(&mut file, kind::MATRIX, &body);
        let mut body = head(kind::CHAR_CLASS, "t", &[2, 3]);
        put(&mut body, kind::UINT8, b"abc  d");
        put(&mut file, kind::MATRIX, &body);
        let all = read(&file).unwrap();
        let number = |value: f64| Variable::Numbers { dimensions: vec![1, 1], values: vec![value] };
        let Variable::Structs(elements) = &all["s"] else { panic!("{:?}", all["s"]) };
        assert_eq!(elements.len(), 2);
        assert_eq!((&elements[0]["a"], &elements[0]["bee"]), (&number(1.0), &number(2.0)));
        assert_eq!((&elements[1]["a"], &elements[1]["bee"]), (&number(3.0), &number(4.0)));
        assert_eq!(all["c"], Variable::Cells(vec![Some(number(5.0)), None]));
        assert_eq!(all["t"], Variable::Texts(vec!["ac".into(), "b d".into()]));
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
