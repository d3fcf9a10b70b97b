//! The control law: one definition for tuning, simulation and export.
//!
//! ```text
//! δ = δ_trim + B_d⁻¹ (ν_c − F x_ref) + M (ν_e − F_κ (x − x_ref)),   F_κ = F_att + κ F_uvw
//! ν_c = φ_ref'',   ν_e = K_D (φ'_ref(t − τ) − φ') + K_P (φ_ref(t − τ) − φ) + K_I ∫(φ_ref(t − τ) − φ)
//! ```
//!
//! and in the same way for θ; for r and V_z (down positive) one derivative
//! less. With M = B_d⁻¹ this is the partial inversion B_d⁻¹ (ν − F_att x −
//! κ F_uvw x − (1 − κ) F_uvw x_ref); see [`Inversion`] for why feedback has an
//! allocation of its own. Without the hybrid feed-forward x_ref is zero. x is
//! the deviation from the trim at the scheduled speed. Around it the
//! translational rate command of the reference paper's Fig. 11:
//!
//! ```text
//! θ_c = θ_trim − a_x/G_θ − (K_P e_x + K_I ∫e_x)/g
//! φ_c = φ_trim + a_y/G_φ + atan(V_x ψ'_c/g) + (K_P e_y + K_I ∫e_y)/g
//! ```
//!
//! with e the error of ground velocity in heading axes and a the acceleration
//! of its reference: a first-order lag of the command. G is the acceleration
//! per attitude of the inverted model at constant height, g in hover; at speed
//! pitching also turns the rotors' drag, and G_θ is up to twice as large. What the aircraft can
//! do of it is that lag seen through the attitude command model and the
//! reference delay; e is measured against that. V_x ψ'_c is what it takes to
//! hold V_y while the heading axes turn. Eq. 75 is a blend b(V) that rises
//! smoothly from 0 to 1 around the turn-coordination speed:
//! φ_c' = (1 − b) φ_c + b (φ_trim + atan(V ψ'_c/g)). It hands over from one to
//! the other without a step, because both ask for the same bank. So that yaw
//! and bank go into a turn together, the yaw command is led through the
//! attitude command model as the speed nears half the turn-coordination speed,
//! and its own lag is made up for.
//!
//! Under a velocity command the schedule is read at the speed of the
//! reference, not of the aircraft. Read at the speed that is flown, the trim
//! attitude and sticks would change with every gust and close a loop that the
//! gains do not know of.
//!
//! Away from the schedule's trims two things change that no table over speed
//! holds, [`OffTrim`]: the pedals' power over yaw grows with the collective,
//! and the pitching moment of rotor lift grows with the tail's load. Both laws
//! of growth are read off the table itself.
//!
//! Everything that depends on speed is read from a table by linear
//! interpolation, and held constant beyond its ends. [`LawTable::at`] is what
//! the tuning and the verification look at; [`Controller::step`] is the same
//! law in discrete time, nonlinear in kinematics.

use super::axis::{Axis, Channel, Effector, Gain, GainSet};
use super::loops::LawSettings;
use super::plant::{Inversion, rigid};
use super::spec::TurnCoordination;
use crate::units::STANDARD_GRAVITY as GRAVITY;
use nalgebra::{SVector, Vector4};
use std::collections::VecDeque;

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

/// How the sticks' powers change away from the trims of the schedule.
///
/// A rotor's torque is nearly a parabola in its collective. So what pedals do
/// that move the rotors' collectives apart grows in proportion to the
/// collective they start from, and an aircraft that climbs or accelerates has
/// more of it than in level flight. The thrust of the rotors balances the
/// tail's load about the centre of gravity, hence the arm of that thrust, and
/// with it the pitching moment of collective and pedals, grows with the load,
/// as u w does. Both show in the schedule, because collective and u w also
/// change with speed: these are least-squares slopes over its breakpoints,
/// and zero where the breakpoints lie on no line.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OffTrim {
    /// Growth of the yaw acceleration per pedal with collective,
    /// rad/s² per % per %.
    pub pedal_yaw: f64,
    /// Growth of the pitch acceleration per collective with u w,
    /// rad/s² per % per m²/s².
    pub collective_pitch: f64,
    /// Growth of the pitch acceleration per pedal with u w,
    /// rad/s² per % per m²/s².
    pub pedal_pitch: f64,
}

