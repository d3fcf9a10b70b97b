//! The control law over speed, and the controller that flies it.
//!
//! [`LawTable`] holds the numbers of the law, breakpoint by breakpoint. Its
//! formulas stand in [`crate::law::mdi`], as a block diagram;
//! [`LawTable::diagram`] makes it, and stepping, linearisation and every export
//! read it. [`LawTable::at`] is what the tuning looks at;
//! [`LawTable::linear`] is the law for small deviations, what the verification
//! looks at; [`Controller`] steps it.
//!
//! Away from the schedule's trims two things change that no table over speed
//! holds, [`OffTrim`]: the pedals' power over yaw grows with the collective,
//! and the pitching moment of rotor lift grows with the tail's load. Both laws
//! of growth are read off the table itself.

use super::axis::{Axis, Channel, Effector, GainSet};
use super::plant::{Inversion, rigid};
use crate::law::diagram::Tap;
use crate::law::mdi::{self, Choices, MONITORS};
use crate::law::{Breakpoints, Diagram, LinearLaw, Memory, Program};
use std::sync::Arc;

pub use crate::law::mdi::{
    ACCELERATION_LIMIT, ATTITUDE_LIMIT, FORGETTING, LawSettings, OUTER_SLOWNESS, OffTrim,
    PEDAL_POWER_RANGE, SCHEDULE_LEAD, SLOW, TurnCoordination, YAW_LEAD,
};

/// The law at one speed.
#[derive(Debug, Clone, PartialEq)]
pub struct LawPoint {
    /// True airspeed, m/s.
    pub speed: f64,
    /// Gains.
    pub gains: GainSet,
    /// Inversion, reference model and trim.
    pub inversion: Inversion,
}

/// The law over speed.
#[derive(Debug, Clone, PartialEq)]
pub struct LawTable {
    /// Breakpoints, speeds strictly increasing, at least one.
    points: Vec<LawPoint>,
    /// Choices that do not depend on speed.
    pub settings: LawSettings,
    /// Eq. 75.
    pub turn: TurnCoordination,
    off_trim: OffTrim,
}

/// Fewest breakpoints that show a line.
pub const LEAST_BREAKPOINTS: usize = 4;
/// Least share of the variance over the breakpoints that a line must explain.
pub const LEAST_EXPLAINED: f64 = 0.95;
/// Least variance of the abscissas, over their mean square.
pub const LEAST_SPREAD: f64 = 1e-6;

/// The slopes over the breakpoints of a table.
fn off_trim_of(points: &[LawPoint]) -> OffTrim {
    let (yaw, pitch) = (Axis::Yaw.index(), Axis::Pitch.index());
    let (collective, pedal) = (Effector::Collective.index(), Effector::Pedal.index());
    let mut powers = Vec::with_capacity(points.len());
    for p in points {
        let Some(power) = p.inversion.decoupling.try_inverse() else {
            return OffTrim::default();
        };
        let [u, _, w] = p.inversion.trim.velocity_body;
        powers.push((p.inversion.trim.sticks[collective], u * w, power));
    }
    let pitching =
        |stick: usize| slope(powers.iter().map(|(_, load, power)| (*load, power[(pitch, stick)])));
    OffTrim {
        pedal_yaw: slope(powers.iter().map(|(col, _, power)| (*col, power[(yaw, pedal)]))),
        collective_pitch: pitching(collective),
        pedal_pitch: pitching(pedal),
    }
}

/// Slope of the line through points, by least squares; zero where there are
/// too few, or where the line explains too little.
fn slope(points: impl Iterator<Item = (f64, f64)> + Clone) -> f64 {
    let count = points.clone().count();
    if count < LEAST_BREAKPOINTS {
        return 0.0;
    }
    let n = count as f64;
    let (x, y) = points.clone().fold((0.0, 0.0), |(x, y), p| (x + p.0 / n, y + p.1 / n));
    let [xx, xy, yy] = points.fold([0.0; 3], |[xx, xy, yy], p| {
        let (a, b) = (p.0 - x, p.1 - y);
        [xx + a * a, xy + a * b, yy + b * b]
    });
    // Points in one place lie on every line.
    let spread = xx > LEAST_SPREAD * n * (x * x + xx / n);
    if spread && xy * xy > LEAST_EXPLAINED * xx * yy { xy / xx } else { 0.0 }
}

/// Why a table was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum LawError {
    /// No breakpoint.
    #[error("the schedule has no breakpoint")]
    Empty,
    /// Speeds out of order.
    #[error("the schedule's speeds are not strictly increasing at {0:.3} m/s")]
    Order(f64),
    /// A value is not finite.
    #[error("the schedule has a non-finite value at {0:.3} m/s")]
    NotFinite(f64),
}

impl LawTable {
    /// A table of these breakpoints.
    ///
    /// # Errors
    /// No breakpoint, speeds that do not increase strictly, or a gain or
    /// matrix entry that is not finite.
    pub fn new(
        points: Vec<LawPoint>,
        settings: LawSettings,
        turn: TurnCoordination,
    ) -> Result<Self, LawError> {
        if points.is_empty() {
            return Err(LawError::Empty);
        }
        for pair in points.windows(2) {
            if pair[1].speed <= pair[0].speed {
                return Err(LawError::Order(pair[1].speed));
            }
        }
        for p in &points {
            let i = &p.inversion;
            let finite = p.speed.is_finite()
                && p.gains.iter().flat_map(|g| g.array()).all(f64::is_finite)
                && i.outputs.iter().chain(i.rates.iter()).all(|v| v.is_finite())
                && i.feedback.iter().chain(i.decoupling.iter()).all(|v| v.is_finite())
                && i.allocation.iter().all(|v| v.is_finite())
                && i.ground_velocity.iter().all(|v| v.is_finite())
                && i.reference.dynamics.iter().all(|v| v.is_finite());
            if !finite {
                return Err(LawError::NotFinite(p.speed));
            }
        }
        let off_trim = off_trim_of(&points);
        Ok(Self { points, settings, turn, off_trim })
    }

