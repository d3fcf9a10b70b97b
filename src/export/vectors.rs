//! Test vectors: what the law answers, for whoever writes it anew.
//!
//! Two files: `lookup.csv`, every number of the law at the breakpoints,
//! between them and beyond both ends; `steps.csv`, 30 s of the law in discrete
//! time: measurement, demand and sticks a line. The sequence crosses the
//! turn-coordination blend both ways, leaves the table at both ends, changes
//! between attitude and velocity demands, and touches limits of sticks and of
//! the attitude command.

use std::fmt::Write as _;

use super::{ExportError, File, Input};
use crate::control::law::{Controller, Demand, Horizontal, LawTable, Measurement, NotFinite};

/// Length of the sequence, s.
pub const DURATION: f64 = 30.0;

/// One step of the law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Time, s.
    pub time: f64,
    /// What was measured.
    pub measurement: Measurement,
    /// What was asked for.
    pub demand: Demand,
    /// What the law answered, %.
    pub sticks: [f64; 4],
}

/// Columns of `steps.csv`; `command_1` and `command_2` are φ and θ in rad in
/// mode 0 (attitude), and the velocities forward and right in m/s in mode 1.
pub const COLUMNS: [&str; 19] = [
    "time",
    "u",
    "v",
    "w",
    "p",
    "q",
    "r",
    "phi",
    "theta",
    "airspeed",
    "mode",
    "command_1",
    "command_2",
    "heading_rate",
    "v_z_command",
    "lat",
    "lon",
    "col",
    "ped",
];

impl Row {
    /// The numbers in the order of [`COLUMNS`].
    pub fn numbers(&self) -> [f64; 19] {
        let (m, d, s) = (&self.measurement, &self.demand, &self.sticks);
        let (v, w) = (m.velocity_body, m.rates);
        let (mode, first, second) = match d.horizontal {
            Horizontal::Attitude { roll, pitch } => (0.0, roll, pitch),
            Horizontal::Velocity { forward, right } => (1.0, forward, right),
        };
        [
            self.time,
            v[0],
            v[1],
            v[2],
            w[0],
            w[1],
            w[2],
            m.roll,
            m.pitch,
            m.airspeed,
            mode,
            first,
            second,
            d.heading_rate,
            d.vertical_velocity,
            s[0],
            s[1],
            s[2],
            s[3],
        ]
    }
}

/// What the law is shown at a time: deviations from the trim that never
/// repeat within the sequence, and demands in steps.
fn stimulus(table: &LawTable, time: f64) -> (Measurement, Demand) {
    let points = table.points();
    let (low, high) = (points[0].speed, points[points.len() - 1].speed);
    // Beyond both ends by a twentieth of the range.
    let half = 0.55 * (high - low).max(10.0);
    let speed = 0.5 * (low + high) - half * (std::f64::consts::TAU * time / 20.0).cos();
    let trim = table.at(speed).inversion.trim;
    let wave = |amplitude: f64, omega: f64, phase: f64| amplitude * (omega * time + phase).sin();
    let m = Measurement {
        velocity_body: [
            trim.velocity_body[0] + wave(1.1, 0.93, 0.2),
            trim.velocity_body[1] + wave(0.8, 1.31, 1.4),
            trim.velocity_body[2] + wave(0.6, 1.07, 2.3),
        ],
        rates: [wave(0.11, 1.9, 0.4), wave(0.07, 1.7, 1.1), wave(0.09, 1.3, 2.9)],
        roll: trim.roll + wave(0.09, 1.13, 0.7),
        pitch: trim.pitch + wave(0.05, 0.83, 1.9),
        airspeed: speed,
    };
    let during = |from: f64, to: f64| time >= from && time < to;
    // There and back, so that integrals come back too.
    let pulse = |from: f64, length: f64, size: f64| {
        if during(from, from + length) {
            size
        } else if during(from + length, from + 2.0 * length) {
            -size
        } else {
            0.0
        }
    };
    let ((sp, cp), (st, ct)) = (m.roll.sin_cos(), m.pitch.sin_cos());
    let [u, v, w] = m.velocity_body;
    let forward = u * ct + (v * sp + w * cp) * st;
    let right = v * cp - w * sp;
    let vertical = -u * st + (v * sp + w * cp) * ct;
    let horizontal = if during(11.0, 22.0) {
        // Far out for a second and a half: limits of acceleration and lead.
        Horizontal::Velocity {
            forward: forward + wave(1.5, 2.1, 0.0) + pulse(13.0, 1.5, 90.0),
            right: right + wave(1.2, 1.6, 1.0) + pulse(17.0, 1.5, 90.0),
        }
    } else {
        let mild = pulse(2.0, 1.0, 1.0) + pulse(24.0, 1.0, 1.0);
        // Harder than anyone would fly, at low speed where bank is not yet
        // that of a coordinated turn: the limits of the cyclic.
        Horizontal::Attitude {
            roll: m.roll + 0.2 * mild + pulse(22.5, 0.1, 9.0),
            pitch: m.pitch - 0.1 * mild - pulse(6.0, 0.3, 2.0),
        }
    };
    let demand = Demand {
        horizontal,
        heading_rate: wave(0.06, 0.5, 0.0)
            + pulse(3.0, 1.5, 0.3)
            // A turn that asks for more bank than the velocity loops may.
            + pulse(14.5, 0.7, 0.9)
            + pulse(25.0, 0.5, 2.0),
        vertical_velocity: vertical
            + wave(0.8, 0.7, 0.5)
            + pulse(8.0, 1.0, -20.0)
            + pulse(27.0, 0.5, 30.0),
    };
    (m, demand)
}

