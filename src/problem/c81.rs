//! C81 airfoil tables.
//!
//! The format is that of the fixed columns of the FORTRAN days: a title of 30
//! characters and six counts of two digits (Mach numbers and angles of the
//! lift, drag and moment tables), then for each table a row of Mach numbers
//! (`7X,9F7.0`) and a row an angle (`10F7.0`: the angle in degrees, then
//! values). With more than nine Mach numbers, rows continue on the next line
//! after seven blanks, or stand on one wide line.
//!
//! Files of the world are read where they can mean one thing only: lines before
//! the title, blank lines, ends of line of any system, a byte order mark, and
//! numbers that stand apart by blanks instead of in columns. Every count is
//! held to its rows, in both directions.

use std::f64::consts::PI;

use super::{AirfoilTable, CoefficientGrid};
use crate::units::DEGREE;

/// What is wrong with a table file, or odd about it.
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

/// A table that has been read, and what is odd about its values.
#[derive(Debug, Clone, PartialEq)]
pub struct Read<T> {
    /// The table.
    pub table: T,
    /// What no such table should hold, by line.
    pub remarks: Vec<TableError>,
}

/// Values on one line of a table.
const ACROSS: usize = 9;
/// Width of a field.
const WIDTH: usize = 7;
/// Lines in which the title is looked for.
const PREAMBLE: usize = 200;
/// Where the counts stand in the line of the title.
const COUNTS: std::ops::Range<usize> = 30..42;
const HEADER_HELP: &str = "a C81 file begins with a title of 30 characters and six counts of two \
                           digits: Mach numbers and angles of the lift, drag and moment tables, \
                           such as 099609960996";
const FIELD_HELP: &str = "each number takes seven columns, such as \"  1.016\" or \" -.3409\", or \
                          stands apart from its neighbours by blanks";

/// Reads the text of a C81 file.
///
/// # Errors
/// On the first line that does not follow the format, holds a number that is
/// not finite, disagrees with the counts, or breaks an order: angles and Mach
/// numbers must increase strictly, and angles must span -180° to 180°.
pub fn parse(text: &str) -> Result<AirfoilTable, TableError> {
    read(text).map(|read| read.table)
}

/// As [`parse`], with what is odd about the values.
///
/// # Errors
/// As [`parse`].
pub fn read(text: &str) -> Result<Read<AirfoilTable>, TableError> {
    let text = text.trim_start_matches('\u{feff}').trim_end_matches('\u{1a}');
    let all: Vec<&str> = text.lines().collect();
    let mut found: Option<(usize, Read<AirfoilTable>)> = None;
    // The fault of the file that was understood furthest.
    let mut fault: Option<TableError> = None;
    for (index, line) in all.iter().enumerate().take(PREAMBLE) {
        let Ok(counts) = counts(line, index + 1) else { continue };
        match tables(&all, index, counts) {
            Ok(read) => {
                if let Some((other, _)) = &found {
                    return Err(TableError {
                        line: index + 1,
                        message: format!(
                            "this line can be the title and counts, and so can line {}",
                            other + 1
                        ),
                        help: "remove the lines before the one that is meant".into(),
                    });
                }
                found = Some((index, read));
            }
            Err(error) => {
                if fault.as_ref().is_none_or(|known| error.line > known.line) {
                    fault = Some(error);
                }
            }
        }
    }
    if let Some((_, read)) = found {
        return Ok(read);
    }
    if let Some(fault) = fault {
        return Err(fault);
    }
    // No line is a title: what is wrong with the first that may have been meant.
    let first = all
        .iter()
        .enumerate()
        .take(PREAMBLE)
        .find(|(_, line)| {
            line.get(COUNTS).is_some_and(|counts| {
                !counts.contains('.') && counts.bytes().filter(u8::is_ascii_digit).count() >= 6
            })
        })
        .or_else(|| all.iter().enumerate().find(|(_, line)| !line.trim().is_empty()));
    let Some((index, line)) = first else {
        return Err(TableError {
            line: 1,
            message: "the file ends where the title and counts should follow".into(),
            help: "check the counts on line 1 and that the file is whole".into(),
        });
    };
    Err(counts(line, index + 1).err().unwrap_or_else(|| TableError {
        line: index + 1,
        message: "no line holds the six counts".into(),
        help: HEADER_HELP.into(),
    }))
}