    /// Breakpoints.
    pub fn points(&self) -> &[LawPoint] {
        &self.points
    }

    /// How the sticks' powers change away from the trims.
    pub fn off_trim(&self) -> &OffTrim {
        &self.off_trim
    }

    /// The law at a speed: linear between breakpoints, constant beyond.
    pub fn at(&self, speed: f64) -> LawPoint {
        let k = self.points.partition_point(|p| p.speed <= speed);
        let last = self.points.len() - 1;
        if k == 0 || k > last {
            // NaN compares as before the first breakpoint.
            let mut p = self.points[if k == 0 { 0 } else { last }].clone();
            p.speed = speed;
            return p;
        }
        let (a, b) = (&self.points[k - 1], &self.points[k]);
        let t = (speed - a.speed) / (b.speed - a.speed);
        LawPoint {
            speed,
            gains: std::array::from_fn(|c| a.gains[c].blend(&b.gains[c], t)),
            inversion: a.inversion.blend(&b.inversion, t),
        }
    }

    /// Share of its attitude that a channel commands at a speed; what is left
    /// belongs to turn coordination. One for all but V_y.
    pub fn outer_share(&self, channel: Channel, speed: f64) -> f64 {
        match channel {
            Channel::Vy => 1.0 - self.turn_blend(speed),
            Channel::Vx | Channel::Roll | Channel::Pitch | Channel::Yaw | Channel::Heave => 1.0,
        }
    }

    /// Weight of turn coordination in Eq. 75 at a speed: 0 below the blend, 1
    /// above, a cubic with flat ends between.
    pub fn turn_blend(&self, speed: f64) -> f64 {
        let diagram = self.diagram(0.0, [[0.0, 1.0]; 4], false, false).only(&["turn_blend"]);
        let program = Program::new(&diagram, &self.breakpoints());
        let mut memory = program.memory();
        program.run(&mut memory, &[speed]);
        program.output(&memory, 0)
    }
}

impl LawTable {
    /// The numbers of the law in the flat order of [`crate::law::tables`].
    pub fn breakpoints(&self) -> Breakpoints {
        Breakpoints {
            speeds: self.points.iter().map(|p| p.speed).collect(),
            values: self.points.iter().map(LawPoint::flat).collect(),
        }
    }

    /// The law as a diagram that steps every `step` s within stick limits, %:
    /// with a step of zero, in the limit of a short step.
    ///
    /// `ports` adds the inputs of [`mdi::PORTS`], `engage` those of
    /// [`mdi::ENGAGEMENT`].
    pub fn diagram(&self, step: f64, limits: [[f64; 2]; 4], ports: bool, engage: bool) -> Diagram {
        let late = self.settings.reference_delay;
        let delay_steps = if step > 0.0 {
            mdi::delay_steps(&self.settings, step)
        } else {
            usize::from(late > 0.0)
        };
        let choices = Choices {
            settings: self.settings,
            turn: self.turn,
            off_trim: self.off_trim,
            limits,
            step,
            delay_steps,
            ports,
            engage,
        };
        mdi::diagram(&choices).pruned()
    }

    /// The law for small deviations about trimmed flight at a speed, in the
    /// limit of a short step: inner loops alone under an attitude demand, with
    /// the outer loops under a velocity demand. It has the inputs of
    /// [`mdi::PORTS`]; its delay lines are [`LawSettings::reference_delay`]
    /// long.
    pub fn linear(&self, speed: f64, velocity_mode: bool) -> LinearLaw {
        Linearizer::new(self, &[]).at(speed, velocity_mode)
    }

    /// The same table with gains of its own at a speed, m/s, which becomes a
    /// breakpoint if it is none; all else is as it is flown there.
    pub fn with_gains_at(&self, speed: f64, gains: GainSet) -> Self {
        self.with_point(LawPoint { gains, ..self.at(speed) })
    }

    /// The same table with a breakpoint more, or another in the place of one.
    pub fn with_point(&self, point: LawPoint) -> Self {
        let mut out = self.clone();
        match out.points.iter().position(|p| (p.speed - point.speed).abs() < 1e-6) {
            Some(k) => out.points[k] = point,
            None => {
                let k = out.points.partition_point(|p| p.speed < point.speed);
                out.points.insert(k, point);
            }
        }
        out
    }

    /// The same table with other gains, one set a breakpoint.
    pub fn with_gains(&self, gains: impl Fn(usize) -> GainSet) -> Self {
        let mut out = self.clone();
        for (k, point) in out.points.iter_mut().enumerate() {
            point.gains = gains(k);
        }
        out
    }
}

/// Makes the law for small deviations about trimmed flight at any speed.
#[derive(Debug, Clone)]
pub struct Linearizer<'a> {
    table: &'a LawTable,
    diagram: Diagram,
    tables: Breakpoints,
    program: Program,
    taps: Vec<Tap>,
}

impl<'a> Linearizer<'a> {
    /// Of this table, with ports at these entries of its tables, for the
    /// derivative by each; see [`Diagram::tapped`].
    pub fn new(table: &'a LawTable, entries: &[usize]) -> Self {
        // Limits do not bound what is infinitely small.
        let limits = [[f64::MIN, f64::MAX]; 4];
        let (diagram, taps) = table.diagram(0.0, limits, true, false).tapped(entries);
        let tables = table.breakpoints();
        let program = Program::new(&diagram, &tables);
        Self { table, diagram, tables, program, taps }
    }

    /// The ports at entries.
    pub fn taps(&self) -> &[Tap] {
        &self.taps
    }