/// The law's answer to the sequence at a step in s.
///
/// # Errors
/// A law whose trims are no numbers.
pub fn steps(
    table: &LawTable,
    stick_limits: [[f64; 2]; 4],
    step: f64,
) -> Result<Vec<Row>, NotFinite> {
    let mut controller = Controller::new(table.clone(), step, stick_limits);
    let count = (DURATION / step).round() as usize;
    (0..=count)
        .map(|k| {
            let time = k as f64 * step;
            let (measurement, demand) = stimulus(table, time);
            let sticks = controller.step(&measurement, &demand)?;
            Ok(Row { time, measurement, demand, sticks })
        })
        .collect()
}

/// Speeds to look the table up at: every breakpoint, middles, thirds, and
/// beyond both ends.
pub fn lookup_speeds(table: &LawTable) -> Vec<f64> {
    let breakpoints: Vec<f64> = table.points().iter().map(|p| p.speed).collect();
    let (low, high) = (breakpoints[0], breakpoints[breakpoints.len() - 1]);
    let mut speeds = vec![low - 20.0, low - 1e-9];
    for pair in breakpoints.windows(2) {
        let gap = pair[1] - pair[0];
        speeds.extend([pair[0], pair[0] + gap / 3.0, pair[0] + gap / 2.0, pair[1] - 1e-9 * gap]);
    }
    speeds.extend([high, high + 1e-9, high + 50.0]);
    speeds
}

/// Names of what [`lookup`] gives: the tables of the law in the order and with
/// the names of the description, and the weight of turn coordination.
pub fn lookup_names(input: &Input) -> Vec<String> {
    let mut names = Vec::new();
    for table in input.description.law_tables() {
        for row in &table.rows {
            for column in &table.columns {
                names.push(super::entry_name(&table.name, row, column));
            }
        }
    }
    names.push("turn_blend".into());
    names
}

/// Every number of the law at a speed, from the law itself.
pub fn lookup(table: &LawTable, speed: f64) -> Vec<f64> {
    let mut out = table.at(speed).flat();
    out.push(table.turn_blend(speed));
    out
}

fn line(out: &mut String, numbers: &[f64]) -> Result<(), ExportError> {
    for (k, x) in numbers.iter().enumerate() {
        if !x.is_finite() {
            let reason =
                format!("number {} of the line that begins with {:?} is {x}", k + 1, numbers[0]);
            return Err(ExportError::Format { format: "vectors", reason });
        }
        // Writing to a String cannot fail. `{:?}` is the shortest text that
        // reads back the same.
        let _ = write!(out, "{}{x:?}", if k == 0 { "" } else { "," });
    }
    out.push('\n');
    Ok(())
}