/// Fewest breakpoints that show a line.
pub const LEAST_BREAKPOINTS: usize = 4;
/// Least share of the variance over the breakpoints that a line must explain.
pub const LEAST_EXPLAINED: f64 = 0.95;
/// Least variance of the abscissas, over their mean square.
pub const LEAST_SPREAD: f64 = 1e-6;
/// How far the pedals' power may be taken to differ from that at the trim.
pub const PEDAL_POWER_RANGE: [f64; 2] = [0.4, 4.0];

impl OffTrim {
    /// The slopes over the breakpoints of a table.
    fn of(points: &[LawPoint]) -> Self {
        let (yaw, pitch) = (Axis::Yaw.index(), Axis::Pitch.index());
        let (collective, pedal) = (Effector::Collective.index(), Effector::Pedal.index());
        let mut powers = Vec::with_capacity(points.len());
        for p in points {
            let Some(power) = p.inversion.decoupling.try_inverse() else {
                return Self::default();
            };
            let [u, _, w] = p.inversion.trim.velocity_body;
            powers.push((p.inversion.trim.sticks[collective], u * w, power));
        }
        let pitching = |stick: usize| {
            slope(powers.iter().map(|(_, load, power)| (*load, power[(pitch, stick)])))
        };
        Self {
            pedal_yaw: slope(powers.iter().map(|(col, _, power)| (*col, power[(yaw, pedal)]))),
            collective_pitch: pitching(collective),
            pedal_pitch: pitching(pedal),
        }
    }