    /// The law at a speed, m/s, and in a mode; see [`LawTable::linear`].
    pub fn at(&self, speed: f64, velocity_mode: bool) -> LinearLaw {
        let mut memory = self.program.memory();
        let trim = self.table.at(speed).inversion.trim;
        let mut measured = Measurement {
            velocity_body: trim.velocity_body,
            rates: [0.0; 3],
            roll: trim.roll,
            pitch: trim.pitch,
            airspeed: speed,
        };
        let (vertical, [forward, right]) = earth_velocity(&measured);
        // In still air.
        measured.airspeed = forward;
        let horizontal = if velocity_mode {
            Horizontal::Velocity { forward, right }
        } else {
            Horizontal::Attitude { roll: trim.roll, pitch: trim.pitch }
        };
        let demand = Demand { horizontal, heading_rate: 0.0, vertical_velocity: vertical };
        let mut inputs = vec![0.0; self.program.input_count()];
        inputs[..INPUTS].copy_from_slice(&numbers(&measured, &demand));
        self.program.run(&mut memory, &inputs);
        self.program.hold(&mut memory);
        self.program.run(&mut memory, &inputs);
        LinearLaw::new(&self.diagram, &self.tables, &self.program, &memory)
    }
}

impl LawPoint {
    /// The numbers of the law at this speed in the flat order of
    /// [`crate::law::tables`].
    pub fn flat(&self) -> Vec<f64> {
        let i = &self.inversion;
        let mut out: Vec<f64> =
            Channel::ALL.iter().flat_map(|c| self.gains[c.index()].array()).collect();
        out.extend(i.trim.velocity_body);
        out.extend([i.trim.roll, i.trim.pitch]);
        out.extend(i.trim.sticks);
        // nalgebra iterates by columns.
        let r = &i.reference;
        out.extend(i.feedback.transpose().iter());
        out.extend(i.decoupling.transpose().iter());
        out.extend(i.allocation.transpose().iter());
        out.extend(r.state.transpose().iter());
        out.extend(r.input.transpose().iter());
        out.extend(r.dynamics.transpose().iter());
        out.extend(r.drive.transpose().iter());
        out.extend(i.ground_velocity.transpose().iter());
        out
    }
}

/// What the law measures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement {
    /// Velocity over the ground in body axes, m/s.
    pub velocity_body: [f64; 3],
    /// Body rates p, q, r, rad/s.
    pub rates: [f64; 3],
    /// Bank angle, rad.
    pub roll: f64,
    /// Pitch angle, rad.
    pub pitch: f64,
    /// Forward component of the true airspeed in heading axes, m/s: what the
    /// schedule is read at. Not its magnitude: sideward flight is no forward
    /// flight.
    pub airspeed: f64,
}

/// What the pilot or guidance asks for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Demand {
    /// Bank and pitch, or velocities.
    pub horizontal: Horizontal,
    /// Heading rate, rad/s.
    pub heading_rate: f64,
    /// Vertical velocity, down positive, m/s.
    pub vertical_velocity: f64,
}

/// A measurement, a demand or a stick that is not a finite number. The law
/// keeps its memory and its sticks as they were.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{input} is not finite: the law keeps its memory and its sticks")]
pub struct NotFinite {
    /// What is not.
    pub input: &'static str,
}

impl Measurement {
    fn checked(&self) -> Result<(), NotFinite> {
        finite("the measured velocity", &self.velocity_body)?;
        finite("a measured rate", &self.rates)?;
        finite("a measured attitude", &[self.roll, self.pitch])?;
        finite("the measured airspeed", &[self.airspeed])
    }
}

impl Demand {
    fn checked(&self) -> Result<(), NotFinite> {
        match self.horizontal {
            Horizontal::Attitude { roll, pitch } => finite("a demanded attitude", &[roll, pitch])?,
            Horizontal::Velocity { forward, right } => {
                finite("a demanded velocity", &[forward, right])?;
            }
        }
        finite("the demanded heading rate", &[self.heading_rate])?;
        finite("the demanded vertical velocity", &[self.vertical_velocity])
    }
}

fn finite(input: &'static str, values: &[f64]) -> Result<(), NotFinite> {
    if values.iter().all(|value| value.is_finite()) { Ok(()) } else { Err(NotFinite { input }) }
}

/// Response type of the horizontal axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Horizontal {
    /// Attitude command: bank and pitch, rad.
    Attitude {
        /// Bank angle.
        roll: f64,
        /// Pitch angle.
        pitch: f64,
    },
    /// Translational rate command: velocity over the ground in heading axes,
    /// m/s.
    Velocity {
        /// Forward.
        forward: f64,
        /// To the right.
        right: f64,
    },
}

/// What the law steers to at a step: the references as they enter the errors,
/// delayed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct References {
    /// Bank angle, rad.
    pub roll: f64,
    /// Pitch angle, rad.
    pub pitch: f64,
    /// Body yaw rate, rad/s.
    pub yaw_rate: f64,
    /// Vertical velocity, down positive, m/s.
    pub vertical_velocity: f64,
    /// Velocity over the ground in heading axes, forward and to the right,
    /// m/s; `None` under an attitude command.
    pub velocity: Option<[f64; 2]>,
    /// The velocity commands through their first-order lags alone, without the
    /// attitude command model and the delay that stand between them and what
    /// an aircraft can do, m/s; `None` under an attitude command.
    pub velocity_lag: Option<[f64; 2]>,
}

/// Measurements and demands.
const INPUTS: usize = mdi::MEASUREMENTS.len() + mdi::DEMANDS.len();
/// Where what the law is engaged with begins among the inputs, and the ports.
const ENGAGEMENT: usize = INPUTS;
const PORTS: usize = ENGAGEMENT + mdi::ENGAGEMENT.len();

/// Inputs of the diagram.
fn numbers(m: &Measurement, demand: &Demand) -> [f64; INPUTS] {
    let [u, v, w] = m.velocity_body;
    let [p, q, r] = m.rates;
    let (mode, first, second) = match demand.horizontal {
        Horizontal::Attitude { roll, pitch } => (0.0, roll, pitch),
        Horizontal::Velocity { forward, right } => (1.0, forward, right),
    };
    let Demand { heading_rate, vertical_velocity, .. } = *demand;
    [
        u,
        v,
        w,
        p,
        q,
        r,
        m.roll,
        m.pitch,
        m.airspeed,
        mode,
        first,
        second,
        heading_rate,
        vertical_velocity,
    ]
}

