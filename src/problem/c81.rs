//! C81 airfoil tables.
//!
//! The format is that of the fixed columns of the FORTRAN days: a title of 30
//! characters and six counts of two digits (Mach numbers and angles of the
//! lift, drag and moment tables), then for each table a row of Mach numbers
//! (`7X,9F7.0`) and a row an angle (`10F7.0`: the angle in degrees, then
//! values). With more than nine Mach numbers, rows continue on the next line
//! after seven blanks.

use std::f64::consts::PI;

use super::{AirfoilTable, CoefficientGrid};
use crate::units::DEGREE;

/// What is wrong with a table file.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {message}")]
pub struct TableError {
    /// Line of the file, from 1.
    pub line: usize,
    /// What is wrong.
    pub message: String,
    /// What belongs there.
    pub help: String,
}

/// Values on one line of a table.
const ACROSS: usize = 9;
/// Width of a field.
const WIDTH: usize = 7;

/// Reads the text of a C81 file.
///
/// # Errors
/// On the first line that does not follow the format, holds a number that is
/// not finite, or breaks an order: angles and Mach numbers must increase
/// strictly, and angles must span -180° to 180°.
pub fn parse(text: &str) -> Result<AirfoilTable, TableError> {
    let mut lines = Lines { lines: text.lines().collect(), next: 0 };
    let header = lines.take("the title and counts")?;
    if let Some(index) = text.lines().position(|line| !line.is_ascii()) {
        return Err(TableError {
            line: index + 1,
            message: "a character outside ASCII".into(),
            help: "C81 tables are plain text in fixed columns".into(),
        });
    }
    let counts_text = header.get(30..).unwrap_or("");
    let mut counts = [0; 6];
    for (index, count) in counts.iter_mut().enumerate() {
        let field = counts_text.get(2 * index..2 * index + 2).unwrap_or("").trim();
        *count = field.parse().ok().filter(|count| *count > 0).ok_or_else(|| {
            lines.fault(
                format!(
                    "the count in columns {} and {} is not a whole number above zero",
                    31 + 2 * index,
                    32 + 2 * index
                ),
                "a C81 file begins with a title of 30 characters and six counts of two digits: \
                 Mach numbers and angles of the lift, drag and moment tables, such as 099609960996",
            )
        })?;
    }
    let lift = grid(&mut lines, "lift", counts[0], counts[1])?;
    let drag = grid(&mut lines, "drag", counts[2], counts[3])?;
    let moment = grid(&mut lines, "moment", counts[4], counts[5])?;
    while lines.next < lines.lines.len() {
        if !lines.take("the end")?.trim().is_empty() {
            return Err(lines.fault(
                "text after the last table".into(),
                "check the counts on line 1: the file should end with the moment table",
            ));
        }
    }
    Ok(AirfoilTable { name: header[..30].trim().into(), lift, drag, moment })
}

struct Lines<'a> {
    lines: Vec<&'a str>,
    /// Index of the next line, and so the number (from 1) of the last one taken.
    next: usize,
}

impl<'a> Lines<'a> {
    fn take(&mut self, expected: &str) -> Result<&'a str, TableError> {
        let line = self.lines.get(self.next).copied();
        self.next += 1;
        line.ok_or_else(|| {
            self.next = self.lines.len().max(1);
            self.fault(
                format!("the file ends where {expected} should follow"),
                "check the counts on line 1 and that the file is whole",
            )
        })
    }

    fn fault(&self, message: String, help: &str) -> TableError {
        TableError { line: self.next.max(1), message, help: help.into() }
    }

    /// `count` numbers from columns 8 on, over as many lines as they take;
    /// with them what stands in columns 1 to 7 of the first line.
    fn row(&mut self, count: usize, expected: &str) -> Result<(&'a str, Vec<f64>), TableError> {
        let mut values = Vec::with_capacity(count);
        let mut head = "";
        while values.len() < count {
            let line = self.take(expected)?;
            if values.is_empty() {
                head = line.get(..WIDTH.min(line.len())).unwrap_or("");
            }
            for column in 1..=ACROSS.min(count - values.len()) {
                values.push(self.field(line, column)?);
            }
        }
        Ok((head, values))
    }

    fn field(&self, line: &str, column: usize) -> Result<f64, TableError> {
        let start = (column * WIDTH).min(line.len());
        let end = (start + WIDTH).min(line.len());
        self.number(&line[start..end], column * WIDTH + 1)
    }

    fn number(&self, field: &str, column: usize) -> Result<f64, TableError> {
        let field = field.trim();
        match field.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(self.fault(
                format!("`{field}` in columns {column} to {} is not a number", column + WIDTH - 1),
                "each number takes seven columns, such as \"  1.016\" or \" -.3409\"",
            )),
        }
    }
}