/// The six counts of a title.
fn counts(header: &str, line: usize) -> Result<[usize; 6], TableError> {
    let text = header.get(COUNTS.start..).unwrap_or("");
    let mut counts = [0; 6];
    for (index, count) in counts.iter_mut().enumerate() {
        let field = text.get(2 * index..2 * index + 2).unwrap_or("").trim();
        let number = field.parse().ok().filter(|count| *count > 0);
        *count = number.filter(|_| field.bytes().all(|b| b.is_ascii_digit())).ok_or_else(|| {
            TableError {
                line,
                message: format!(
                    "the count in columns {} and {} is not a whole number above zero",
                    COUNTS.start + 1 + 2 * index,
                    COUNTS.start + 2 + 2 * index
                ),
                help: HEADER_HELP.into(),
            }
        })?;
    }
    Ok(counts)
}

/// The three tables behind a title.
fn tables(
    all: &[&str],
    header: usize,
    counts: [usize; 6],
) -> Result<Read<AirfoilTable>, TableError> {
    let mut lines = Lines { lines: all, next: header + 1, header: header + 1 };
    let mut remarks = Vec::new();
    let mut grids = Vec::with_capacity(3);
    for (pair, what) in counts.chunks(2).zip([What::Lift, What::Drag, What::Moment]) {
        let (grid, rows) = grid(&mut lines, what, pair[0], pair[1])?;
        plausible(&grid, &rows, what, &mut remarks);
        grids.push(grid);
    }
    if let Some((number, line)) = lines.peek() {
        let message = if line.trim_start().starts_with(|c: char| c.is_ascii_digit() || c == '-') {
            let said = counts[5];
            format!("a row follows the {said} angles that line {} says", lines.header)
        } else {
            "text after the last table".into()
        };
        return Err(TableError {
            line: number,
            message: format!("{message}: the file should end with the moment table"),
            help: format!("check the counts on line {}", lines.header),
        });
    }
    let [lift, drag, moment] = <[CoefficientGrid; 3]>::try_from(grids)
        .unwrap_or_else(|grids| unreachable!("{} tables", grids.len()));
    let title = all[header].get(..COUNTS.start).unwrap_or_default().trim();
    let name = super::visible(title, false);
    Ok(Read { table: AirfoilTable { name, lift, drag, moment }, remarks })
}

/// A table of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum What {
    Lift,
    Drag,
    Moment,
}

impl What {
    fn word(self) -> &'static str {
        match self {
            Self::Lift => "lift",
            Self::Drag => "drag",
            Self::Moment => "moment",
        }
    }
}

struct Lines<'a> {
    lines: &'a [&'a str],
    /// Index of the next line, and so the number (from 1) of the last one taken.
    next: usize,
    /// Line of the title, from 1.
    header: usize,
}

/// One line of a table, taken apart.
struct Fields {
    /// What stands in columns 1 to 7, as a number; `None` where that is blank.
    head: Option<f64>,
    /// The values.
    values: Vec<f64>,
}

impl<'a> Lines<'a> {
    /// The next line that is not blank, and its number.
    fn peek(&self) -> Option<(usize, &'a str)> {
        let rest = self.lines.iter().enumerate().skip(self.next);
        rest.map(|(i, line)| (i + 1, *line)).find(|(_, line)| !line.trim().is_empty())
    }

