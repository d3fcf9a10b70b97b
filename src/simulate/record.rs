//! What a flight leaves behind: one row of numbers an instant.

use super::flight::Flight;
use crate::control::law::Horizontal;
use crate::problem::STICKS;
use crate::units::Kind;
use crate::vehicle::Layout;

/// A column of a record.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Name, such as `theta` or `lat_stick`.
    pub name: String,
    /// What it measures; values are SI.
    pub kind: Kind,
}

/// Writes the rows of a flight.
#[derive(Debug, Clone)]
pub struct Recorder {
    columns: Vec<Column>,
    row: Vec<f64>,
    powers: Vec<f64>,
}

impl Recorder {
    /// A recorder for a flight.
    #[must_use]
    pub fn new(flight: &Flight<'_>) -> Self {
        let airframe = flight.simulator.airframe();
        let mut columns = Vec::new();
        let mut add = |name: &str, kind: Kind| columns.push(Column { name: name.into(), kind });
        add("time", Kind::Time);
        for (name, kind) in [
            ("airspeed", Kind::Airspeed),
            ("forward_velocity", Kind::Airspeed),
            ("right_velocity", Kind::Airspeed),
            ("climb_rate", Kind::ClimbRate),
            ("heading_rate", Kind::AngularRate),
            ("heading", Kind::Angle),
            ("north", Kind::Length),
            ("east", Kind::Length),
            ("height", Kind::Length),
        ] {
            add(name, kind);
        }
        if flight.closed_loop() {
            for (name, kind) in [
                ("forward_velocity_command", Kind::Airspeed),
                ("right_velocity_command", Kind::Airspeed),
                ("climb_rate_command", Kind::ClimbRate),
                ("turn_rate_command", Kind::AngularRate),
                ("forward_velocity_reference", Kind::Airspeed),
                ("right_velocity_reference", Kind::Airspeed),
                ("climb_rate_reference", Kind::ClimbRate),
                ("yaw_rate_reference", Kind::AngularRate),
                ("phi_reference", Kind::Angle),
                ("theta_reference", Kind::Angle),
            ] {
                add(name, kind);
            }
        }
        for (name, kind) in airframe.states() {
            let rate = ["p", "q", "r"].contains(&name.as_str());
            add(&name, if rate { Kind::AngularRate } else { shown(kind) });
        }
        for stick in STICKS {
            add(&format!("{stick}_stick"), Kind::Percent);
        }
        for (name, kind) in airframe.effectors() {
            add(&name, shown(kind));
        }
        for name in ["wind_north", "wind_east", "wind_down"] {
            add(name, Kind::Velocity);
        }
        for name in ["air_rate_north", "air_rate_east", "air_rate_down"] {
            add(name, Kind::AngularRate);
        }
        let rotors = airframe.rotors();
        for rotor in &rotors {
            add(&format!("{rotor}.power"), Kind::Power);
        }
        let row = Vec::with_capacity(columns.len());
        Self { columns, row, powers: vec![0.0; rotors.len()] }
    }

    /// Columns, in order.
    #[must_use]
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// The row of this instant, SI.
    pub fn row(&mut self, flight: &mut Flight<'_>) -> &[f64] {
        flight.simulator.powers(&mut self.powers);
        let simulator = &flight.simulator;
        let [heading_rate, forward, right, down] = simulator.navigation();
        let [north, east, below] = simulator.position();
        let row = &mut self.row;
        row.clear();
        row.extend([simulator.time(), simulator.airspeed(), forward, right, -down, heading_rate]);
        row.extend([simulator.heading(), north, east, -below]);
        if let (Some(demand), Some(reference)) = (flight.demand(), flight.references()) {
            // Under attitude commands the velocities are not steered to.
            let command = match demand.horizontal {
                Horizontal::Velocity { forward, right } => [forward, right],
                Horizontal::Attitude { .. } => [forward, right],
            };
            row.extend(command);
            row.extend([-demand.vertical_velocity, demand.heading_rate]);
            row.extend(reference.velocity.unwrap_or([forward, right]));
            row.extend([-reference.vertical_velocity, reference.yaw_rate]);
            row.extend([reference.roll, reference.pitch]);
        }
        row.extend_from_slice(simulator.state());
        row.extend(flight.sticks());
        row.extend_from_slice(simulator.effectors());
        row.extend(simulator.wind());
        row.extend(simulator.air_rate());
        row.extend_from_slice(&self.powers);
        row
    }

    /// Place of a column.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column.name == name)
    }

    /// The states' places begin at the first of them.
    #[must_use]
    pub fn first_state(&self, flight: &Flight<'_>) -> usize {
        let first = flight.simulator.airframe().state_name(Layout::BODY.velocity);
        first.and_then(|name| self.column(name)).unwrap_or(0)
    }
}

/// Angles are read in degrees.
fn shown(kind: Kind) -> Kind {
    match kind {
        Kind::AngleRad => Kind::Angle,
        other => other,
    }
}