/// Both files.
pub(super) fn files(input: &Input) -> Result<Vec<File>, ExportError> {
    let step = input.options.step;
    let mut sequence = COLUMNS.join(",") + "\n";
    let rows = steps(input.law, input.schedule.stick_limits, step)
        .map_err(|error| ExportError::Format { format: "vectors", reason: error.to_string() })?;
    for row in rows {
        line(&mut sequence, &row.numbers())?;
    }
    let mut tables = format!("speed,{}\n", lookup_names(input).join(","));
    for speed in lookup_speeds(input.law) {
        let mut numbers = vec![speed];
        numbers.extend(lookup(input.law, speed));
        line(&mut tables, &numbers)?;
    }
    let name = &input.options.name;
    Ok(vec![
        File::text(format!("{name}_steps.csv"), sequence),
        File::text(format!("{name}_lookup.csv"), tables),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::law::ATTITUDE_LIMIT;
    use crate::schedule::sample;

    /// The law answers as it did when it was last flown against its exports:
    /// a regression, every fifth of a second of the sequence.
    #[test]
    fn regress_answers_of_the_committed_design() {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
        let read = |path: &str| std::fs::read_to_string(root.join(path)).unwrap();
        let schedule =
            crate::schedule::Schedule::from_json(&read("tests/data/law/coax2d_schedule.json"))
                .unwrap();
        let rows = steps(&schedule.law().unwrap(), schedule.stick_limits, 0.01).unwrap();
        let text = read("tests/data/law/coax2d_steps.csv");
        let mut compared = 0;
        for line in text.lines().skip(1) {
            let numbers: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
            let row = &rows[(numbers[0] / 0.01).round() as usize];
            for (found, wanted) in row.sticks.iter().zip(&numbers[1..]) {
                // Of the full travel of 100 %.
                assert!((found - wanted).abs() < 1e-10, "{found} {wanted} at {} s", numbers[0]);
            }
            compared += 1;
        }
        assert_eq!(compared, 151);
    }

    /// The sequence does what it is for.
    #[test]
    fn the_sequence_touches_everything() {
        let schedule = sample::schedule();
        let law = schedule.law().unwrap();
        let limits = schedule.stick_limits;
        let rows = steps(&law, limits, 0.01).unwrap();
        assert_eq!(rows.len(), 3001);
        let speeds = || rows.iter().map(|r| r.measurement.airspeed);
        assert!(speeds().fold(f64::MAX, f64::min) < 0.0);
        assert!(speeds().fold(0.0, f64::max) > law.points()[4].speed);
        let blend = |r: &&Row| {
            let b = law.turn_blend(r.measurement.airspeed);
            b > 0.0 && b < 1.0
        };
        assert!(rows.iter().filter(blend).count() > 100);
        for (j, limit) in limits.iter().enumerate() {
            let at = |r: &&Row| limit.contains(&r.sticks[j]);
            let count = rows.iter().filter(at).count();
            assert!(count > 0, "stick {j} reaches no limit");
            assert!(count < rows.len() / 2, "stick {j} is at a limit in {count} steps");
        }
        let saturated =
            rows.iter().filter(|r| (0..4).any(|j| limits[j].contains(&r.sticks[j]))).count();
        assert!(saturated > 50, "{saturated}");
        // The turn asks for more than the attitude limit, and the far
        // velocities for more than the schedule may lead.
        let asks = |r: &&Row| {
            let (v, rate) = (r.measurement.velocity_body[0], r.demand.heading_rate);
            matches!(r.demand.horizontal, Horizontal::Velocity { .. })
                && (v * rate / crate::units::STANDARD_GRAVITY).atan() > ATTITUDE_LIMIT
        };
        assert!(rows.iter().filter(asks).count() > 20);
        assert!(rows.iter().all(|r| r.numbers().iter().all(|x| x.is_finite())));
    }
}