    fn take(&mut self, expected: &str) -> Result<&'a str, TableError> {
        if let Some((number, line)) = self.peek() {
            self.next = number;
            return Ok(line);
        }
        // The last line that holds anything.
        let last = self.lines.iter().rposition(|line| !line.trim().is_empty());
        self.next = last.map_or(1, |index| index + 1);
        Err(self.fault(
            format!("the file ends where {expected} should follow"),
            format!("check the counts on line {} and that the file is whole", self.header),
        ))
    }

    fn fault(&self, message: String, help: impl Into<String>) -> TableError {
        TableError { line: self.next.max(1), message, help: help.into() }
    }

    /// A row of `count` values, over as many lines as they take, with the number
    /// in front of it: none before Mach numbers, the angle before others.
    fn row(
        &mut self,
        count: usize,
        angle: bool,
        said: &str,
        expected: &str,
    ) -> Result<(f64, Vec<f64>), TableError> {
        let line = self.take(expected)?;
        let first = self.next;
        let Fields { head, mut values } = self.fields(line, count, angle)?;
        let head = match (head, angle) {
            (Some(number), true) => number,
            (None, false) => 0.0,
            (None, true) => {
                return Err(self.fault(
                    format!(
                        "there is no angle in columns 1 to {WIDTH} where {expected} is expected: \
                         this looks like the Mach numbers of the next table, or the continuation \
                         of a longer row"
                    ),
                    format!("check the counts on line {}", self.header),
                ));
            }
            (Some(number), false) => {
                return Err(self.fault(
                    format!(
                        "there is {number} in columns 1 to {WIDTH}, which are blank before {expected}"
                    ),
                    format!(
                        "check the counts on line {}: this looks like a row of the table before",
                        self.header
                    ),
                ));
            }
        };
        while values.len() < count {
            // A row goes on only behind a full line, and behind blanks.
            let goes_on = values.len() % ACROSS == 0
                && self.peek().is_some_and(|(_, line)| {
                    line.get(..WIDTH.min(line.len())).is_some_and(|head| head.trim().is_empty())
                });
            if !goes_on {
                return Err(TableError {
                    line: first,
                    message: format!(
                        "{} value{} where {said}",
                        values.len(),
                        if values.len() == 1 { "" } else { "s" }
                    ),
                    help: format!("check the counts on line {}, and this row", self.header),
                });
            }
            let line = self.take(expected)?;
            let more = self.fields(line, count - values.len(), false)?;
            values.extend(more.values);
        }
        if values.len() > count {
            return Err(TableError {
                line: first,
                message: format!("{} values where {said}", values.len()),
                help: format!("check the counts on line {}, and this row", self.header),
            });
        }
        Ok((head, values))
    }

    /// The numbers of a line, in columns or apart by blanks: whichever can be
    /// meant. Where both can be and differ, the one with the count that is
    /// expected.
    fn fields(&self, line: &str, count: usize, angle: bool) -> Result<Fields, TableError> {
        if let Some(odd) = line.chars().find(|c| !c.is_ascii()) {
            return Err(self.fault(
                format!("`{odd}` is no ASCII character"),
                "the tables of a C81 file are plain numbers",
            ));
        }
        let free = self.apart(line, angle);
        if line.contains('\t') {
            // Columns mean nothing behind a tab.
            return free.ok_or_else(|| {
                self.fault("numbers and tabs that cannot be told apart".into(), FIELD_HELP)
            });
        }
        match (self.columns(line), free) {
            (Ok(columns), None) => Ok(columns),
            (Ok(columns), Some(free)) => {
                if columns.head == free.head && columns.values == free.values {
                    Ok(columns)
                } else if columns.values.len() != count && free.values.len() == count {
                    Ok(free)
                } else if columns.values.len() == count && free.values.len() != count {
                    Ok(columns)
                } else {
                    Err(self.fault(
                        format!(
                            "read in columns of {WIDTH} this line holds {:?}, read by blanks {:?}",
                            columns.values, free.values
                        ),
                        FIELD_HELP,
                    ))
                }
            }
            // Blanks in front of the first number do not say whether it is an angle.
            (Err(_), Some(free)) if free.values.len() == count => Ok(free),
            (Err(error), _) => Err(error),
        }
    }

    /// Numbers apart by blanks; the first is the angle where one is expected and
    /// the line begins before the end of its columns.
    fn apart(&self, line: &str, angle: bool) -> Option<Fields> {
        let mut values = Vec::new();
        for word in line.split_ascii_whitespace() {
            values.push(number(word)?);
        }
        let begins = line.len() - line.trim_start().len() < WIDTH || line.starts_with('\t');
        let head = (angle && begins && !values.is_empty()).then(|| values.remove(0));
        Some(Fields { head, values })
    }

    /// Numbers in columns of seven.
    fn columns(&self, line: &str) -> Result<Fields, TableError> {
        let line = line.trim_end();
        let field = |column: usize| {
            let start = (column * WIDTH).min(line.len());
            line[start..(start + WIDTH).min(line.len())].trim()
        };
        let value = |column: usize| {
            number(field(column)).ok_or_else(|| {
                let first = column * WIDTH + 1;
                self.fault(
                    format!(
                        "`{}` in columns {first} to {} is not a number",
                        field(column),
                        first + WIDTH - 1
                    ),
                    FIELD_HELP,
                )
            })
        };
        let head = if field(0).is_empty() { None } else { Some(value(0)?) };
        let count = line.len().div_ceil(WIDTH).max(1) - 1;
        let values = (1..=count).map(value).collect::<Result<_, _>>()?;
        Ok(Fields { head, values })
    }
}