/// Place of a monitor.
const fn monitor(name: &str) -> usize {
    let mut k = 0;
    while k < MONITORS.len() {
        let (a, b) = (MONITORS[k].as_bytes(), name.as_bytes());
        let mut same = a.len() == b.len();
        let mut j = 0;
        while same && j < a.len() {
            same = a[j] == b[j];
            j += 1;
        }
        if same {
            return k;
        }
        k += 1;
    }
    panic!("there is no such monitor")
}

/// The law with its memory, stepping at a fixed interval.
#[derive(Debug, Clone)]
pub struct Controller {
    table: Arc<LawTable>,
    program: Arc<Program>,
    memory: Memory,
    velocity_mode: bool,
    inputs: [f64; PORTS + mdi::PORTS.len()],
}

impl Controller {
    /// A controller that steps every `step` s within stick limits, %.
    pub fn new(table: LawTable, step: f64, stick_limits: [[f64; 2]; 4]) -> Self {
        let diagram = table.diagram(step, stick_limits, true, true);
        let program = Program::new(&diagram, &table.breakpoints());
        Self {
            memory: program.memory(),
            program: Arc::new(program),
            table: Arc::new(table),
            velocity_mode: false,
            inputs: [0.0; PORTS + mdi::PORTS.len()],
        }
    }

    /// Adds a disturbance to the held quantities as the gains that hold them see
    /// them, and nowhere else: φ, θ, heading (the integral of r), V_z (down).
    /// Rates, inversion and kinematics stay clean. This is where disturbance rejection is defined, and it cannot be
    /// reached through [`Measurement`]. A port for measurements; it stays until
    /// it is set again.
    pub fn disturb(&mut self, outputs: [f64; 4]) {
        self.inputs[PORTS..PORTS + 4].copy_from_slice(&outputs);
    }

    /// The table.
    pub fn table(&self) -> &LawTable {
        &self.table
    }

    fn set(&mut self, m: &Measurement, demand: &Demand) {
        self.inputs[..INPUTS].copy_from_slice(&numbers(m, demand));
        self.velocity_mode = matches!(demand.horizontal, Horizontal::Velocity { .. });
    }

    /// Starts from a measurement with given sticks, %, and without a
    /// transient: the integrals take what the law would otherwise lack, as when
    /// it is switched on in trimmed flight that is not the schedule's own.
    ///
    /// # Errors
    /// An input that is not finite; nothing has changed then.
    pub fn engage(
        &mut self,
        m: &Measurement,
        demand: &Demand,
        sticks: [f64; 4],
    ) -> Result<(), NotFinite> {
        finite("a stick", &sticks)?;
        m.checked()?;
        demand.checked()?;
        self.memory = self.program.memory();
        self.set(m, demand);
        self.inputs[ENGAGEMENT] = 1.0;
        self.inputs[ENGAGEMENT + 1..PORTS].copy_from_slice(&sticks);
        self.program.run(&mut self.memory, &self.inputs);
        self.program.hold(&mut self.memory);
        self.inputs[ENGAGEMENT] = 0.0;
        Ok(())
    }

    /// What the last step steered to. Where turn coordination has the bank, the
    /// velocity to the right is that of flight without v: −w sin φ.
    pub fn references(&self) -> References {
        let seen = |k: usize| self.program.monitor(&self.memory, k);
        let velocity = |names: [usize; 2]| self.velocity_mode.then(|| names.map(seen));
        References {
            roll: seen(const { monitor("delayed_phi") }),
            pitch: seen(const { monitor("delayed_theta") }),
            yaw_rate: seen(const { monitor("delayed_r") }),
            vertical_velocity: seen(const { monitor("delayed_v_z") }),
            velocity: velocity(const { [monitor("due_v_x"), monitor("shown_v_y")] }),
            velocity_lag: velocity(const { [monitor("v_x_command"), monitor("v_y_command")] }),
        }
    }

    /// One step: sticks lat, lon, col, ped in %.
    ///
    /// # Errors
    /// An input that is not finite. Nothing has changed then: whoever flies
    /// keeps the sticks of the step before.
    pub fn step(&mut self, m: &Measurement, demand: &Demand) -> Result<[f64; 4], NotFinite> {
        m.checked()?;
        demand.checked()?;
        self.set(m, demand);
        self.program.run(&mut self.memory, &self.inputs);
        self.program.advance(&mut self.memory);
        Ok(std::array::from_fn(|j| self.program.output(&self.memory, j)))
    }

    /// Deviation u, v of the reference model from the trim at the last step,
    /// m/s: for reports of a simulation.
    pub fn model_deviation(&self) -> [f64; 2] {
        const { [monitor("model_u"), monitor("model_v")] }
            .map(|k| self.program.monitor(&self.memory, k))
    }
}

/// Velocity over the ground: down, and forward and to the right in heading
/// axes, m/s.
pub(crate) fn earth_velocity(m: &Measurement) -> (f64, [f64; 2]) {
    let ((sp, cp), (st, ct)) = (m.roll.sin_cos(), m.pitch.sin_cos());
    let [u, v, w] = m.velocity_body;
    let lifted = v * sp + w * cp;
    (lifted * ct - u * st, [u * ct + lifted * st, v * cp - w * sp])
}

