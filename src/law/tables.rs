//! Names, units and order of the tables over airspeed.
//!
//! The tables that the law needs stand one after the other in a flat order, by
//! rows: stepping, linearisation and generated code all count in it.

/// Name and unit.
pub type Label = (&'static str, &'static str);

/// Rigid-body states.
pub const STATES: [Label; 8] = [
    ("u", "m/s"),
    ("v", "m/s"),
    ("w", "m/s"),
    ("p", "rad/s"),
    ("q", "rad/s"),
    ("r", "rad/s"),
    ("phi", "rad"),
    ("theta", "rad"),
];
const OUTPUTS: [Label; 4] = [("phi", "rad"), ("theta", "rad"), ("r", "rad/s"), ("v_z", "m/s")];
const OUTPUT_RATES: [Label; 4] =
    [("phi_dot", "rad/s"), ("theta_dot", "rad/s"), ("r_dot", "rad/s^2"), ("v_z_dot", "m/s^2")];
/// Accelerations of the outputs.
pub const NU: [Label; 4] = [
    ("phi_ddot", "rad/s^2"),
    ("theta_ddot", "rad/s^2"),
    ("r_dot", "rad/s^2"),
    ("v_z_dot", "m/s^2"),
];
/// Sticks.
pub const STICKS: [Label; 4] = [("lat", "%"), ("lon", "%"), ("col", "%"), ("ped", "%")];
const GROUND: [Label; 2] = [("v_x", "m/s"), ("v_y", "m/s")];
const REFERENCES: [Label; 6] = [
    ("phi", "rad"),
    ("theta", "rad"),
    ("phi_dot", "rad/s"),
    ("theta_dot", "rad/s"),
    ("r", "rad/s"),
    ("v_z", "m/s"),
];
const MODEL: [Label; 2] = [("u", "m/s"), ("v", "m/s")];
const MODEL_RATES: [Label; 2] = [("u_dot", "m/s^2"), ("v_dot", "m/s^2")];
/// Channels that have gains.
pub const CHANNELS: [Label; 6] =
    [("roll", ""), ("pitch", ""), ("yaw", ""), ("heave", ""), ("vx", ""), ("vy", "")];
const GAINS: [Label; 3] = [("k_d", ""), ("k_p", ""), ("k_i", "")];
const VALUE: [Label; 1] = [("value", "")];
const ATTITUDE: [Label; 2] = [("phi", "rad"), ("theta", "rad")];
const VELOCITY: [Label; 3] = [("u", "m/s"), ("v", "m/s"), ("w", "m/s")];

/// A table's place among the others.
pub struct Form {
    /// Name.
    pub name: &'static str,
    meaning: &'static str,
    /// Whether the discrete-time law needs it.
    pub needed_by_law: bool,
    /// Names and units of the rows.
    pub rows: &'static [Label],
    /// Names and units of the columns.
    pub columns: &'static [Label],
}

impl Form {
    /// Rows and columns.
    pub fn size(&self) -> (usize, usize) {
        (self.rows.len(), self.columns.len())
    }

    /// What it is.
    pub fn meaning(&self) -> &'static str {
        self.meaning
    }

    /// The place of a row and a column by their names.
    pub fn place(&self, row: &str, column: &str) -> Option<(usize, usize)> {
        let find = |list: &[Label], name| list.iter().position(|l| l.0 == name);
        Some((find(self.rows, row)?, find(self.columns, column)?))
    }

    /// Unit of an entry.
    pub fn unit(&self, row: usize, column: usize) -> String {
        if self.name == "gains" {
            // Roll and pitch have a K_D.
            let attitude = row < 2;
            return match (attitude, column) {
                (true, 0) => "1/s",
                (true, 1) => "1/s^2",
                (true, _) => "1/s^3",
                // K_D does not exist here and is zero.
                (false, 0) => "1",
                (false, 1) => "1/s",
                (false, _) => "1/s^2",
            }
            .into();
        }
        let (row, column) = (self.rows[row].1, self.columns[column].1);
        if column.is_empty() { row.into() } else { format!("{row} per {column}") }
    }

    /// Every row and column by name, as one text each.
    pub fn places(&self) -> Vec<String> {
        let with = |row: &Label| {
            let row = row.0;
            self.columns.iter().map(move |column| format!("{row} {}", column.0))
        };
        self.rows.iter().flat_map(with).collect()
    }
}

