//! Fuselage load tables as comma-separated text.

use super::FuselageTable;
use super::c81::{Read, TableError};
use crate::units::{DEGREE, FOOT};

/// Header of a table in feet; one in metres has `_m2` and `_m3`.
const COLUMNS: [&str; 8] = ["alpha", "beta", "x", "y", "z", "l", "m", "n"];
const HELP: &str = "the header is alpha_deg,beta_deg,x_ft2,y_ft2,z_ft2,l_ft3,m_ft3,n_ft3 \
                    (or _m2 and _m3), and each line below it holds eight numbers";

/// Reads loads per dynamic pressure on a grid of angle of attack and sideslip.
///
/// Rows may come in any order, but every pair of angles must appear once.
///
/// # Errors
/// On the first line that does not follow the format, and on a grid that is
/// not full or has fewer than two angles either way.
pub fn parse(text: &str) -> Result<FuselageTable, TableError> {
    read(text).map(|read| read.table)
}

/// As [`parse`], with what is odd about the values.
///
/// # Errors
/// As [`parse`].
pub fn read(text: &str) -> Result<Read<FuselageTable>, TableError> {
    let text = text.trim_start_matches('\u{feff}');
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(text.as_bytes());
    let fault = |line: usize, message: String| TableError { line, message, help: HELP.into() };
    let mut scale = None;
    let mut rows: Vec<([f64; 8], usize)> = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|error| {
            let line = error.position().map_or(1, |at| at.line() as usize);
            fault(line, "the line cannot be read".into())
        })?;
        let line = record.position().map_or(1, |at| at.line() as usize);
        let Some(scale) = scale else {
            let header: Vec<&str> = record.iter().collect();
            let is = |area: &str, volume: &str| {
                header.len() == 8
                    && header.iter().zip(COLUMNS).enumerate().all(|(index, (have, name))| {
                        let unit = match index {
                            0 | 1 => "deg",
                            2..=4 => area,
                            _ => volume,
                        };
                        *have == format!("{name}_{unit}")
                    })
            };
            scale = if is("ft2", "ft3") {
                Some(FOOT)
            } else if is("m2", "m3") {
                Some(1.0)
            } else {
                return Err(fault(line, "the header is not as it should be".into()));
            };
            continue;
        };
        if record.len() != 8 {
            return Err(fault(line, format!("{} values where 8 are expected", record.len())));
        }
        let mut row = [0.0; 8];
        for (index, (field, value)) in record.iter().zip(&mut row).enumerate() {
            let number = field.parse::<f64>().ok().filter(|number| number.is_finite());
            let number =
                number.ok_or_else(|| fault(line, format!("`{field}` is not a finite number")))?;
            *value = number
                * match index {
                    0 | 1 => DEGREE,
                    2..=4 => scale * scale,
                    _ => scale * scale * scale,
                };
        }
        bounds(&row).map_err(|message| fault(line, message))?;
        rows.push((row, line));
    }
    // Equal angles side by side; `+ 0.0` makes −0 to 0.
    rows.iter_mut().for_each(|(row, _)| row.iter_mut().for_each(|value| *value += 0.0));
    rows.sort_by(|(a, _), (b, _)| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    if let Some(pair) = rows.windows(2).find(|pair| pair[0].0[..2] == pair[1].0[..2]) {
        let line = pair[0].1.max(pair[1].1);
        return Err(fault(line, "this pair of angles has been given before".into()));
    }
    let axis = |index: usize| {
        let mut angles: Vec<f64> = rows.iter().map(|(row, _)| row[index]).collect();
        angles.sort_by(f64::total_cmp);
        angles.dedup();
        angles
    };
    let (angle_of_attack, sideslip) = (axis(0), axis(1));
    let last = rows.iter().map(|(_, line)| *line).max().unwrap_or(1);
    for angles in [&angle_of_attack, &sideslip] {
        if let Some(pair) = angles.windows(2).find(|pair| pair[1] - pair[0] < LEAST_STEP) {
            let [low, high] = [pair[0] / DEGREE, pair[1] / DEGREE];
            return Err(fault(last, format!("the angles {low} and {high} deg are one")));
        }
    }
    if angle_of_attack.len() < 2 || sideslip.len() < 2 {
        return Err(fault(last, "fewer than two angles of attack or of sideslip".into()));
    }
    if rows.len() != angle_of_attack.len() * sideslip.len() {
        return Err(fault(
            last,
            format!(
                "{} rows cannot fill a grid of {} angles of attack and {} of sideslip",
                rows.len(),
                angle_of_attack.len(),
                sideslip.len()
            ),
        ));
    }
    let remarks = plausible(&rows);
    let table = FuselageTable {
        angle_of_attack,
        sideslip,
        loads: std::array::from_fn(|load| rows.iter().map(|(row, _)| row[load + 2]).collect()),
    };
    Ok(Read { table, remarks })
}

/// Least step of angles, rad: slopes over smaller ones mean nothing.
const LEAST_STEP: f64 = 1e-3 * DEGREE;
/// Largest force per dynamic pressure, ft²: that of equivalent flat plates.
const LARGEST_AREA: f64 = 10_000.0;
/// Largest moment per dynamic pressure, ft³: that area on an arm of 100 ft.
const LARGEST_VOLUME: f64 = 1_000_000.0;