/// The linear law's immediate response, sticks per measured state at a fixed
/// schedule and without integrals: −M (K_P C + K_D C A + F_κ). What
/// [`Controller::step`] must do to small deviations; a test holds it to that.
pub fn proportional_feedback(p: &LawPoint, settings: &LawSettings) -> nalgebra::SMatrix<f64, 4, 8> {
    let inv = &p.inversion;
    let (velocity, attitude) = inv.split_feedback();
    let mut rows = attitude + velocity * settings.kappa;
    for axis in Axis::ALL {
        let i = axis.index();
        let k = p.gains[Channel::from(axis).index()];
        let row = rows.row(i) + inv.outputs.row(i) * k.k_p + inv.rates.row(i) * k.k_d;
        rows.set_row(i, &row);
    }
    -inv.allocation * rows
}

/// Names of the states of `x` above, for exports.
pub const MEASURED: [usize; 8] =
    [rigid::U, rigid::V, rigid::W, rigid::P, rigid::Q, rigid::R, rigid::PHI, rigid::THETA];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::axis::ChannelGains;
    use crate::control::testbed;
    use crate::control::tuning::start_gains;
    use approx::assert_relative_eq;
    use std::collections::VecDeque;

    fn table() -> LawTable {
        let settings = LawSettings {
            kappa: 0.25,
            hybrid_feedforward: true,
            reference_delay: 0.15,
            roll_frequency: 2.0,
            pitch_frequency: 2.0,
            attitude_damping: 0.8,
            yaw_time_constant: 0.5,
            heave_time_constant: 2.0,
            notch: Default::default(),
        };
        let points = [0.0, 15.0, 35.0]
            .map(|speed| {
                let mut gains = GainSet::default();
                for c in Channel::ALL {
                    gains[c.index()] = start_gains(c, 0.16, [0.0, 10.0]);
                }
                let plant = testbed::plant(speed, &testbed::NOMINAL);
                LawPoint { speed, gains, inversion: Inversion::new(&plant).unwrap() }
            })
            .to_vec();
        LawTable::new(points, settings, TurnCoordination { speed: 25.7, width: 5.0 }).unwrap()
    }

    fn at_trim(p: &LawPoint) -> Measurement {
        let t = p.inversion.trim;
        Measurement {
            velocity_body: t.velocity_body,
            rates: [0.0; 3],
            roll: t.roll,
            pitch: t.pitch,
            airspeed: p.speed,
        }
    }

    fn hold(p: &LawPoint) -> Demand {
        let t = p.inversion.trim;
        Demand {
            horizontal: Horizontal::Attitude { roll: t.roll, pitch: t.pitch },
            heading_rate: 0.0,
            vertical_velocity: 0.0,
        }
    }

    /// Schedule: exact at breakpoints, linear between, constant beyond.
    #[test]
    fn table_is_linear_between_and_constant_beyond() {
        let t = table();
        let (a, b) = (&t.points()[0], &t.points()[1]);
        let mid = t.at(7.5);
        assert_relative_eq!(
            mid.inversion.feedback,
            (a.inversion.feedback + b.inversion.feedback) * 0.5,
            epsilon = 1e-12
        );
        assert_eq!(t.at(15.0).inversion, b.inversion);
        assert_eq!(t.at(-3.0).inversion, a.inversion);
        assert_eq!(t.at(99.0).inversion, t.points()[2].inversion);
    }

    /// Eq. 75 on both sides of the blend, and continuous with its slope.
    #[test]
    fn turn_coordination_blends_smoothly() {
        let t = table();
        assert_eq!(t.turn_blend(20.0), 0.0);
        assert_eq!(t.turn_blend(30.0), 1.0);
        assert_relative_eq!(t.turn_blend(25.7), 0.5, epsilon = 1e-12);
        let h = 1e-6;
        for edge in [23.2, 28.2] {
            assert!((t.turn_blend(edge + h) - t.turn_blend(edge - h)).abs() < 1e-9);
        }
    }

    /// The same measurement in calm air.
    fn calm(mut m: Measurement) -> Measurement {
        m.airspeed = earth_velocity(&m).1[0];
        m
    }

    /// A table of one breakpoint, so that its speed does not matter.
    fn alone(t: &LawTable, p: &LawPoint) -> LawTable {
        LawTable::new(vec![p.clone()], t.settings, t.turn).unwrap()
    }

    /// An input that is no number is refused by name, and the next good one is
    /// answered as if it had not been.
    #[test]
    fn what_is_not_finite_changes_nothing() {
        let t = table();
        let p = t.at(15.0);
        let good = calm(at_trim(&p));
        let mut c = Controller::new(t, 0.01, [[-100.0, 100.0]; 4]);
        c.step(&good, &hold(&p)).unwrap();
        let mut untouched = c.clone();
        let bad_rate = Measurement { rates: [0.0, f64::NAN, 0.0], ..good };
        let bad_speed = Measurement { airspeed: f64::INFINITY, ..good };
        let bad_demand = Demand { heading_rate: f64::NAN, ..hold(&p) };
        for (m, demand, input) in [
            (bad_rate, hold(&p), "a measured rate"),
            (bad_speed, hold(&p), "the measured airspeed"),
            (good, bad_demand, "the demanded heading rate"),
        ] {
            assert_eq!(c.step(&m, &demand), Err(NotFinite { input }));
            assert_eq!(c.engage(&m, &demand, [0.0; 4]), Err(NotFinite { input }));
        }
        let sticks = [0.0, f64::NAN, 0.0, 0.0];
        assert_eq!(c.engage(&good, &hold(&p), sticks), Err(NotFinite { input: "a stick" }));
        assert_eq!(c.step(&good, &hold(&p)), untouched.step(&good, &hold(&p)));
    }

    /// At trim with the trim demanded the sticks are the trim's, and stay. At
    /// breakpoints: between them the interpolated trim climbs a little.
    #[test]
    fn trim_is_an_equilibrium() {
        let t = table();
        for speed in [0.0, 15.0, 35.0] {
            let p = t.at(speed);
            let mut c = Controller::new(alone(&t, &p), 0.01, [[-100.0, 100.0]; 4]);
            for _ in 0..50 {
                let sticks = c.step(&calm(at_trim(&p)), &hold(&p)).unwrap();
                for (s, want) in sticks.iter().zip(p.inversion.trim.sticks) {
                    assert!((s - want).abs() < 1e-9, "{s} {want} at {speed}");
                }
            }
        }
    }

    /// The nonlinear step's response to a small deviation of each measured
    /// state is the linear law that was tuned.
    #[test]
    fn step_linearises_to_the_tuned_law() {
        let mut t = table();
        // A tiny step, so that integrals and references stand still.
        t.settings.reference_delay = 0.0;
        for speed in [0.0, 10.0, 35.0] {
            let p = t.at(speed);
            let expected = proportional_feedback(&p, &t.settings);
            for k in 0..8 {
                let h = 1e-6;
                let response = |sign: f64| {
                    let mut c = Controller::new(alone(&t, &p), 1e-9, [[-1e6, 1e6]; 4]);
                    c.step(&calm(at_trim(&p)), &hold(&p)).unwrap();
                    let mut m = at_trim(&p);
                    let d = sign * h;
                    match k {
                        0..3 => m.velocity_body[k] += d,
                        3..6 => m.rates[k - 3] += d,
                        6 => m.roll += d,
                        _ => m.pitch += d,
                    }
                    c.step(&calm(m), &hold(&p)).unwrap()
                };
                let (up, down) = (response(1.0), response(-1.0));
                for j in 0..4 {
                    let slope = (up[j] - down[j]) / (2.0 * h);
                    let scale = expected.row(j).amax();
                    assert!(
                        (slope - expected[(j, k)]).abs() < 2e-3 * scale,
                        "stick {j} state {k} at {speed}: {slope} {}",
                        expected[(j, k)]
                    );
                }
            }
        }
    }

    /// A table whose breakpoints lie on lines: pedals' yaw power over collective,
    /// and the pitch powers of collective and pedals over u w.
    fn on_lines() -> LawTable {
        let t = table();
        let points = [0.0, 10.0, 20.0, 30.0, 40.0]
            .map(|speed| {
                let mut p = t.at(speed);
                p.speed = speed;
                let trim = &mut p.inversion.trim;
                // Level flight at that forward speed.
                (trim.roll, trim.pitch) = (0.0, -0.002 * speed);
                trim.velocity_body = [speed * trim.pitch.cos(), 0.0, speed * trim.pitch.sin()];
                trim.sticks[2] = 40.0 + 0.02 * (speed - 15.0) * (speed - 15.0);
                let load = trim.velocity_body[0] * trim.velocity_body[2];
                let mut power = p.inversion.decoupling.try_inverse().unwrap();
                power[(2, 3)] = 0.001 * (trim.sticks[2] - 25.0);
                power[(1, 2)] = 0.002 + 1.5e-4 * load;
                power[(1, 3)] = -5e-5 * load;
                p.inversion.decoupling = power.try_inverse().unwrap();
                p
            })
            .to_vec();
        LawTable::new(points, t.settings, t.turn).unwrap()
    }

    /// The laws of growth are found where the breakpoints show them, and not
    /// where they do not.
    #[test]
    fn growth_of_powers_is_read_off_the_breakpoints() {
        let found = *on_lines().off_trim();
        assert_relative_eq!(found.pedal_yaw, 0.001, max_relative = 1e-9);
        assert_relative_eq!(found.collective_pitch, 1.5e-4, max_relative = 1e-9);
        assert_relative_eq!(found.pedal_pitch, -5e-5, max_relative = 1e-9);
        // Three breakpoints show no line, nor do scattered ones.
        assert_eq!(*table().off_trim(), OffTrim::default());
        let scattered = [(0.0, 1.0), (1.0, -1.0), (2.0, 1.0), (3.0, -1.0), (4.0, 1.5)];
        assert_eq!(slope(scattered.into_iter()), 0.0);
        assert_eq!(slope([(1.0, 2.0); 6].into_iter()), 0.0);
    }

    /// The law for small deviations is what differences of its steps give: its
    /// states, delay lines, measurements, demands and ports, in both modes and
    /// at speeds between breakpoints.
    #[test]
    fn linear_law_is_the_differences_of_its_steps() {
        let table = on_lines();
        let limits = [[-1e6, 1e6]; 4];
        let step = 0.01;
        let diagram = table.diagram(step, limits, true, false);
        let tables = table.breakpoints();
        let program = Program::new(&diagram, &tables);
        for (n, speed) in [2.0, 8.0, 17.0, 24.0, 26.5, 33.0].into_iter().enumerate() {
            for velocity_mode in [false, true] {
                let p = table.at(speed);
                let m = calm(at_trim(&p));
                let (down, [forward, right]) = earth_velocity(&m);
                let mut demand = hold(&p);
                demand.vertical_velocity = down + 0.2;
                demand.heading_rate = 0.02;
                if velocity_mode {
                    demand.horizontal =
                        Horizontal::Velocity { forward: forward + 0.3, right: right - 0.2 };
                }
                let mut inputs = vec![0.0; program.input_count()];
                inputs[..INPUTS].copy_from_slice(&numbers(&m, &demand));
                // Some steps away from rest, so that no term hides.
                let mut at = program.memory();
                for k in 0..40 + n {
                    inputs[4] = 0.01 * (k as f64 * 0.3).sin();
                    program.run(&mut at, &inputs);
                    program.advance(&mut at);
                }
                program.run(&mut at, &inputs);
                let law = LinearLaw::new(&diagram, &tables, &program, &at);
                let size = law.states.len();
                let outputs = 4 + MONITORS.len();
                // What a step makes of a change of one seed.
                let answer = |seed: usize, by: f64| {
                    let (mut m, mut inputs) = (at.clone(), inputs.clone());
                    let places: Vec<usize> = (0..inputs.len()).filter(|k| *k != 9).collect();
                    if seed < size {
                        // The first two memories say start and mode.
                        program.stored(&mut m)[2 + seed] += by;
                    } else if seed < size + places.len() {
                        inputs[places[seed - size]] += by;
                    } else {
                        *program.due(&mut m, seed - size - places.len()) += by;
                    }
                    program.run(&mut m, &inputs);
                    let mut out: Vec<f64> = (0..4).map(|k| program.output(&m, k)).collect();
                    out.extend((0..MONITORS.len()).map(|k| program.monitor(&m, k)));
                    out.extend(diagram.feeds.iter().map(|f| program.value(&m, f.input)));
                    program.advance(&mut m);
                    out.extend(&program.stored(&mut m)[2..]);
                    out
                };
                for seed in 0..size + law.inputs.len() {
                    let h = 1e-5;
                    let (up, low) = (answer(seed, h), answer(seed, -h));
                    let column = |whole: [&nalgebra::DMatrix<f64>; 2], row: usize| {
                        if seed < size {
                            whole[0][(row, seed)]
                        } else {
                            whole[1][(row, seed - size)]
                        }
                    };
                    for (row, (a, b)) in up.iter().zip(&low).enumerate() {
                        let slope = (a - b) / (2.0 * h);
                        let wanted = if row < outputs + law.lines {
                            column([&law.c, &law.d], row)
                        } else {
                            column([&law.a, &law.b], row - outputs - law.lines)
                        };
                        assert!(
                            (slope - wanted).abs() < 1e-6 * wanted.abs().max(1.0),
                            "row {row} seed {seed} at {speed}: {slope} {wanted}"
                        );
                    }
                }
            }
        }
    }

    /// The derivative of the linear law by each gain is what the port at it
    /// gives: the law is affine in a channel's gains, so that differences of any
    /// size are exact. In both modes, in the blend of turn coordination too.
    #[test]
    fn derivative_by_each_gain_is_that_of_its_port() {
        let table = on_lines();
        let mut compared = 0;
        for (speed, velocity_mode) in [(8.0, false), (8.0, true), (25.0, true), (33.0, false)] {
            for channel in Channel::ALL {
                for gain in channel.gains() {
                    let name = ["k_d", "k_p", "k_i"][gain.index()];
                    let place = crate::law::tables::place("gains", channel.name(), name).unwrap();
                    let linearizer = Linearizer::new(&table, &[place]);
                    let tap = &linearizer.taps()[0];
                    let law = linearizer.at(speed, velocity_mode);
                    let (input, signal) =
                        (law.input(&tap.input).unwrap(), law.output(&tap.signal).unwrap());
                    let with = |by: f64| {
                        let moved = table.with_gains(|k| {
                            let mut gains = table.points()[k].gains;
                            let mut values = gains[channel.index()].array();
                            values[gain.index()] += by;
                            gains[channel.index()] =
                                ChannelGains::new(values[0], values[1], values[2]);
                            gains
                        });
                        Linearizer::new(&moved, &[place]).at(speed, velocity_mode)
                    };
                    let (up, down) = (with(0.05), with(-0.05));
                    let mut felt = 0.0f64;
                    for (a, b, column, row) in [
                        (&up.a, &down.a, law.b.column(input), law.c.row(signal)),
                        (&up.b, &down.b, law.b.column(input), law.d.row(signal)),
                        (&up.c, &down.c, law.d.column(input), law.c.row(signal)),
                        (&up.d, &down.d, law.d.column(input), law.d.row(signal)),
                    ] {
                        let found = (a - b) / 0.1;
                        let wanted = column * row;
                        let size = wanted.amax().max(1.0);
                        assert!((found - &wanted).amax() < 1e-9 * size, "{channel} {name} {speed}");
                        felt = felt.max(wanted.amax());
                    }
                    // Outer gains do nothing under an attitude demand.
                    assert_eq!(felt > 0.0, velocity_mode || !channel.is_outer());
                    compared += 1;
                }
            }
        }
        assert_eq!(compared, 4 * 14);
    }

    /// In the limit of a short step the law is what it is at a short step.
    #[test]
    fn the_limit_of_a_short_step_is_reached() {
        let table = on_lines();
        let step = 1e-6;
        for (speed, velocity_mode) in [(8.0, false), (8.0, true), (26.5, true), (33.0, false)] {
            let limit = table.linear(speed, velocity_mode);
            let mut short = table.clone();
            // One step of delay, so that the lines are as short as in the limit.
            short.settings.reference_delay = step;
            let diagram = short.diagram(step, [[f64::MIN, f64::MAX]; 4], true, false);
            let tables = short.breakpoints();
            let program = Program::new(&diagram, &tables);
            let p = table.at(speed);
            let m = calm(at_trim(&p));
            let (down, [forward, right]) = earth_velocity(&m);
            let mut demand = hold(&p);
            demand.vertical_velocity = down;
            if velocity_mode {
                demand.horizontal = Horizontal::Velocity { forward, right };
            }
            let mut inputs = vec![0.0; program.input_count()];
            inputs[..INPUTS].copy_from_slice(&numbers(&m, &demand));
            let mut at = program.memory();
            program.run(&mut at, &inputs);
            program.hold(&mut at);
            program.run(&mut at, &inputs);
            let law = LinearLaw::new(&diagram, &tables, &program, &at);
            let seen = ["lat_held", "lon_held", "col_held", "ped_held", "held_heading"];
            let (limit, law) = (limit.seen_by(&seen), law.seen_by(&seen));
            for (k, name) in limit.states.iter().enumerate() {
                let j = law.states.iter().position(|n| n == name).unwrap();
                for (l, other) in limit.states.iter().enumerate() {
                    let i = law.states.iter().position(|n| n == other).unwrap();
                    let own = if k == l { 1.0 } else { 0.0 };
                    let rate = (law.a[(j, i)] - own) / step;
                    let wanted = limit.a[(k, l)];
                    assert!(
                        (rate - wanted).abs() < 1e-3 * wanted.abs().max(1.0),
                        "{name} {other} at {speed}: {rate} {wanted}"
                    );
                }
            }
            for (row, name) in limit.outputs.iter().enumerate() {
                let r = law.outputs.iter().position(|n| n == name).unwrap();
                for (column, input) in limit.inputs.iter().enumerate() {
                    let c = law.inputs.iter().position(|n| n == input).unwrap();
                    let (found, wanted) = (law.d[(r, c)], limit.d[(row, column)]);
                    assert!(
                        (found - wanted).abs() < 1e-4 * wanted.abs().max(1.0),
                        "{name} {input} at {speed}: {found} {wanted}"
                    );
                }
            }
        }
    }

    /// About the trim the corrections are of second order: halving a deviation
    /// takes three quarters of their effect, so that the linear law is the one
    /// that was tuned.
    #[test]
    fn off_trim_corrections_are_of_second_order() {
        let with = on_lines();
        let mut without = with.clone();
        without.off_trim = OffTrim::default();
        let effect = |size: f64| {
            let sticks = [&with, &without].map(|t| {
                let p = t.at(20.0);
                let mut c = Controller::new(t.clone(), 0.01, [[-1e6, 1e6]; 4]);
                c.step(&calm(at_trim(&p)), &hold(&p)).unwrap();
                let mut m = at_trim(&p);
                m.velocity_body[2] += 0.1 * size;
                m.rates[2] += 0.01 * size;
                c.step(&calm(m), &hold(&p)).unwrap()
            });
            (0..4).map(|j| (sticks[0][j] - sticks[1][j]).abs()).fold(0.0, f64::max)
        };
        let (full, half) = (effect(1.0), effect(0.5));
        assert!(full > 1e-3, "{full}");
        assert!(half < 0.27 * full, "{half} of {full}");
    }

    /// Engaged with any sticks, the first step keeps them, with the pedals'
    /// power changed as well.
    #[test]
    fn engaging_keeps_the_sticks_away_from_trim() {
        let t = on_lines();
        let p = t.at(20.0);
        let mut sticks = p.inversion.trim.sticks;
        for (stick, change) in sticks.iter_mut().zip([1.0, -2.0, -8.0, 5.0]) {
            *stick += change;
        }
        let m = calm(at_trim(&p));
        let mut c = Controller::new(t.clone(), 0.01, [[-100.0, 100.0]; 4]);
        c.engage(&m, &hold(&p), sticks).unwrap();
        for (got, want) in c.step(&m, &hold(&p)).unwrap().iter().zip(sticks) {
            assert!((got - want).abs() < 0.02, "{got} {want}");
        }
    }

    /// A disturbance of a held quantity acts where that is held and nowhere else.
    #[test]
    fn disturbances_enter_the_errors_alone() {
        let t = table();
        let p = t.at(15.0);
        let read = t.at(calm(at_trim(&p)).airspeed);
        for axis in Axis::ALL {
            let first = |d: [f64; 4]| {
                let mut c = Controller::new(t.clone(), 0.01, [[-1e6, 1e6]; 4]);
                c.disturb(d);
                c.step(&calm(at_trim(&p)), &hold(&p)).unwrap()
            };
            let mut d = [0.0; 4];
            d[axis.index()] = 1e-3;
            let (clean, disturbed) = (first([0.0; 4]), first(d));
            let k = read.gains[Channel::from(axis).index()];
            // The heading is the integral of the yaw rate.
            let holding = if axis == Axis::Yaw { k.k_i } else { k.k_p };
            for j in 0..4 {
                let expected = -read.inversion.allocation[(j, axis.index())] * holding * 1e-3;
                assert_relative_eq!(disturbed[j] - clean[j], expected, epsilon = 1e-9);
            }
        }
    }

    /// Flown in discrete time on the full-order linear test bed with actuators
    /// and delay, a bank step settles at its command.
    #[test]
    fn bank_step_settles_on_the_full_order_plant() {
        let t = table();
        let p = t.at(15.0);
        let plant = testbed::plant(15.0, &testbed::NOMINAL);
        let dt = 0.005;
        let mut c = Controller::new(t.clone(), dt, [[-1e3, 1e3]; 4]);
        let mut x = nalgebra::DVector::<f64>::zeros(plant.a.nrows());
        let hw = testbed::HARDWARE;
        let (mut stick, mut stick_rate) = ([0.0; 4], [0.0; 4]);
        let mut pipe: VecDeque<[f64; 4]> =
            std::iter::repeat_n([0.0; 4], (hw.delay / dt).round() as usize).collect();
        let trim = p.inversion.trim;
        let step = 5f64.to_radians();
        for _ in 0..(12.0 / dt) as usize {
            let m = Measurement {
                velocity_body: std::array::from_fn(|i| trim.velocity_body[i] + x[i]),
                rates: std::array::from_fn(|i| x[3 + i]),
                roll: trim.roll + x[6],
                pitch: trim.pitch + x[7],
                airspeed: 15.0,
            };
            let mut demand = hold(&p);
            demand.horizontal = Horizontal::Attitude { roll: trim.roll + step, pitch: trim.pitch };
            let sticks = c.step(&m, &demand).unwrap();
            pipe.push_back(std::array::from_fn(|j| sticks[j] - trim.sticks[j]));
            let late = pipe.pop_front().unwrap();
            for j in 0..4 {
                let wa = hw.actuator_bandwidth;
                stick_rate[j] += dt
                    * (wa * wa * (late[j] - stick[j])
                        - 2.0 * hw.actuator_damping * wa * stick_rate[j]);
                stick[j] += dt * stick_rate[j];
            }
            let input = nalgebra::DVector::from_column_slice(&stick);
            x += (&plant.a * &x + &plant.b * input) * dt;
        }
        assert_relative_eq!(x[6], step, max_relative = 0.05);
        assert!(x[7].abs() < 0.1 * step, "pitch moved by {}", x[7]);
    }
}