/// Every table, in the order of files.
pub const FORMS: [Form; 14] = [
    Form {
        name: "gains",
        meaning: "gains of the inner axes and of the outer velocity loops",
        needed_by_law: true,
        rows: &CHANNELS,
        columns: &GAINS,
    },
    Form {
        name: "trim_velocity",
        meaning: "body velocity of the trim",
        needed_by_law: true,
        rows: &VELOCITY,
        columns: &VALUE,
    },
    Form {
        name: "trim_attitude",
        meaning: "attitude of the trim",
        needed_by_law: true,
        rows: &ATTITUDE,
        columns: &VALUE,
    },
    Form {
        name: "trim_sticks",
        meaning: "sticks of the trim",
        needed_by_law: true,
        rows: &STICKS,
        columns: &VALUE,
    },
    Form {
        name: "feedback",
        meaning: "F: rows C A^2 of phi and theta, C A of r and V_z",
        needed_by_law: true,
        rows: &NU,
        columns: &STATES,
    },
    Form {
        name: "decoupling",
        meaning: "B_d^-1: sticks from the nu that is commanded",
        needed_by_law: true,
        rows: &STICKS,
        columns: &NU,
    },
    Form {
        name: "allocation",
        meaning: "M: sticks from the nu that feedback asks for",
        needed_by_law: true,
        rows: &STICKS,
        columns: &NU,
    },
    Form {
        name: "reference_state",
        meaning: "x_ref from the reference model's u, v",
        needed_by_law: true,
        rows: &STATES,
        columns: &MODEL,
    },
    Form {
        name: "reference_input",
        meaning: "x_ref from the references",
        needed_by_law: true,
        rows: &STATES,
        columns: &REFERENCES,
    },
    Form {
        name: "reference_dynamics",
        meaning: "rates of the reference model's u, v from x_ref",
        needed_by_law: true,
        rows: &MODEL_RATES,
        columns: &STATES,
    },
    Form {
        name: "reference_drive",
        meaning: "rates of the reference model's u, v from nu",
        needed_by_law: true,
        rows: &MODEL_RATES,
        columns: &NU,
    },
    Form {
        name: "ground_velocity",
        meaning: "velocity over the ground in heading axes, forward and right, from states",
        needed_by_law: true,
        rows: &GROUND,
        columns: &STATES,
    },
    Form {
        name: "outputs",
        meaning: "C: outputs from states",
        needed_by_law: false,
        rows: &OUTPUTS,
        columns: &STATES,
    },
    Form {
        name: "output_rates",
        meaning: "C A: rates of the outputs from states",
        needed_by_law: false,
        rows: &OUTPUT_RATES,
        columns: &STATES,
    },
];

/// Place of an entry in the flat order of the tables that the law needs.
/// `None` where there is no such table, row or column.
pub fn place(table: &str, row: &str, column: &str) -> Option<usize> {
    let mut offset = 0;
    for form in FORMS.iter().filter(|f| f.needed_by_law) {
        let (rows, columns) = form.size();
        if form.name == table {
            let (i, j) = form.place(row, column)?;
            return Some(offset + i * columns + j);
        }
        offset += rows * columns;
    }
    None
}

/// Table, row and column of a place in the flat order.
pub fn entry(place: usize) -> Option<(&'static Form, usize, usize)> {
    let mut offset = 0;
    for form in FORMS.iter().filter(|f| f.needed_by_law) {
        let (rows, columns) = form.size();
        if place < offset + rows * columns {
            return Some((form, (place - offset) / columns, (place - offset) % columns));
        }
        offset += rows * columns;
    }
    None
}

/// Numbers in the flat order.
pub fn count() -> usize {
    FORMS.iter().filter(|f| f.needed_by_law).map(|f| f.size().0 * f.size().1).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_and_entries_are_inverse() {
        for k in 0..count() {
            let (form, i, j) = entry(k).unwrap();
            assert_eq!(place(form.name, form.rows[i].0, form.columns[j].0), Some(k));
        }
        assert_eq!(entry(count()).map(|e| e.0.name), None);
        assert_eq!(place("outputs", "phi", "u"), None);
    }
}