/// Whether a row holds angles and loads of a fuselage.
fn bounds(row: &[f64; 8]) -> Result<(), String> {
    let slack = 1.0 + 1e-9;
    for (index, value) in row.iter().enumerate() {
        let (unit, most, shown) = match index {
            0 => (DEGREE, 180.0, "deg"),
            1 => (DEGREE, 90.0, "deg"),
            2..=4 => (FOOT * FOOT, LARGEST_AREA, "ft^2"),
            _ => (FOOT * FOOT * FOOT, LARGEST_VOLUME, "ft^3"),
        };
        if value.abs() > most * unit * slack {
            return Err(format!(
                "{} is {:.3e} {shown}: no fuselage has more than {most} {shown} either way",
                COLUMNS[index],
                value / unit
            ));
        }
    }
    Ok(())
}

/// What no fuselage does, by rule; each rule at its first line.
fn plausible(rows: &[([f64; 8], usize)]) -> Vec<TableError> {
    let mut remarks = Vec::new();
    let mut rule = |odd: &dyn Fn(&[f64; 8]) -> bool, message: &str, help: &str| {
        if let Some((_, line)) = rows.iter().filter(|(row, _)| odd(row)).min_by_key(|row| row.1) {
            remarks.push(TableError { line: *line, message: message.into(), help: help.into() });
        }
    };
    // Lift leans forward in body axes: the drag is the force along the flow.
    let drag = |row: &[f64; 8]| {
        let ((sa, ca), (sb, cb)) = (row[0].sin_cos(), row[1].sin_cos());
        -(row[2] * ca * cb + row[3] * sb + row[4] * sa * cb)
    };
    rule(
        &|row| row[0].abs() < 0.5 && row[1].abs() < 0.5 && drag(row) < 0.0,
        "the drag is negative: the force along the flow from ahead pushes into the wind",
        "x points forward, y to starboard and z down, so that drag is a negative x",
    );
    if rows.iter().all(|(row, _)| row[2] == 0.0) {
        rule(
            &|_| true,
            "the fuselage has no drag: x is zero throughout",
            "powers in forward flight will be too low; give the drag of the fuselage",
        );
    }
    remarks
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "alpha_deg,beta_deg,x_ft2,y_ft2,z_ft2,l_ft3,m_ft3,n_ft3\n";

    #[test]
    fn rows_of_any_order_fill_the_grid() {
        let text = format!(
            "{HEADER}10,-5,1,2,3,4,5,6\n0,-5,7,8,9,10,11,12\n\n# a remark\n0,5,1,1,1,1,1,1\n\
             10,5,2,2,2,2,2,2\n"
        );
        let table = parse(&text).unwrap();
        assert_eq!(table.angle_of_attack, [0.0, 10.0 * DEGREE]);
        assert_eq!(table.sideslip, [-5.0 * DEGREE, 5.0 * DEGREE]);
        let square = FOOT * FOOT;
        assert_eq!(table.loads[0], [7.0 * square, square, square, 2.0 * square]);
        let cube = square * FOOT;
        assert_eq!(table.loads[5][2], 6.0 * cube);
    }

    /// 40,000 rows in any order: no pair of rows is compared twice.
    #[test]
    fn large_grids_are_read() {
        let mut text = String::from(HEADER);
        for i in 0..200 {
            for j in (0..200).rev() {
                text += &format!("{},{},-1,0,0,0,0,0\n", 0.5 * f64::from(i), 0.25 * f64::from(j));
            }
        }
        assert_eq!(parse(&text).unwrap().loads[0].len(), 40_000);
    }

    #[test]
    fn implausible_drag_is_remarked() {
        let rows = |x: [f64; 4]| {
            format!(
                "{HEADER}0,0,{},0,0,0,0,0\n0,9,{},0,0,0,0,0\n9,0,{},0,0,0,0,0\n9,9,{},0,0,0,0,0\n",
                x[0], x[1], x[2], x[3]
            )
        };
        assert_eq!(read(&rows([-5.0; 4])).unwrap().remarks, []);
        let remarks = read(&rows([5.0, -1.0, -1.0, -1.0])).unwrap().remarks;
        assert!(remarks.len() == 1 && remarks[0].line == 2, "{remarks:?}");
        assert!(remarks[0].message.contains("drag is negative"));
        // Lift of a nose held high points forward, and is no drag.
        let lifting = format!(
            "{HEADER}0,0,-1,0,0,0,0,0\n0,9,-1,0,0,0,0,0\n12,0,0.17,0,-18.5,0,0,0\n12,9,-1,0,0,0,0,0\n"
        );
        assert_eq!(read(&lifting).unwrap().remarks, []);
        let remarks = read(&rows([0.0; 4])).unwrap().remarks;
        assert!(remarks.len() == 1 && remarks[0].message.contains("no drag"), "{remarks:?}");
    }

    #[test]
    fn faults_name_their_line() {
        for (body, line) in [
            ("0,0,1,1,1,1,1\n", 2),
            ("0,0,1,1,1,1,1,1\n0,0,1,1,1,1,1,1\n", 3),
            ("0,0,1,1,1,1,1,x\n", 2),
            ("0,0,1,1,1,1,1,inf\n", 2),
            ("0,0,1,1,1,1,1,1\n1,1,1,1,1,1,1,1\n2,0,1,1,1,1,1,1\n", 4),
            ("0,0,-1e9,1,1,1,1,1\n", 2),
            ("0,0,1,1,1,1,1,-1e7\n", 2),
            ("0,95,1,1,1,1,1,1\n", 2),
            ("200,0,1,1,1,1,1,1\n", 2),
            ("", 1),
        ] {
            assert_eq!(parse(&format!("{HEADER}{body}")).unwrap_err().line, line, "{body}");
        }
        assert_eq!(parse("alpha,beta\n").unwrap_err().line, 1);
    }
}