/// A number as FORTRAN writes it, if it is one and finite.
fn number(field: &str) -> Option<f64> {
    let written = |text: &str| {
        text.bytes().all(|b| b.is_ascii_digit() || b"+-.eE".contains(&b))
            && text.contains(|c: char| c.is_ascii_digit())
    };
    let text =
        if field.contains(['d', 'D']) { field.replace(['d', 'D'], "e") } else { field.to_string() };
    if !written(&text) {
        return None;
    }
    text.parse::<f64>().ok().filter(|value| value.is_finite())
}

/// The lines of a grid: that of the Mach numbers, then one an angle.
type Rows = Vec<usize>;

fn grid(
    lines: &mut Lines<'_>,
    what: What,
    machs: usize,
    angles: usize,
) -> Result<(CoefficientGrid, Rows), TableError> {
    let name = what.word();
    let header = lines.header;
    let said = format!(
        "line {header} says {machs} Mach number{} for the {name} table",
        if machs == 1 { "" } else { "s" }
    );
    let expected = format!("the Mach numbers of the {name} table");
    let (_, mach) = lines.row(machs, false, &said, &expected)?;
    let mut rows = vec![lines.next];
    if mach.iter().any(|mach| *mach > LARGEST_MACH) {
        return Err(lines.fault(
            format!("a Mach number beyond {LARGEST_MACH} in the {name} table"),
            "Mach numbers of blades are below 1, such as 0.85",
        ));
    }
    if mach[0] < 0.0 || mach.windows(2).any(|pair| pair[1] <= pair[0]) {
        return Err(lines.fault(
            format!("the Mach numbers of the {name} table do not increase"),
            "Mach numbers must increase strictly from zero or above",
        ));
    }
    if let Some(pair) = mach.windows(2).find(|pair| pair[1] - pair[0] < LEAST_MACH_STEP) {
        return Err(lines.fault(
            format!("the Mach numbers {} and {} of the {name} table are one", pair[0], pair[1]),
            format!(
                "Mach numbers lie at least {LEAST_MACH_STEP} apart: the slope between nearer ones \
                 means nothing"
            ),
        ));
    }
    let mut degrees: Vec<f64> = Vec::with_capacity(angles);
    let mut value = Vec::with_capacity(angles * machs);
    for index in 0..angles {
        let expected = format!("row {} of {angles} of the {name} table", index + 1);
        let first = lines.peek().map_or(lines.next, |(number, _)| number);
        let (angle, row) = lines.row(machs, true, &said, &expected)?;
        if let Some(value) = row.iter().find(|value| value.abs() > LARGEST_COEFFICIENT) {
            return Err(TableError {
                line: first,
                message: format!("a coefficient of {value:e} in the {name} table"),
                help: format!(
                    "no coefficient is beyond {LARGEST_COEFFICIENT} either way: look for a missing \
                     decimal point"
                ),
            });
        }
        let ordered = match degrees.last() {
            None => angle == -180.0,
            Some(last) => angle - last >= LEAST_ANGLE_STEP,
        };
        if !ordered {
            return Err(TableError {
                line: first,
                message: format!("the angle {angle} is out of order in the {name} table"),
                help: format!(
                    "angles must begin at -180, increase by at least {LEAST_ANGLE_STEP} deg, and \
                     end at 180; line {header} says how many there are"
                ),
            });
        }
        rows.push(first);
        degrees.push(angle);
        value.extend(row);
    }
    if degrees.last() != Some(&180.0) {
        let follows = lines.peek().is_some_and(|(_, line)| {
            line.get(..WIDTH.min(line.len())).is_some_and(|head| !head.trim().is_empty())
        });
        return Err(lines.fault(
            if follows {
                format!(
                    "the {name} table goes on after the {angles} angles that line {header} says"
                )
            } else {
                format!("the {name} table does not end at an angle of 180")
            },
            format!(
                "angles must begin at -180, increase strictly, and end at 180; check the counts \
                 on line {header}"
            ),
        ));
    }
    let mut angle_of_attack: Vec<f64> = degrees.iter().map(|angle| angle * DEGREE).collect();
    // The ends are exact, so that the table closes on itself.
    angle_of_attack[0] = -PI;
    let last = angle_of_attack.len() - 1;
    angle_of_attack[last] = PI;
    Ok((CoefficientGrid { angle_of_attack, mach, value }, rows))
}