fn grid(
    lines: &mut Lines<'_>,
    what: &str,
    machs: usize,
    angles: usize,
) -> Result<CoefficientGrid, TableError> {
    let (_, mach) = lines.row(machs, &format!("the Mach numbers of the {what} table"))?;
    if mach[0] < 0.0 || mach.windows(2).any(|pair| pair[1] <= pair[0]) {
        return Err(lines.fault(
            format!("the Mach numbers of the {what} table do not increase"),
            "Mach numbers must increase strictly from zero or above",
        ));
    }
    let mut degrees: Vec<f64> = Vec::with_capacity(angles);
    let mut value = Vec::with_capacity(angles * machs);
    for index in 0..angles {
        let expected = format!("row {} of {angles} of the {what} table", index + 1);
        let first = lines.next + 1;
        let (head, row) = lines.row(machs, &expected)?;
        let angle = Lines { lines: Vec::new(), next: first }.number(head, 1)?;
        let ordered = match degrees.last() {
            None => angle == -180.0,
            Some(last) => angle > *last,
        };
        if !ordered {
            return Err(TableError {
                line: first,
                message: format!("the angle {angle} is out of order in the {what} table"),
                help: "angles must begin at -180, increase strictly, and end at 180".into(),
            });
        }
        degrees.push(angle);
        value.extend(row);
    }
    if degrees.last() != Some(&180.0) {
        return Err(lines.fault(
            format!("the {what} table does not end at an angle of 180"),
            "angles must begin at -180, increase strictly, and end at 180",
        ));
    }
    let mut angle_of_attack: Vec<f64> = degrees.iter().map(|angle| angle * DEGREE).collect();
    // The ends are exact, so that the table closes on itself.
    angle_of_attack[0] = -PI;
    let last = angle_of_attack.len() - 1;
    angle_of_attack[last] = PI;
    Ok(CoefficientGrid { angle_of_attack, mach, value })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &str = include_str!("../../problems/airfoils/naca23012.c81");

    #[test]
    fn val_table_of_the_repository_reads_as_printed() {
        let table = parse(TABLE).unwrap();
        assert_eq!(table.name, "NACA 23012 XFOIL-FIT+FLATPLATE");
        let expected = [0.0, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9];
        for grid in [&table.lift, &table.drag, &table.moment] {
            assert_eq!(grid.mach, expected);
            assert_eq!(grid.angle_of_attack.len(), 96);
            assert_eq!(grid.value.len(), 96 * 9);
            assert_eq!(grid.angle_of_attack[0], -PI);
            assert_eq!(grid.angle_of_attack[95], PI);
        }
        // Line 15 of the file: -100 deg, .3409 throughout.
        let index = TABLE.lines().skip(2).position(|line| line.starts_with(" -100.0")).unwrap();
        assert!((table.lift.angle_of_attack[index] - -100.0 * DEGREE).abs() < 1e-15);
        assert!((0..9).all(|mach| table.lift.value[index * 9 + mach] == 0.3409));
    }

    /// A table whose rows need two lines, since it has eleven Mach numbers.
    #[test]
    fn long_rows_continue_after_seven_blanks() {
        let row = |head: &str, values: &[f64]| {
            let mut text = format!("{head:>7}");
            for (index, value) in values.iter().enumerate() {
                if index == 9 {
                    text += "\n       ";
                }
                text += &format!("{value:7.3}");
            }
            text + "\n"
        };
        let machs: Vec<f64> = (0..11).map(|i| 0.1 * f64::from(i)).collect();
        let mut text = format!("{:<30}110301030103\n", "TWO LINES A ROW");
        text += &row("", &machs);
        for angle in ["-180.0", "0.0", "180.0"] {
            text += &row(angle, &machs.iter().map(|m| m + 1.0).collect::<Vec<_>>());
        }
        for _ in 0..2 {
            text += &row("", &[0.5]);
            for angle in ["-180.0", "0.0", "180.0"] {
                text += &row(angle, &[0.25]);
            }
        }
        let table = parse(&text).unwrap();
        assert_eq!(table.lift.mach.len(), 11);
        assert_eq!(table.lift.value[11 + 10], 2.0);
        assert_eq!(table.drag.value, [0.25; 3]);
    }

    #[test]
    fn faults_name_their_line() {
        let edit = |line: usize, with: &str| {
            let mut lines: Vec<&str> = TABLE.lines().collect();
            lines[line - 1] = with;
            parse(&lines.join("\n")).unwrap_err()
        };
        assert_eq!(edit(1, "short").line, 1);
        assert_eq!(edit(2, "          0.00   0.20   0.20").line, 2);
        let error = edit(4, " -175.0  .4473    nan  .4473");
        assert_eq!(error.line, 4);
        assert!(error.message.contains("nan"));
        assert_eq!(edit(3, &TABLE.lines().nth(3).unwrap().replace("-175", "-170")).line, 3);
        assert_eq!(edit(5, &TABLE.lines().nth(3).unwrap().replace("-175", "-179")).line, 5);
        let cut: Vec<&str> = TABLE.lines().take(50).collect();
        let error = parse(&cut.join("\n")).unwrap_err();
        assert_eq!(error.line, 50);
        assert!(error.message.contains("file ends"));
        let error = parse(&format!("{TABLE}\nmore\n")).unwrap_err();
        assert!(error.message.contains("after the last table"));
        assert_eq!(parse("").unwrap_err().line, 1);
    }

    proptest::proptest! {
        #[test]
        fn any_text_is_answered_without_panic(text in "(\\PC|\n){0,400}") {
            let _ = parse(&text);
            let _ = parse(&format!("{:<30}010301030103\n{text}", "TITLE"));
        }
    }
}