    /// Power of the pedals over yaw, relative to the trim's, at a change of
    /// collective from it, %.
    fn pedal_power(&self, inv: &Inversion, collective: f64) -> f64 {
        let per_power = inv.decoupling[(Effector::Pedal.index(), Axis::Yaw.index())];
        let [low, high] = PEDAL_POWER_RANGE;
        (1.0 + self.pedal_yaw * per_power * collective).clamp(low, high)
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
        let off_trim = OffTrim::of(&points);
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

    /// Weight of turn coordination in Eq. 75 at a speed: 0 below the blend, 1
    /// above, a cubic with flat ends between.
    pub fn turn_blend(&self, speed: f64) -> f64 {
        let t = ((speed - self.turn.speed) / self.turn.width + 0.5).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
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

/// Largest attitudes that the outer loop may command, rad.
pub const ATTITUDE_LIMIT: f64 = 35.0 * std::f64::consts::PI / 180.0;
/// How much slower velocity references are than attitude references: their
/// time constant is this over the natural frequency.
pub const OUTER_SLOWNESS: f64 = 4.0;
/// Largest horizontal acceleration of a velocity reference, m/s².
pub const ACCELERATION_LIMIT: f64 = 0.35 * GRAVITY;
/// Farthest that the speed of the schedule may lie from the speed that is
/// flown, m/s.
pub const SCHEDULE_LEAD: f64 = 5.0;
/// The yaw command is led in full from the turn-coordination speed over this.
pub const YAW_LEAD: f64 = 2.0;
/// Forward speed below which rolling asks for no yaw, m/s.
pub const SLOW: f64 = 5.0;
/// Time constant with which the lateral velocity integral is forgotten where
/// turn coordination has taken over, s.
pub const FORGETTING: f64 = 1.0;

/// A reference: value and derivatives.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Reference {
    value: f64,
    rate: f64,
    acceleration: f64,
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

/// Places in the history of references.
const REFERENCES: usize = 6;
/// Where the velocities begin there.
const VELOCITY: usize = 4;

/// The law with its memory, stepping at a fixed interval.
#[derive(Debug, Clone)]
pub struct Controller {
    table: LawTable,
    step: f64,
    stick_limits: [[f64; 2]; 4],
    started: bool,
    /// Bank, pitch, yaw rate, vertical velocity; then what can be done of the
    /// horizontal velocities.
    references: [Reference; REFERENCES],
    /// Horizontal velocities as lags of their commands.
    velocity_commands: [f64; 2],
    /// Rate of turn as bank can follow it.
    turn: Reference,
    /// Whether the last step was under a velocity command.
    velocity_mode: bool,
    /// Weight of turn coordination at the last step.
    blend: f64,
    /// Values and rates of the references of the last τ.
    history: VecDeque<[[f64; 2]; REFERENCES]>,
    integrals: [f64; 4],
    velocity_integrals: [f64; 2],
    /// Horizontal velocity deviations of the reference model.
    model: [f64; 2],
    /// Trim velocities u, v at the last step.
    trim_velocity: [f64; 2],
    sticks: [f64; 4],
    disturbance: [f64; 4],
}

impl Controller {
    /// A controller that steps every `step` s within stick limits, %.
    pub fn new(table: LawTable, step: f64, stick_limits: [[f64; 2]; 4]) -> Self {
        Self {
            table,
            step,
            stick_limits,
            started: false,
            references: [Reference::default(); REFERENCES],
            velocity_commands: [0.0; 2],
            turn: Reference::default(),
            velocity_mode: false,
            blend: 0.0,
            history: VecDeque::new(),
            integrals: [0.0; 4],
            velocity_integrals: [0.0; 2],
            model: [0.0; 2],
            trim_velocity: [0.0; 2],
            sticks: [0.0; 4],
            disturbance: [0.0; 4],
        }
    }

    /// Adds a disturbance to the held quantities as the gains that hold them see
    /// them, and nowhere else: φ, θ, heading (the integral of r), V_z (down).
    /// Rates, inversion and kinematics stay clean. This is where disturbance rejection is defined, and it cannot be
    /// reached through [`Measurement`]. A port for measurements; it stays until
    /// it is set again.
    pub fn disturb(&mut self, outputs: [f64; 4]) {
        self.disturbance = outputs;
    }

    /// The table.
    pub fn table(&self) -> &LawTable {
        &self.table
    }

    /// Starts from a measurement without a transient: references at what is
    /// measured, integrals at zero.
    fn start(&mut self, m: &Measurement, p: &LawPoint, vertical: f64, ground: [f64; 2]) {
        let value = |value: f64| Reference { value, ..Reference::default() };
        self.references = [m.roll, m.pitch, m.rates[2], vertical, ground[0], ground[1]].map(value);
        self.velocity_commands = ground;
        let across = m.rates[1] * m.roll.sin() + m.rates[2] * m.roll.cos();
        self.turn = value(across / m.pitch.cos());
        let now = self.references.map(|r| [r.value, r.rate]);
        let length = (self.table.settings.reference_delay / self.step).round() as usize;
        self.history = std::iter::repeat_n(now, length + 1).collect();
        let trim = p.inversion.trim.velocity_body;
        self.trim_velocity = [trim[0], trim[1]];
        let wind = m.airspeed - ground[0];
        let (sp, (st, ct)) = (m.roll.sin(), m.pitch.sin_cos());
        let [u, v, _] = m.velocity_body;
        self.model = [u + wind * ct - trim[0], v + wind * st * sp - trim[1]];
        self.integrals = [0.0; 4];
        self.velocity_integrals = [0.0; 2];
        self.started = true;
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
        self.started = false;
        let mut trial = self.clone();
        let own = trial.step(m, demand)?;
        // Now started, with the integrals still at zero.
        let p = self.table.at(m.airspeed);
        let (vertical, ground) = earth_velocity(m);
        self.start(m, &p, vertical, ground);
        let trim = p.inversion.trim;
        if let Horizontal::Velocity { .. } = demand.horizontal {
            self.velocity_mode = true;
            let attitude = [trim.pitch - m.pitch, m.roll - trim.roll];
            for (k, channel) in [Channel::Vx, Channel::Vy].into_iter().enumerate() {
                let k_i = p.gains[channel.index()].k_i;
                if k_i > 0.0 {
                    self.velocity_integrals[k] = GRAVITY * attitude[k] / k_i;
                }
            }
            // The attitude now asked for is the one flown.
            let mut again = self.clone();
            let own = again.step(m, demand)?;
            self.load_integrals(&p, own, sticks);
        } else {
            self.load_integrals(&p, own, sticks);
        }
        Ok(())
    }

    /// Sets the integrals so that the sticks move from `own` to `sticks`.
    fn load_integrals(&mut self, p: &LawPoint, own: [f64; 4], sticks: [f64; 4]) {
        let Some(forward) = p.inversion.allocation.try_inverse() else {
            return;
        };
        // Pedals as the inversion asks for them, at the trim's power.
        let (col, ped) = (Effector::Collective.index(), Effector::Pedal.index());
        let (trim, off_trim) = (p.inversion.trim.sticks, self.table.off_trim);
        let asked = |sticks: [f64; 4]| {
            let power = off_trim.pedal_power(&p.inversion, sticks[col] - trim[col]);
            (sticks[ped] - trim[ped]) * power
        };
        let pedal = asked(sticks) - asked(own);
        let lacking =
            forward * Vector4::from_fn(|j, _| if j == ped { pedal } else { sticks[j] - own[j] });
        for axis in Axis::ALL {
            let i = axis.index();
            let k_i = p.gains[Channel::from(axis).index()].k_i;
            if k_i > 0.0 {
                self.integrals[i] = lacking[i] / k_i;
            }
        }
    }

    /// What the last step steered to. Where turn coordination has the bank, the
    /// velocity to the right is that of flight without v: −w sin φ.
    pub fn references(&self) -> References {
        let now = self.history.front().copied().unwrap_or_default();
        let (sp, cp) = now[1][0].sin_cos();
        let lifted = now[VELOCITY][0] * sp + now[3][0] * cp;
        let coordinated = -lifted * now[0][0].tan();
        let right = (1.0 - self.blend) * now[VELOCITY + 1][0] + self.blend * coordinated;
        References {
            roll: now[0][0],
            pitch: now[1][0],
            yaw_rate: now[2][0],
            vertical_velocity: now[3][0],
            velocity: self.velocity_mode.then_some([now[VELOCITY][0], right]),
            velocity_lag: self.velocity_mode.then_some(self.velocity_commands),
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
        let settings = self.table.settings;
        let (vertical, ground) = earth_velocity(m);
        let [forward, right] = ground;
        let [u, v, w] = m.velocity_body;
        let ((sp, cp), (st, ct)) = (m.roll.sin_cos(), m.pitch.sin_cos());
        if !self.started {
            let p = self.table.at(m.airspeed);
            self.start(m, &p, vertical, ground);
        }
        let dt = self.step;
        let velocity_mode = matches!(demand.horizontal, Horizontal::Velocity { .. });
        if velocity_mode && !self.velocity_mode {
            self.velocity_commands = ground;
            for (k, value) in ground.into_iter().enumerate() {
                self.references[VELOCITY + k] = Reference { value, ..Reference::default() };
                for past in &mut self.history {
                    past[VELOCITY + k] = [value, 0.0];
                }
            }
            self.velocity_integrals = [0.0; 2];
        }
        self.velocity_mode = velocity_mode;
        // The reference that is now at the end of its delay.
        let due = self.history.get(1).or(self.history.front()).copied().unwrap_or_default();
        let lead = if velocity_mode {
            (due[VELOCITY][0] - forward).clamp(-SCHEDULE_LEAD, SCHEDULE_LEAD)
        } else {
            0.0
        };
        let p = self.table.at((m.airspeed + lead).max(0.0));
        let inv = &p.inversion;
        let trim = inv.trim;
        let off_trim = self.table.off_trim;

        // Outer loop and Eq. 75.
        let blend = self.table.turn_blend(m.airspeed);
        self.blend = blend;
        let coordinated = (m.airspeed * demand.heading_rate / GRAVITY).atan();
        let frequencies = [settings.pitch_frequency, settings.roll_frequency];
        let (roll_command, pitch_command) = match demand.horizontal {
            Horizontal::Attitude { roll, pitch } => (roll, pitch),
            Horizontal::Velocity { forward: vx, right: vy } => {
                let commands = [vx, vy];
                let acceleration: [f64; 2] = std::array::from_fn(|k| {
                    ((commands[k] - self.velocity_commands[k]) * frequencies[k] / OUTER_SLOWNESS)
                        .clamp(-ACCELERATION_LIMIT, ACCELERATION_LIMIT)
                });
                for (velocity, acceleration) in self.velocity_commands.iter_mut().zip(acceleration)
                {
                    *velocity += dt * acceleration;
                }
                let errors = [due[VELOCITY][0] - forward, due[VELOCITY + 1][0] - right];
                let gains = [p.gains[Channel::Vx.index()], p.gains[Channel::Vy.index()]];
                // Heading axes turn: holding V_y takes V_x ψ' of acceleration.
                let turning =
                    [0.0, (self.velocity_commands[0] * demand.heading_rate / GRAVITY).atan()];
                let per_attitude = acceleration_per_attitude(inv);
                let raw: [f64; 2] = std::array::from_fn(|k| {
                    acceleration[k] / per_attitude[k]
                        + (gains[k].k_p * errors[k] + gains[k].k_i * self.velocity_integrals[k])
                            / GRAVITY
                        + turning[k]
                });
                // Where turn coordination has the bank, the lateral integral
                // has nothing to do and is forgotten.
                let share = [1.0, 1.0 - blend];
                for (k, share) in share.into_iter().enumerate() {
                    // Anti-windup: hold while the attitude limit is reached.
                    let outward = raw[k].abs() > ATTITUDE_LIMIT && raw[k] * errors[k] > 0.0;
                    if !outward {
                        self.velocity_integrals[k] += dt * share * errors[k];
                    }
                    self.velocity_integrals[k] *= 1.0 - dt * (1.0 - share) / FORGETTING;
                }
                let limited = raw.map(|r| r.clamp(-ATTITUDE_LIMIT, ATTITUDE_LIMIT));
                (trim.roll + limited[1], trim.pitch - limited[0])
            }
        };
        let roll_command = (1.0 - blend) * roll_command + blend * (trim.roll + coordinated);

        // Command models.
        let attitude = |r: &mut Reference, command: f64, wn: f64| {
            r.acceleration =
                wn * wn * (command - r.value) - 2.0 * settings.attitude_damping * wn * r.rate;
            r.rate += dt * r.acceleration;
            r.value += dt * r.rate;
        };
        attitude(&mut self.references[0], roll_command, settings.roll_frequency);
        attitude(&mut self.references[1], pitch_command, settings.pitch_frequency);
        if velocity_mode {
            // What the aircraft can do of a velocity: the attitude command
            // model stands between.
            for (k, frequency) in frequencies.into_iter().enumerate() {
                let command = self.velocity_commands[k];
                attitude(&mut self.references[VELOCITY + k], command, frequency);
            }
        }
        // The heading turns no sooner than the bank that must go with it.
        attitude(&mut self.turn, demand.heading_rate, settings.roll_frequency);
        let together = (YAW_LEAD * m.airspeed / self.table.turn.speed).clamp(0.0, 1.0);
        let led = self.turn.value + settings.yaw_time_constant * self.turn.rate;
        let heading_rate = (1.0 - together) * demand.heading_rate + together * led;
        // In a coordinated turn the aircraft rolls about its flight path: to
        // keep v at zero, rolling with w asks for yaw, p w = r u.
        let slope = if trim.velocity_body[0] > SLOW {
            blend * trim.velocity_body[2] / trim.velocity_body[0]
        } else {
            0.0
        };
        let bank = self.references[0];
        let rolling = slope * (bank.rate + settings.yaw_time_constant * bank.acceleration);
        // Heading rate to body yaw rate, at the attitude flown.
        let yaw_command = heading_rate * cp * ct + rolling;
        let lag = |r: &mut Reference, command: f64, time_constant: f64| {
            r.rate = (command - r.value) / time_constant;
            r.value += dt * r.rate;
        };
        lag(&mut self.references[2], yaw_command, settings.yaw_time_constant);
        lag(&mut self.references[3], demand.vertical_velocity, settings.heave_time_constant);
        self.history.push_back(self.references.map(|r| [r.value, r.rate]));
        while self.history.len() > (settings.reference_delay / dt).round() as usize + 1 {
            self.history.pop_front();
        }
        let delayed = self.history.front().copied().unwrap_or_default();

        // ν_c and ν_e.
        let feed = [
            self.references[0].acceleration,
            self.references[1].acceleration,
            self.references[2].rate,
            self.references[3].rate,
        ];
        let measured = [m.roll, m.pitch, m.rates[2], vertical];
        // Euler rates of bank and pitch.
        let measured_rate = [
            m.rates[0] + st / ct * (m.rates[1] * sp + m.rates[2] * cp),
            m.rates[1] * cp - m.rates[2] * sp,
        ];
        let mut errors: [f64; 4] = std::array::from_fn(|i| delayed[i][0] - measured[i]);
        let mut commanded = Vector4::from_column_slice(&feed);
        let mut nu = Vector4::<f64>::zeros();
        for axis in Axis::ALL {
            let i = axis.index();
            let channel = Channel::from(axis);
            let k = p.gains[channel.index()];
            if channel.holds(Gain::Proportional) {
                errors[i] -= self.disturbance[i];
            } else {
                // What is held is the integral of the output.
                nu[i] -= k.k_i * self.disturbance[i];
            }
            nu[i] += k.k_p * errors[i] + k.k_i * self.integrals[i];
            if i < 2 {
                nu[i] += k.k_d * (delayed[i][1] - measured_rate[i]);
            }
        }

        // Inversion.
        let tv = trim.velocity_body;
        // Through the air as far as it is known: the forward airspeed is.
        let wind = m.airspeed - forward;
        let air = [u + wind * ct, v + wind * st * sp, w + wind * st * cp];
        let x = SVector::<f64, 8>::from_column_slice(&[
            air[0] - tv[0],
            air[1] - tv[1],
            air[2] - tv[2],
            m.rates[0],
            m.rates[1],
            m.rates[2],
            m.roll - trim.roll,
            m.pitch - trim.pitch,
        ]);
        let (velocity, attitude_part) = inv.split_feedback();
        let f_kappa = attitude_part + velocity * settings.kappa;
        nu -= f_kappa * x;
        // The reference model's deviation is from the trim at the scheduled
        // speed: when that moves, the deviation moves the other way.
        for ((model, old), new) in self.model.iter_mut().zip(&self.trim_velocity).zip(tv.iter()) {
            *model -= new - old;
        }
        self.trim_velocity[..2].copy_from_slice(&[tv[0], tv[1]]);
        let rho = SVector::<f64, 6>::from_column_slice(&[
            self.references[0].value - trim.roll,
            self.references[1].value - trim.pitch,
            self.references[0].rate,
            self.references[1].rate,
            self.references[2].value,
            self.references[3].value,
        ]);
        let z = SVector::<f64, 2>::from_column_slice(&self.model);
        let mut ideal = inv.reference.state * z + inv.reference.input * rho;
        // Exact kinematics: in a turn the aircraft also pitches and rolls.
        let to = |k: usize| self.references[k].value;
        let ((sr, cr), (sp, cp)) = (to(0).sin_cos(), to(1).sin_cos());
        let [bank_rate, pitch_rate] = [self.references[0].rate, self.references[1].rate];
        let turn = (to(2) + pitch_rate * sr) / (cp * cr);
        ideal[rigid::P] = bank_rate - turn * sp;
        ideal[rigid::Q] = pitch_rate * cr + turn * cp * sr;
        ideal[rigid::R] = to(2);
        if velocity_mode {
            // The velocities are known from their references, and need no
            // model of their own.
            let (along, down) = (to(VELOCITY) + wind, to(3));
            let lifted = along * sp + down * cp;
            // A coordinated turn leaves no v.
            let across = (1.0 - blend) * to(VELOCITY + 1) - blend * lifted * sr / cr;
            let body =
                [along * cp - down * sp, across * cr + lifted * sr, lifted * cr - across * sr];
            for (k, (body, trim)) in body.into_iter().zip(tv).enumerate() {
                ideal[rigid::U + k] = body - trim;
            }
            self.model = [ideal[rigid::U], ideal[rigid::V]];
        }
        let mut lifting = 0.0;
        if settings.hybrid_feedforward {
            nu += f_kappa * ideal;
            commanded -= inv.feedback * ideal;
            // Pitching moment of the lift that the references ask for, with the
            // tail's load that goes with them. The collective grows together
            // with the load, so that its moment has half its end value on the
            // mean; pedals come and go with the load standing.
            let [ideal_u, ideal_w] = [tv[0] + ideal[rigid::U], tv[2] + ideal[rigid::W]];
            let load = ideal_u * ideal_w - tv[0] * tv[2];
            let asked = inv.decoupling * commanded;
            let collective = asked[Effector::Collective.index()];
            let pedal = asked[Effector::Pedal.index()] / off_trim.pedal_power(inv, collective);
            lifting = load
                * (0.5 * off_trim.collective_pitch * collective + off_trim.pedal_pitch * pedal);
        }
        let change = inv.reference.dynamics * ideal
            + inv.reference.drive * Vector4::from_column_slice(&feed);
        if !velocity_mode {
            self.model[0] += dt * change[0];
            self.model[1] += dt * change[1];
        }

        let mut delta = inv.decoupling * commanded + inv.allocation * nu;
        delta -= inv.decoupling.column(Axis::Pitch.index()) * lifting;
        let (col, ped) = (Effector::Collective.index(), Effector::Pedal.index());
        let [low, high] = self.stick_limits[col];
        let collective = (trim.sticks[col] + delta[col]).clamp(low, high) - trim.sticks[col];
        delta[ped] /= off_trim.pedal_power(inv, collective);
        for j in 0..4 {
            let [low, high] = self.stick_limits[j];
            self.sticks[j] = (trim.sticks[j] + delta[j]).clamp(low, high);
        }
        // Anti-windup: an axis's integral holds while its own effector is at a
        // limit and the error would push it further.
        for axis in Axis::ALL {
            let (i, e) = (axis.index(), axis.effector().index());
            let wanted = trim.sticks[e] + delta[e];
            let push = inv.allocation[(e, i)] * errors[i];
            let stuck = (wanted > self.stick_limits[e][1] && push > 0.0)
                || (wanted < self.stick_limits[e][0] && push < 0.0);
            if !stuck {
                self.integrals[i] += dt * errors[i];
            }
        }
        Ok(self.sticks)
    }

    /// Peak of the deviation u, v that the reference model has built up, m/s:
    /// for reports of a simulation.
    pub fn model_deviation(&self) -> [f64; 2] {
        self.model
    }
}

/// Horizontal acceleration per attitude of the inverted model at constant
/// vertical velocity, m/s² per rad: forward per pitch down, to the right per
/// bank. Gravity where the model's own is not positive.
fn acceleration_per_attitude(inv: &Inversion) -> [f64; 2] {
    let model = &inv.reference;
    let through = inv.ground_velocity * model.state * model.dynamics * model.input;
    [-through[(0, 1)], through[(1, 0)]].map(|g| if g > 0.5 * GRAVITY { g } else { GRAVITY })
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
    use crate::control::testbed;
    use crate::control::tuning::start_gains;
    use approx::assert_relative_eq;

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