/// Coefficient beyond which a table is taken to be broken: surfaces through
/// larger values overflow, and no section comes near.
const LARGEST_COEFFICIENT: f64 = 1000.0;
/// Least step of Mach numbers: slopes over smaller ones overflow.
const LEAST_MACH_STEP: f64 = 1e-3;
/// Least step of angles, deg.
const LEAST_ANGLE_STEP: f64 = 1e-3;
/// Mach number beyond which a table is taken to be broken.
const LARGEST_MACH: f64 = 10.0;
/// Largest lift coefficient of a section with every flap there is.
const LARGEST_LIFT: f64 = 3.0;
/// Largest drag coefficient: a plate across the flow has 2.
const LARGEST_DRAG: f64 = 3.0;
/// Largest moment coefficient: a plate across the flow has 0.5.
const LARGEST_MOMENT: f64 = 2.0;
/// Least drag coefficient: the friction of a laminar plate at a Reynolds number
/// of ten millions, both sides, is 0.0008.
const LEAST_DRAG: f64 = 0.0008;
/// Slopes of lift at low speed, 1/rad, on either side of the 2π of thin airfoils.
const SLOPES: [f64; 2] = [2.0, 10.0];

/// What no section does, by rule; each rule once a table, at its first line.
fn plausible(grid: &CoefficientGrid, rows: &Rows, what: What, remarks: &mut Vec<TableError>) {
    let machs = grid.mach.len();
    let mut remark = |line: usize, message: String, help: &str| {
        remarks.push(TableError { line, message, help: help.into() });
    };
    let mut rule = |odd: &dyn Fn(f64) -> bool, message: &dyn Fn(&str) -> String, help: &str| {
        let mut found = grid.value.iter().enumerate().filter(|(_, value)| odd(**value));
        let Some((first, value)) = found.next() else { return };
        let (angle, mach) = (grid.angle_of_attack[first / machs], grid.mach[first % machs]);
        let more = match found.count() {
            0 => String::new(),
            1 => ", and at one more place".into(),
            count => format!(", and at {count} more places"),
        };
        let place = format!("{value} at {:.1} deg and Mach {mach}{more}", angle / DEGREE);
        remark(rows[1 + first / machs], message(&place), help);
    };
    match what {
        What::Lift => {
            rule(
                &|c| c.abs() > LARGEST_LIFT,
                &|place| format!("the lift coefficient is {place}"),
                "no section lifts with more than 3, flaps included: look for a missing decimal \
                 point",
            );
            if let Some(slope) = slope_at_zero(grid)
                && !(SLOPES[0]..=SLOPES[1]).contains(&slope)
            {
                remark(
                    rows[0],
                    format!(
                        "the lift grows with {slope:.2} per radian around 0 deg at Mach {}",
                        grid.mach[0]
                    ),
                    "thin airfoils have 6.28; check the signs and the angles, which are in degrees",
                );
            }
        }
        What::Drag if grid.value.iter().all(|drag| *drag == 0.0) => remark(
            rows[0],
            "the section has no drag: the drag table is zero throughout".into(),
            "powers will be those of an ideal rotor; give the drag of the section",
        ),
        What::Drag => {
            rule(
                &|c| c < 0.0,
                &|place| format!("the drag coefficient is {place}: negative drag drives the blade"),
                "drag coefficients are above zero",
            );
            rule(
                &|c| (0.0..LEAST_DRAG).contains(&c),
                &|place| format!("the drag coefficient is {place}"),
                "that is below the friction of a smooth plate",
            );
            rule(
                &|c| c > LARGEST_DRAG,
                &|place| format!("the drag coefficient is {place}"),
                "a plate across the flow has about 2: look for a missing decimal point",
            );
        }
        What::Moment => rule(
            &|c| c.abs() > LARGEST_MOMENT,
            &|place| format!("the moment coefficient is {place}"),
            "a plate across the flow has about 0.5: look for a missing decimal point",
        ),
    }
}

/// Slope of the values with the angle around zero, at the lowest Mach number,
/// 1/rad: over 4 degrees either way, or to the next angles beyond. `None` where
/// those are too far apart for a slope.
fn slope_at_zero(grid: &CoefficientGrid) -> Option<f64> {
    let machs = grid.mach.len();
    let angles = &grid.angle_of_attack;
    let reach = 4.0 * DEGREE;
    // Decimal degrees turned to radians may lie on either side.
    let high = angles.partition_point(|a| *a < reach - 1e-9).min(angles.len() - 1);
    let low = angles.partition_point(|a| *a <= -reach + 1e-9).saturating_sub(1);
    let run = angles[high] - angles[low];
    let rise = grid.value[high * machs] - grid.value[low * machs];
    (run > 0.0 && run < 20.0 * DEGREE).then(|| rise / run)
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
        let error = edit(4, &TABLE.lines().nth(3).unwrap().replacen("  .4473", "  1e308", 1));
        assert_eq!(error.line, 4);
        assert!(error.message.contains("1e308"), "{error}");
        assert_eq!(edit(2, "          0.00   0.20   99.0").line, 2);
        let cut: Vec<&str> = TABLE.lines().take(50).collect();
        let error = parse(&cut.join("\n")).unwrap_err();
        assert_eq!(error.line, 50);
        assert!(error.message.contains("file ends"));
        let error = parse(&format!("{TABLE}\nmore\n")).unwrap_err();
        assert!(error.message.contains("after the last table"));
        assert_eq!(parse("").unwrap_err().line, 1);
    }

    /// A table with these Mach numbers in each block and three angles, in columns.
    fn small(machs: usize, counts: &str, line: impl Fn(&str, &[String]) -> String) -> String {
        let mut text = format!("{:<30}{counts}\n", "A SMALL TABLE");
        let value = |i: usize| format!("{:.3}", 0.05 * i as f64 + 0.01);
        for block in 0..3 {
            text += &line(
                "",
                &(0..machs).map(|i| format!("{:.2}", 0.08 * i as f64)).collect::<Vec<_>>(),
            );
            for (row, angle) in ["-180.0", "0.0", "180.0"].into_iter().enumerate() {
                let values: Vec<String> = (0..machs).map(|i| value(i + row + block)).collect();
                text += &line(angle, &values);
            }
        }
        text
    }

    fn columns(head: &str, values: &[String]) -> String {
        let cells: String = values.iter().map(|v| format!("{v:>7}")).collect();
        format!("{head:>7}{cells}\n")
    }

    /// Files of the world that can mean one thing only mean it.
    #[test]
    fn real_world_files_read_as_the_plain_one() {
        let wrapped = |head: &str, values: &[String]| {
            let rest = if values.len() > 9 { columns("", &values[9..]) } else { String::new() };
            columns(head, &values[..values.len().min(9)]) + &rest
        };
        let plain = parse(&small(11, "110311031103", wrapped)).unwrap();
        let wide = small(11, "110311031103", columns);
        assert_eq!(parse(&wide).unwrap(), plain, "eleven values on one line");
        let apart = small(11, "110311031103", |head, values| {
            format!("{head:>6}   {}\n", values.join("  "))
        });
        assert_eq!(parse(&apart).unwrap(), plain, "apart by blanks");
        let tabs =
            small(11, "110311031103", |head, values| format!("{head}\t{}\n", values.join("\t")));
        assert_eq!(parse(&tabs).unwrap(), plain, "tabs");
        assert_eq!(parse(&wide.replace('\n', "\r\n")).unwrap(), plain, "CRLF");
        assert_eq!(parse(&format!("\u{feff}{wide}\u{1a}")).unwrap(), plain, "mark and end of file");
        assert_eq!(parse(&wide.replace("\n       ", "\n\n       ")).unwrap(), plain, "blank lines");
        let preamble =
            "! Wind tunnel of 1962, Reynolds number 3·10⁶\n# by hand: 11 Mach numbers\n\n";
        assert_eq!(parse(&format!("{preamble}{wide}")).unwrap(), plain, "lines before the title");
        assert_eq!(parse(&wide.replace("0.010", "1.0D-2")).unwrap(), plain, "exponents of FORTRAN");
        // The file of the repository, each way.
        let plain = parse(TABLE).unwrap();
        assert_eq!(parse(&TABLE.replace('\n', "\r\n")).unwrap(), plain);
        assert_eq!(parse(&format!("{preamble}{TABLE}")).unwrap(), plain);
    }

    /// Every count that disagrees with its rows is an error, either way, and
    /// names the line where it shows.
    #[test]
    fn counts_are_held_to_their_rows() {
        let said = |counts: &str| small(4, counts, columns);
        assert!(parse(&said("040304030403")).is_ok());
        // Title, then four lines a table.
        for (counts, line, part) in [
            ("030304030403", 2, "4 values where line 1 says 3 Mach numbers for the lift table"),
            ("050304030403", 2, "4 values where line 1 says 5 Mach numbers for the lift table"),
            ("040303030403", 6, "4 values where line 1 says 3 Mach numbers for the drag table"),
            ("040305030403", 6, "4 values where line 1 says 5 Mach numbers for the drag table"),
            ("040304030303", 10, "4 values where line 1 says 3 Mach numbers for the moment table"),
            ("040304030503", 10, "4 values where line 1 says 5 Mach numbers for the moment table"),
            ("040204030403", 4, "goes on after the 2 angles that line 1 says"),
            ("040404030403", 6, "no angle in columns 1 to 7"),
            ("040304020403", 8, "goes on after the 2 angles"),
            ("040304040403", 10, "no angle in columns 1 to 7"),
            ("040304030402", 12, "goes on after the 2 angles"),
            ("040304030404", 13, "the file ends where row 4 of 4 of the moment table"),
        ] {
            let error = parse(&said(counts)).unwrap_err();
            assert_eq!(error.line, line, "{counts}: {error}");
            assert!(error.message.contains(part), "{counts}: {error}");
            assert!(format!("{error} {}", error.help).contains("line 1"), "{counts}: {error:?}");
        }
        // One count of the file of the repository off by one: 99 ways.
        let header = TABLE.lines().next().unwrap();
        let counts: Vec<usize> =
            (0..6).map(|i| header[30 + 2 * i..32 + 2 * i].trim().parse().unwrap()).collect();
        for index in 0..6 {
            for off in [-1i64, 1] {
                let mut other = counts.clone();
                other[index] = (other[index] as i64 + off) as usize;
                let written: String = other.iter().map(|n| format!("{n:2}")).collect();
                let text = TABLE.replacen(&header[30..42], &written, 1);
                assert!(parse(&text).is_err(), "count {index} off by {off}");
            }
        }
    }

    /// A title that stands twice is a line before the title.
    #[test]
    fn a_repeated_title_is_a_preamble() {
        let text = small(4, "040304030403", columns);
        let twice = format!("{}\n{text}", text.lines().next().unwrap());
        assert_eq!(parse(&twice).unwrap(), parse(&text).unwrap());
        let error = parse(&text.replacen("0.060", "0.06.0", 1)).unwrap_err();
        assert!(error.message.contains("`0.06.` in columns 15 to 21"), "{error}");
    }

    /// A line whose columns and blanks say different things is not guessed at.
    #[test]
    fn lines_that_can_mean_two_things_are_refused() {
        let text = small(2, "020302030203", columns);
        // Shifted by one column: `0.060` ends in the next field.
        let odd = text.replacen("   0.0  0.060  0.110", "   0.0   0.060.110 1", 1);
        assert_ne!(odd, text);
        let error = parse(&odd).unwrap_err();
        assert_eq!(error.line, 4, "{error}");
    }

    /// What no section does is remarked, by rule, at its line.
    #[test]
    fn implausible_values_are_remarked() {
        assert_eq!(read(TABLE).unwrap().remarks, []);
        let header = TABLE.lines().next().unwrap();
        assert!(header.ends_with("099609960996"));
        let edit = |line: usize, from: &str, to: &str| {
            let mut lines: Vec<String> = TABLE.lines().map(String::from).collect();
            assert!(lines[line - 1].contains(from), "{}", lines[line - 1]);
            lines[line - 1] = lines[line - 1].replacen(from, to, 1);
            read(&lines.join("\n")).unwrap().remarks
        };
        // Line 4: -175 deg, lift .4473.
        let remarks = edit(4, "  .4473", " 100.00");
        assert_eq!(remarks.len(), 1, "{remarks:?}");
        assert_eq!(remarks[0].line, 4);
        assert!(remarks[0].message.contains("100 at -175.0 deg and Mach 0"), "{remarks:?}");
        let drag: Vec<String> = TABLE
            .lines()
            .enumerate()
            .map(|(i, line)| match i {
                // Lift: lines 2 to 98; drag: 99 to 195.
                99..=194 => format!("{}{}", &line[..7], "  .0000".repeat(9)),
                _ => line.into(),
            })
            .collect();
        let remarks = read(&drag.join("\n")).unwrap().remarks;
        assert_eq!(remarks.len(), 1, "{remarks:?}");
        assert!(remarks[0].message.contains("no drag"), "{remarks:?}");
        let negative: Vec<String> = drag
            .iter()
            .map(|line| line.replace("  .0000".repeat(9).as_str(), &" -.0100".repeat(9)))
            .collect();
        let remarks = read(&negative.join("\n")).unwrap().remarks;
        assert!(remarks.iter().any(|r| r.message.contains("negative drag")), "{remarks:?}");
    }

    proptest::proptest! {
        #[test]
        fn any_text_is_answered_without_panic(text in "(\\PC|\n){0,400}") {
            let _ = parse(&text);
            let _ = parse(&format!("{:<30}010301030103\n{text}", "TITLE"));
        }
    }
}
