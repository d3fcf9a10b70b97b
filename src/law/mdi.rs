//! The multi-loop dynamic-inversion law. Each of its formulas stands here, once.
//!
//! ```text
//! δ = δ_trim + B_d⁻¹ (ν_c − F x_ref) + M N (ν_e − F_κ (x − x_ref)),   F_κ = F_att + κ F_uvw
//! ν_c = φ_ref'',   ν_e = K_D (φ'_ref(t − τ) − φ') + K_P (φ_ref(t − τ) − φ) + K_I ∫(φ_ref(t − τ) − φ)
//! ```
//!
//! and in the same way for θ; for r and V_z (down positive) one derivative
//! less. With M = B_d⁻¹ this is the partial inversion B_d⁻¹ (ν − F_att x −
//! κ F_uvw x − (1 − κ) F_uvw x_ref). N is a notch filter on an axis that has
//! one. Without the hybrid feed-forward x_ref is zero. x is the deviation from
//! the trim at the scheduled speed. Around it the translational rate command of
//! the reference paper's Fig. 11:
//!
//! ```text
//! θ_c = θ_trim − a_x/G_θ − (K_P e_x + K_I ∫e_x)/g
//! φ_c = φ_trim + a_y/G_φ + atan(V_x ψ'_c/g) + (K_P e_y + K_I ∫e_y)/g
//! ```
//!
//! with e the error of ground velocity in heading axes and a the acceleration
//! of its reference: a first-order lag of the command. G is the acceleration
//! per attitude of the inverted model at constant height, g in hover; at speed
//! pitching also turns the rotors' drag, and G_θ is up to twice as large. What
//! the aircraft can do of it is that lag seen through the attitude command
//! model and the reference delay; e is measured against that. V_x ψ'_c is what
//! it takes to hold V_y while the heading axes turn. Eq. 75 is a blend b(V)
//! that rises smoothly from 0 to 1 around the turn-coordination speed:
//! φ_c' = (1 − b) φ_c + b (φ_trim + atan(V ψ'_c/g)). It hands over from one to
//! the other without a step, because both ask for the same bank. So that yaw
//! and bank go into a turn together, the yaw command is led through the
//! attitude command model as the speed nears half the turn-coordination speed,
//! and its own lag is made up for.
//!
//! Under a velocity command the schedule is read at the speed of the
//! reference, not of the aircraft. Read at the speed that is flown, the trim
//! attitude and sticks would change with every gust and close a loop of their
//! own.
//!
//! Away from the schedule's trims two things change that no table over speed
//! holds: the pedals' power over yaw grows with the collective, and the
//! pitching moment of rotor lift grows with the tail's load.
//!
//! Everything that depends on speed is read from tables by linear
//! interpolation, and held constant beyond their ends.

use super::diagram::{Diagram, Function, Kind, Label, Model, Restart, Term, Wire, term};
use super::tables::{self, NU, STATES, STICKS};
use crate::units::STANDARD_GRAVITY as GRAVITY;
use serde::{Deserialize, Serialize};

/// The choices of the law that are not gains.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LawSettings {
    /// Fraction κ of the velocity terms of F that the inversion cancels by
    /// feedback, 0 to 1.
    pub kappa: f64,
    /// Whether the rest, 1 − κ, is fed forward from the ideal model.
    pub hybrid_feedforward: bool,
    /// Delay of the reference in the error path, s: about the equivalent
    /// delay of hardware and rotor.
    pub reference_delay: f64,
    /// Natural frequency of the roll command model, rad/s.
    pub roll_frequency: f64,
    /// Natural frequency of the pitch command model, rad/s.
    pub pitch_frequency: f64,
    /// Damping ratio of both attitude command models.
    pub attitude_damping: f64,
    /// Time constant of the yaw rate command model, s.
    pub yaw_time_constant: f64,
    /// Time constant of the vertical velocity command model, s.
    pub heave_time_constant: f64,
    /// Notch filters on what feedback asks for.
    #[serde(default, skip_serializing_if = "Notches::is_empty")]
    pub notch: Notches,
}

/// Notch filters of the inner axes, where there are any.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Notches {
    /// On φ''.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub roll: Option<Notch>,
    /// On θ''.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pitch: Option<Notch>,
    /// On r'.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub yaw: Option<Notch>,
    /// On V_z'.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub heave: Option<Notch>,
}

impl Notches {
    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.axes().iter().all(Option::is_none)
    }

    /// In the order of the axes.
    pub fn axes(&self) -> [Option<Notch>; 4] {
        [self.roll, self.pitch, self.yaw, self.heave]
    }
}

/// A notch filter, `(s² + 2 ζ d ω s + ω²)/(s² + 2 ζ ω s + ω²)`; see
/// [`Diagram::notch`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Notch {
    /// Frequency ω that is taken out, rad/s.
    pub frequency: f64,
    /// Damping ratio ζ: half the relative width.
    pub damping: f64,
    /// Factor d with which the frequency passes, 0 to 1.
    pub depth: f64,
}

/// The blend of Eq. 75.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TurnCoordination {
    /// Middle of the blend, m/s.
    pub speed: f64,
    /// Full width of the blend, m/s.
    pub width: f64,
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
/// How far the pedals' power may be taken to differ from that at the trim.
pub const PEDAL_POWER_RANGE: [f64; 2] = [0.4, 4.0];

/// What a diagram of the law is made for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choices {
    /// Settings.
    pub settings: LawSettings,
    /// Turn coordination.
    pub turn: TurnCoordination,
    /// Growth of the sticks' powers.
    pub off_trim: OffTrim,
    /// Lower and upper limits of lat, lon, col, ped, %.
    pub limits: [[f64; 2]; 4],
    /// Interval between steps, s; 0 for the limit of a short step.
    pub step: f64,
    /// Steps by which the references are delayed in the error path; see
    /// [`delay_steps`].
    pub delay_steps: usize,
    /// Whether the diagram has ports for measurements; see [`PORTS`].
    pub ports: bool,
    /// Whether the law can be engaged with given sticks.
    pub engage: bool,
}

/// Measurements, in the order of the diagram's inputs: name, unit, meaning.
pub const MEASUREMENTS: [(&str, &str, &str); 9] = [
    ("u", "m/s", "velocity over the ground, body axes, forward"),
    ("v", "m/s", "velocity over the ground, body axes, to the right"),
    ("w", "m/s", "velocity over the ground, body axes, down"),
    ("p", "rad/s", "roll rate"),
    ("q", "rad/s", "pitch rate"),
    ("r", "rad/s", "yaw rate"),
    ("phi", "rad", "bank angle"),
    ("theta", "rad", "pitch angle"),
    ("airspeed", "m/s", "forward component of the true airspeed in heading axes"),
];

/// Demands, in the order of the diagram's inputs, after the measurements. The
/// first says whether the next two are attitudes or velocities.
pub const DEMANDS: [(&str, &str, &str); 5] = [
    ("velocity_mode", "1", "whether the commands are velocities"),
    ("command_1", "1", "bank, rad; or velocity forward, m/s"),
    ("command_2", "1", "pitch, rad; or velocity to the right, m/s"),
    ("heading_rate", "rad/s", "demanded heading rate"),
    ("v_z_command", "m/s", "demanded vertical velocity, down positive"),
];

/// Ports for measurements on the loops: what enters is added to a quantity as
/// one part of the law sees it, and nowhere else.
pub const PORTS: [(&str, &str, &str); 11] = [
    ("port_phi", "rad", "added to the bank angle in its error"),
    ("port_theta", "rad", "added to the pitch angle in its error"),
    ("port_heading", "rad", "added to the heading, the integral of r"),
    ("port_v_z", "m/s", "added to the vertical velocity in its error"),
    ("port_phi_rate", "rad/s", "added to the rate of bank in its error"),
    ("port_theta_rate", "rad/s", "added to the rate of pitch in its error"),
    ("port_r", "rad/s", "added to the yaw rate in its error"),
    ("port_v_x", "m/s", "added to the forward velocity in its error"),
    ("port_v_y", "m/s", "added to the velocity to the right in its error"),
    ("port_phi_command", "rad", "added to the command of bank"),
    ("port_theta_command", "rad", "added to the command of pitch"),
];

/// What the law can be engaged with.
pub const ENGAGEMENT: [(&str, &str, &str); 5] = [
    ("engaging", "1", "whether the law is being engaged"),
    ("given_lat", "%", "lateral stick to engage with"),
    ("given_lon", "%", "longitudinal stick to engage with"),
    ("given_col", "%", "collective to engage with"),
    ("given_ped", "%", "pedals to engage with"),
];

/// What may be looked at beside the sticks, in this order.
pub const MONITORS: [&str; 14] = [
    "delayed_phi",
    "delayed_theta",
    "delayed_r",
    "delayed_v_z",
    "due_v_x",
    "shown_v_y",
    "v_x_command",
    "v_y_command",
    "model_u",
    "model_v",
    // What the gains hold.
    "held_heading",
    "v_z",
    "v_x",
    "v_y",
];

/// The inner axes: name of the output, its channel and its effector.
pub const AXES: [(&str, &str, usize); 4] =
    [("phi", "roll", 0), ("theta", "pitch", 1), ("r", "yaw", 3), ("v_z", "heave", 2)];

/// Steps of the reference's delay at an interval between steps, s.
pub fn delay_steps(settings: &LawSettings, step: f64) -> usize {
    (settings.reference_delay / step).round() as usize
}

/// The law as a diagram.
pub fn diagram(choices: &Choices) -> Diagram {
    let mut b = Builder { d: Diagram::default(), choices: *choices };
    b.interface();
    let kinematics = b.kinematics();
    let mode = b.mode();
    let schedule = b.schedule(&kinematics, &mode);
    let turn = b.turn(&schedule);
    let commands = b.velocity_loops(&kinematics, &mode, &schedule, &turn);
    let references = b.command_models(&kinematics, &mode, &schedule, &turn, &commands);
    let errors = b.errors(&kinematics, &mode, &references);
    let ideal = b.reference_model(&kinematics, &mode, &schedule, &turn, &references);
    let wanted = b.accelerations(mode.fresh, &errors, &ideal, &references);
    b.inversion(&errors, &ideal, &wanted);
    b.finish()
}

struct Builder {
    d: Diagram,
    choices: Choices,
}

/// What is measured, and what follows from it.
struct Kinematics {
    cos_phi: Wire,
    cos_theta: Wire,
    /// V_z, V_x, V_y.
    down: Wire,
    ground: [Wire; 2],
    phi_rate: Wire,
    theta_rate: Wire,
    heading_rate: Wire,
    wind: Wire,
    air: [Wire; 3],
}

struct Mode {
    fresh: Wire,
    velocity: Wire,
    entered: Wire,
}

struct Schedule {
    /// Velocities of the reference at the end of their delay.
    due: [Wire; 2],
    /// Those less the velocities flown, as the gains see them.
    off: [Wire; 2],
}

struct Turn {
    blend: Wire,
    coordinated: Wire,
}

struct Commands {
    attitude: [Wire; 2],
    velocity: [Wire; 2],
}

struct References {
    axes: [Model; 4],
    velocity: [Model; 2],
}

struct Errors {
    errors: [Wire; 4],
    rates: [Wire; 2],
    integrals: [Wire; 4],
}

struct Ideal {
    /// x_ref.
    reference: [Wire; 8],
    /// x − x_ref with velocities times κ; without feed-forward x so.
    off: [Wire; 8],
}

struct Wanted {
    commanded: [Wire; 4],
    nu: [Wire; 4],
    /// Memory and input of the notch filters.
    followers: [Option<[Wire; 2]>; 4],
}

const DIRECTIONS: [(&str, &str); 2] =
    [("v_x", "velocity forward"), ("v_y", "velocity to the right")];

impl Builder {
    fn w(&self, name: &str) -> Wire {
        // A name that is not there is a mistake of this file; a test builds
        // every variant.
        self.d.find(name).unwrap_or(Wire(usize::MAX))
    }

    /// An entry of a table at the speed of the schedule.
    fn entry(&mut self, table: &str, row: &str, column: &str) -> Wire {
        let name = if column == "value" {
            format!("{table}_{row}")
        } else {
            format!("{table}_{row}_{column}")
        };
        if let Some(wire) = self.d.find(&name) {
            return wire;
        }
        let place = tables::place(table, row, column).unwrap_or(usize::MAX);
        self.d.add(&name, "", "", Kind::Entry(place))
    }

    fn constant(&mut self, name: &str, unit: &'static str, comment: &str, value: f64) -> Wire {
        match self.d.find(name) {
            Some(wire) => wire,
            None => self.d.constant(name, unit, comment, value),
        }
    }

    fn port(&self, name: &str) -> Option<Term> {
        self.d.find(name).map(|w| -w)
    }

    /// A row of a table times wires that are named after its columns.
    fn row(&mut self, table: &str, row: &str, columns: &[&str], x: &[Wire]) -> Vec<Term> {
        columns
            .iter()
            .zip(x)
            .map(|(column, x)| {
                let entry = self.entry(table, row, column);
                term(&[entry, *x])
            })
            .collect()
    }

    fn interface(&mut self) {
        let c = self.choices;
        self.d.group("inputs", "What is measured and what is demanded.");
        for (name, unit, meaning) in MEASUREMENTS {
            self.d.input(name, unit, meaning);
        }
        for (k, (name, unit, meaning)) in DEMANDS.into_iter().enumerate() {
            let kind = if k == 0 { Kind::Switch } else { Kind::Input };
            self.d.add(name, unit, meaning, kind);
        }
        if c.engage {
            for (k, (name, unit, meaning)) in ENGAGEMENT.into_iter().enumerate() {
                let kind = if k == 0 { Kind::Switch } else { Kind::Input };
                self.d.add(name, unit, meaning, kind);
            }
        }
        if c.ports {
            for (name, unit, meaning) in PORTS {
                self.d.input(name, unit, meaning);
            }
        }
        let step = self.d.constant("step", "s", "interval between steps", c.step);
        self.d.step = Some(step);
        self.constant("gravity", "m/s^2", "standard gravity", GRAVITY);
    }

    fn kinematics(&mut self) -> Kinematics {
        let [u, v, w, p, q, r, phi, theta, airspeed] =
            MEASUREMENTS.map(|(name, _, _)| self.w(name));
        let d = &mut self.d;
        d.group(
            "kinematics",
            "Velocities over the ground, rates of the attitudes, and the wind along the heading.",
        );
        let sp = d.function("sin_phi", "of the bank angle", Function::Sine, phi);
        let cp = d.function("cos_phi", "of the bank angle", Function::Cosine, phi);
        let st = d.function("sin_theta", "of the pitch angle", Function::Sine, theta);
        let ct = d.function("cos_theta", "of the pitch angle", Function::Cosine, theta);
        let lifted = d.sum(
            "lifted",
            "m/s",
            "v and w in the vertical plane",
            &[term(&[v, sp]), term(&[w, cp])],
        );
        let down = d.sum(
            "v_z",
            "m/s",
            "vertical velocity, down positive",
            &[term(&[lifted, ct]), -term(&[u, st])],
        );
        let forward = d.sum(
            "v_x",
            "m/s",
            "velocity over the ground forward, heading axes",
            &[term(&[u, ct]), term(&[lifted, st])],
        );
        let right = d.sum(
            "v_y",
            "m/s",
            "velocity over the ground to the right, heading axes",
            &[term(&[v, cp]), -term(&[w, sp])],
        );
        let across = d.sum(
            "turning",
            "rad/s",
            "q and r about the axis that bank has tilted",
            &[term(&[q, sp]), term(&[r, cp])],
        );
        let heading_rate =
            d.over("heading_rate_flown", "rad/s", "rate of turn that is flown", (across, ct));
        let tan = d.over("tan_theta", "1", "of the pitch angle", (st, ct));
        let phi_rate =
            d.sum("phi_rate", "rad/s", "rate of bank", &[p.into(), term(&[tan, across])]);
        let theta_rate =
            d.sum("theta_rate", "rad/s", "rate of pitch", &[term(&[q, cp]), -term(&[r, sp])]);
        let wind = d.sum(
            "wind",
            "m/s",
            "airspeed beyond the velocity over the ground",
            &[airspeed.into(), -forward],
        );
        let air = [
            d.sum("air_u", "m/s", "u through the air", &[u.into(), term(&[wind, ct])]),
            d.sum("air_v", "m/s", "v through the air", &[v.into(), term(&[wind, st, sp])]),
            d.sum("air_w", "m/s", "w through the air", &[w.into(), term(&[wind, st, cp])]),
        ];
        Kinematics {
            cos_phi: cp,
            cos_theta: ct,
            down,
            ground: [forward, right],
            phi_rate,
            theta_rate,
            heading_rate,
            wind,
            air,
        }
    }

    fn mode(&mut self) -> Mode {
        let velocity = self.w("velocity_mode");
        let d = &mut self.d;
        d.group(
            "start and mode",
            "The first step starts every memory from what is measured; entering the velocity mode \
             starts those of the velocities.",
        );
        let (zero, half, one) = (d.number(0.0), d.number(0.5), d.number(1.0));
        let started = d.memory("started", "1", "1 after the first step", None);
        d.store(started, one, None);
        let fresh = d.add("fresh", "1", "whether the law starts", Kind::Above(half, started));
        let before = d.memory("velocity_mode_before", "1", "the mode of the last step", None);
        let after = d.select("mode_to_keep", "1", "1 in the velocity mode", velocity, [one, zero]);
        d.store(before, after, None);
        let was = d.add("was_velocity", "1", "the last step's mode", Kind::Above(before, half));
        let new = d.add("is_new", "1", "the mode is not the last step's", Kind::Not(was));
        let entering =
            d.add("entering", "1", "the velocity mode begins", Kind::All(vec![velocity, new]));
        let entered = d.add(
            "entered",
            "1",
            "velocity references begin anew",
            Kind::Any(vec![fresh, entering]),
        );
        Mode { fresh, velocity, entered }
    }

    fn schedule(&mut self, k: &Kinematics, mode: &Mode) -> Schedule {
        let airspeed = self.w("airspeed");
        let bound =
            self.constant("schedule_lead", "m/s", "farthest lead of the schedule", SCHEDULE_LEAD);
        let ports = [self.port("port_v_x"), self.port("port_v_y")];
        // One step at least: this step's references come later.
        let steps = self.choices.delay_steps.max(1);
        let d = &mut self.d;
        d.group(
            "speed of the schedule",
            "Under a velocity demand the tables are read at the speed of the reference, which no \
             gust moves.",
        );
        let zero = d.number(0.0);
        let due = [0, 1].map(|i| {
            let (name, of) = DIRECTIONS[i];
            let comment = format!("reference of {of} at the end of its delay");
            d.delay(&format!("due_{name}"), "m/s", &comment, steps, (mode.entered, k.ground[i]))
        });
        let clean = [0, 1].map(|i| {
            let (name, of) = DIRECTIONS[i];
            let terms = [due[i].into(), -k.ground[i]];
            d.sum(&format!("off_{name}"), "m/s", &format!("reference less {of}"), &terms)
        });
        let minus = d.sum("schedule_lead_down", "m/s", "the same, downward", &[-bound]);
        let held = d.limit("lead_held", "m/s", "lead within its bounds", clean[0], [minus, bound]);
        let lead = d.select("lead", "m/s", "lead of the schedule", mode.velocity, [held, zero]);
        let ahead =
            d.sum("speed_ahead", "m/s", "airspeed and lead", &[airspeed.into(), lead.into()]);
        let schedule =
            d.add("schedule", "m/s", "speed at which tables are read", Kind::Maximum(ahead, zero));
        d.schedule = Some(schedule);
        let off = [0, 1].map(|i| {
            let name = DIRECTIONS[i].0;
            match &ports[i] {
                Some(port) => d.sum(
                    &format!("seen_{name}"),
                    "m/s",
                    "the same with the port",
                    &[clean[i].into(), port.clone()],
                ),
                None => clean[i],
            }
        });
        Schedule { due, off }
    }

    fn turn(&mut self, _schedule: &Schedule) -> Turn {
        let TurnCoordination { speed, width } = self.choices.turn;
        let (airspeed, heading_rate) = (self.w("airspeed"), self.w("heading_rate"));
        let gravity = self.w("gravity");
        let d = &mut self.d;
        d.group(
            "turn coordination",
            "Eq. 75: around the turn-coordination speed the bank command passes over to that of a \
             coordinated turn.",
        );
        let middle = d.constant("turn_coordination_speed", "m/s", "middle of the blend", speed);
        let width = d.constant("turn_coordination_width", "m/s", "full width of the blend", width);
        let (zero, half, one) = (d.number(0.0), d.number(0.5), d.number(1.0));
        let (two, three) = (d.number(2.0), d.number(3.0));
        let beyond = d.sum(
            "beyond_turn_speed",
            "m/s",
            "airspeed less the middle",
            &[airspeed.into(), -middle],
        );
        let share = d.over("turn_share", "1", "the same in widths", (beyond, width));
        let place = d.sum("turn_place", "1", "place in the blend", &[share.into(), half.into()]);
        let t = d.limit("turn_t", "1", "the same, 0 to 1", place, [zero, one]);
        let blend = d.sum(
            "turn_blend",
            "1",
            "weight of turn coordination, with flat ends",
            &[term(&[three, t, t]), -term(&[two, t, t, t])],
        );
        let across =
            d.sum("turn_acceleration", "m/s^2", "V psi'", &[term(&[airspeed, heading_rate])]);
        let tan = d.over("turn_tangent", "1", "tangent of the bank of the turn", (across, gravity));
        let coordinated =
            d.function("bank_of_turn", "bank of a coordinated turn", Function::ArcTangent, tan);
        Turn { blend, coordinated }
    }

    /// Acceleration per attitude of the inverted model at constant height:
    /// forward per pitch down, to the right per bank. Gravity where the
    /// model's own is not positive.
    fn acceleration_per_attitude(&mut self, k: usize) -> Wire {
        let (name, _) = DIRECTIONS[k];
        let attitude = ["theta", "phi"][k];
        let states = STATES.map(|s| s.0);
        let model: [Wire; 2] = ["u", "v"].map(|column| {
            let terms: Vec<Term> = states
                .iter()
                .map(|s| {
                    let (a, b) = (
                        self.entry("ground_velocity", name, s),
                        self.entry("reference_state", s, column),
                    );
                    term(&[a, b])
                })
                .collect();
            let comment = format!("{name} per {column} of the reference model");
            self.d.sum(&format!("{name}_per_{column}"), "1", &comment, &terms)
        });
        let rates: [Wire; 2] = ["u", "v"].map(|row| {
            let terms: Vec<Term> = states
                .iter()
                .map(|s| {
                    let a = self.entry("reference_dynamics", &format!("{row}_dot"), s);
                    let b = self.entry("reference_input", s, attitude);
                    term(&[a, b])
                })
                .collect();
            let comment = format!("{row}' of the reference model per {attitude}");
            self.d.sum(&format!("{row}_dot_per_{attitude}"), "m/s^2 per rad", &comment, &terms)
        });
        let sign = |t: Term| if k == 0 { -t } else { t };
        let own = self.d.sum(
            &format!("{name}_power"),
            "m/s^2 per rad",
            "acceleration per attitude of the inverted model",
            &[sign(term(&[model[0], rates[0]])), sign(term(&[model[1], rates[1]]))],
        );
        let gravity = self.w("gravity");
        let half = self.d.number(0.5);
        let half = match self.d.find("half_gravity") {
            Some(wire) => wire,
            None => {
                self.d.sum("half_gravity", "m/s^2", "least that is used", &[term(&[half, gravity])])
            }
        };
        let sound = self.d.add(
            &format!("{name}_power_sound"),
            "1",
            "whether it can be used",
            Kind::Above(own, half),
        );
        self.d.select(
            &format!("{name}_acceleration_per_attitude"),
            "m/s^2 per rad",
            "what an attitude is worth",
            sound,
            [own, gravity],
        )
    }

    /// Integral of a velocity error when the law starts.
    fn velocity_integral_start(&mut self, k: usize) -> Wire {
        let zero = self.d.number(0.0);
        if !self.choices.engage {
            return zero;
        }
        let (name, channel) = [("v_x", "vx"), ("v_y", "vy")][k];
        let attitude = ["theta", "phi"][k];
        let (flown, trim) = (self.w(attitude), self.entry("trim_attitude", attitude, "value"));
        let (engaging, gravity) = (self.w("engaging"), self.w("gravity"));
        let k_i = self.entry("gains", channel, "k_i");
        let one = self.d.number(1.0);
        let d = &mut self.d;
        let terms = if k == 0 {
            [term(&[gravity, trim]), -term(&[gravity, flown])]
        } else {
            [term(&[gravity, flown]), -term(&[gravity, trim])]
        };
        let needed = d.sum(
            &format!("engaged_{name}_acceleration"),
            "m/s^2",
            "what the integral must ask for, so that the attitude stays",
            &terms,
        );
        let some = d.add(
            &format!("{name}_has_integral"),
            "1",
            "whether there is an integral gain",
            Kind::Above(k_i, zero),
        );
        let safe =
            d.select(&format!("{name}_k_i_safe"), "1/s^2", "the gain, or 1", some, [k_i, one]);
        let value = d.over(
            &format!("engaged_{name}_quotient"),
            "m",
            "the integral that asks for it",
            (needed, safe),
        );
        let asked = d.add(
            &format!("{name}_engages"),
            "1",
            "whether the integral is set",
            Kind::All(vec![engaging, some]),
        );
        d.select(
            &format!("{name}_integral_start"),
            "m",
            "start of the integral",
            asked,
            [value, zero],
        )
    }

    fn velocity_loops(
        &mut self,
        k: &Kinematics,
        mode: &Mode,
        schedule: &Schedule,
        turn: &Turn,
    ) -> Commands {
        let s = self.choices.settings;
        self.d.group(
            "velocity loops",
            "Translational rate command, Fig. 11: attitudes from velocities forward and to the \
             right.",
        );
        let (heading_rate, gravity) = (self.w("heading_rate"), self.w("gravity"));
        let asked = [self.w("command_1"), self.w("command_2")];
        let frequencies = [
            self.constant(
                "pitch_frequency",
                "rad/s",
                "of the pitch command model",
                s.pitch_frequency,
            ),
            self.constant("roll_frequency", "rad/s", "of the roll command model", s.roll_frequency),
        ];
        let slowness =
            self.constant("outer_slowness", "1", "of velocity references", OUTER_SLOWNESS);
        let most = self.constant(
            "acceleration_limit",
            "m/s^2",
            "of velocity references",
            ACCELERATION_LIMIT,
        );
        let limit = self.constant(
            "attitude_limit",
            "rad",
            "of what velocity loops ask for",
            ATTITUDE_LIMIT,
        );
        let forgetting = self.constant("forgetting", "s", "of the lateral integral", FORGETTING);
        let (zero, one) = (self.d.number(0.0), self.d.number(1.0));
        let least = self.d.sum("acceleration_limit_down", "m/s^2", "the same, backward", &[-most]);
        let lower = self.d.sum("attitude_limit_down", "rad", "the same, downward", &[-limit]);
        let step = self.d.time_step();
        let (mut moved, mut accelerations) = ([zero; 2], [zero; 2]);
        for i in 0..2 {
            let (name, of) = DIRECTIONS[i];
            let d = &mut self.d;
            let last = d.memory(
                &format!("last_{name}_command"),
                "m/s",
                &format!("lag of the {of} demanded, at the last step"),
                Some((mode.entered, k.ground[i])),
            );
            let rest = d.memory(
                &format!("{name}_rest"),
                "m/s",
                "what rounding has left out of it so far",
                Some((mode.entered, zero)),
            );
            let away =
                d.sum(&format!("{name}_away"), "m/s", "demand less lag", &[asked[i].into(), -last]);
            let quick = d.sum(
                &format!("{name}_quick"),
                "m/s^2",
                "first-order lag",
                &[term(&[away, frequencies[i]])],
            );
            let slow =
                d.over(&format!("{name}_slow"), "m/s^2", "slower than attitude", (quick, slowness));
            let within = d.limit(
                &format!("{name}_within"),
                "m/s^2",
                "within its limits",
                slow,
                [least, most],
            );
            let acceleration = d.select(
                &format!("{name}_acceleration"),
                "m/s^2",
                "acceleration of the lag; it stands still under an attitude demand",
                mode.velocity,
                [within, zero],
            );
            // Summed without what rounding takes (Kahan), so that single
            // precision serves.
            let change = d.sum(
                &format!("{name}_change"),
                "m/s",
                "change of the lag in this step",
                &[term(&[step, acceleration]), rest.into()],
            );
            let now = d.sum(
                &format!("{name}_command"),
                "m/s",
                &format!("lag of the {of} demanded"),
                &[last.into(), change.into()],
            );
            let taken = d.sum(
                &format!("{name}_taken"),
                "m/s",
                "change that the sum has taken",
                &[now.into(), -last],
            );
            let left = d.sum(
                &format!("{name}_left"),
                "m/s",
                "what rounding has left out",
                &[change.into(), -taken],
            );
            d.store(last, now, Some(acceleration));
            d.store(rest, left, None);
            moved[i] = now;
            accelerations[i] = acceleration;
        }
        let mut limited = [zero; 2];
        for i in 0..2 {
            let (name, of) = DIRECTIONS[i];
            let channel = ["vx", "vy"][i];
            let [k_p, k_i] = ["k_p", "k_i"].map(|g| self.entry("gains", channel, g));
            let worth = self.acceleration_per_attitude(i);
            let start = self.velocity_integral_start(i);
            let error = schedule.off[i];
            let d = &mut self.d;
            let integral = d.memory(
                &format!("{name}_integral"),
                "m",
                &format!("integral of the error of {of}"),
                Some((mode.entered, start)),
            );
            let ahead = d.over(
                &format!("{name}_ahead"),
                "rad",
                "attitude for the acceleration of the lag",
                (accelerations[i], worth),
            );
            let pulled = d.sum(
                &format!("{name}_pulled"),
                "m/s^2",
                "PI control of the velocity",
                &[term(&[k_p, error]), term(&[k_i, integral])],
            );
            let held = d.over(&format!("{name}_hold"), "rad", "attitude for it", (pulled, gravity));
            let mut terms: Vec<Term> = vec![ahead.into(), held.into()];
            if i == 1 {
                let across = d.sum(
                    "heading_axes_turn",
                    "m/s^2",
                    "V_x psi': heading axes turn",
                    &[term(&[moved[0], heading_rate])],
                );
                let tan =
                    d.over("heading_axes_tangent", "1", "the same over gravity", (across, gravity));
                let bank =
                    d.function("bank_to_hold", "bank that holds V_y", Function::ArcTangent, tan);
                terms.push(bank.into());
            }
            let raw = d.sum(
                &format!("{name}_attitude"),
                "rad",
                "attitude asked for, from the trim",
                &terms,
            );
            limited[i] = d.limit(
                &format!("{name}_attitude_limited"),
                "rad",
                "the same within its limits",
                raw,
                [lower, limit],
            );
            // Anti-windup: the integral holds while the limit is reached.
            let size = d.add(
                &format!("{name}_attitude_size"),
                "rad",
                "its size",
                Kind::Function(Function::Absolute, raw),
            );
            let beyond = d.add(
                &format!("{name}_beyond"),
                "1",
                "whether it is beyond its limit",
                Kind::Above(size, limit),
            );
            let push = d.sum(
                &format!("{name}_push"),
                "rad m/s",
                "positive where the error pushes it further",
                &[term(&[raw, error])],
            );
            let pushed =
                d.add(&format!("{name}_pushed"), "1", "whether it does", Kind::Above(push, zero));
            let windup = d.add(
                &format!("{name}_windup"),
                "1",
                "whether the integral must hold",
                Kind::All(vec![beyond, pushed]),
            );
            let grows = d.select(
                &format!("{name}_grows"),
                "m/s",
                "what it integrates",
                windup,
                [zero, error],
            );
            let mut rate = grows;
            if i == 1 {
                // Where turn coordination has the bank, the integral has
                // nothing to do and is forgotten.
                let keep = d.sum(
                    "v_y_share",
                    "1",
                    "share of the lateral loop",
                    &[one.into(), -turn.blend],
                );
                let shared =
                    d.sum("v_y_shared", "m/s", "what is integrated of it", &[term(&[keep, grows])]);
                let grown = d.sum(
                    "v_y_grown",
                    "m",
                    "integral before it is forgotten",
                    &[integral.into(), term(&[step, shared])],
                );
                let fading =
                    d.over("v_y_fading", "1/s", "rate of forgetting", (turn.blend, forgetting));
                rate = d.sum(
                    "v_y_integral_rate",
                    "m/s",
                    "rate of the integral",
                    &[shared.into(), -term(&[fading, grown])],
                );
            }
            let rate = d.select(
                &format!("{name}_integral_running"),
                "m/s",
                "the integral stands still under an attitude demand",
                mode.velocity,
                [rate, zero],
            );
            d.integrate(
                integral,
                &format!("{name}_integral_now"),
                "the integral after this step",
                rate,
            );
        }
        // Bank and pitch.
        let [trim_phi, trim_theta] =
            ["phi", "theta"].map(|a| self.entry("trim_attitude", a, "value"));
        let ports =
            [self.port("port_phi_command"), self.port("port_theta_command")].map(|p| p.map(|t| -t));
        let d = &mut self.d;
        let phi = d.sum("phi_of_v_y", "rad", "bank for V_y", &[trim_phi.into(), limited[1].into()]);
        let theta =
            d.sum("theta_of_v_x", "rad", "pitch for V_x", &[trim_theta.into(), -limited[0]]);
        let phi = d.select("phi_asked", "rad", "bank asked for", mode.velocity, [phi, asked[0]]);
        let turned = d.sum(
            "phi_of_turn",
            "rad",
            "bank of a turn",
            &[trim_phi.into(), turn.coordinated.into()],
        );
        let mut phi =
            d.blend("phi_command", "rad", "Eq. 75: command of bank", turn.blend, [phi, turned]);
        let mut theta =
            d.select("theta_command", "rad", "command of pitch", mode.velocity, [theta, asked[1]]);
        let [phi_port, theta_port] = ports;
        if let Some(port) = phi_port {
            phi = d.sum("phi_command_port", "rad", "the same with the port", &[phi.into(), port]);
        }
        if let Some(port) = theta_port {
            theta =
                d.sum("theta_command_port", "rad", "the same with the port", &[theta.into(), port]);
        }
        Commands { attitude: [phi, theta], velocity: moved }
    }

    fn command_models(
        &mut self,
        k: &Kinematics,
        mode: &Mode,
        schedule: &Schedule,
        turn: &Turn,
        commands: &Commands,
    ) -> References {
        let s = self.choices.settings;
        self.d.group(
            "command models",
            "What the aircraft is to do of a command: second order in the attitudes, first order \
             in yaw rate and vertical velocity.",
        );
        let [phi, theta, r, airspeed, heading_rate, v_z_command] =
            ["phi", "theta", "r", "airspeed", "heading_rate", "v_z_command"].map(|n| self.w(n));
        let damping = self.constant(
            "attitude_damping",
            "1",
            "of the attitude command models",
            s.attitude_damping,
        );
        let yaw_constant = self.constant(
            "yaw_time_constant",
            "s",
            "of the yaw command model",
            s.yaw_time_constant,
        );
        let heave_constant = self.constant(
            "heave_time_constant",
            "s",
            "of the vertical velocity's command model",
            s.heave_time_constant,
        );
        let yaw_lead = self.constant("yaw_lead", "1", "of yaw with bank", YAW_LEAD);
        let slow = self.constant("slow", "m/s", "where rolling asks for no yaw", SLOW);
        let [roll, pitch] = ["roll_frequency", "pitch_frequency"].map(|n| self.w(n));
        let middle = self.w("turn_coordination_speed");
        let [trim_u, trim_w] = ["u", "w"].map(|a| self.entry("trim_velocity", a, "value"));
        let angle = ["rad", "rad/s", "rad/s^2"];
        let speed = ["m/s", "m/s^2", "m/s^3"];
        let d = &mut self.d;
        let (zero, one) = (d.number(0.0), d.number(1.0));
        let at = |at: Wire| Restart { when: mode.fresh, at };
        let bank = d.second_order(
            Label { name: "phi", of: "bank", units: angle },
            commands.attitude[0],
            [roll, damping],
            at(phi),
            None,
        );
        let nose = d.second_order(
            Label { name: "theta", of: "pitch", units: angle },
            commands.attitude[1],
            [pitch, damping],
            at(theta),
            None,
        );
        // What the aircraft can do of a velocity: the attitude command model
        // stands between.
        let velocity = [0, 1].map(|i| {
            let (name, of) = DIRECTIONS[i];
            d.second_order(
                Label { name, of, units: speed },
                commands.velocity[i],
                [[pitch, roll][i], damping],
                Restart { when: mode.entered, at: k.ground[i] },
                Some(mode.velocity),
            )
        });
        for (line, model) in schedule.due.into_iter().zip(&velocity) {
            d.feed(line, model.value);
        }
        // The heading turns no sooner than the bank that must go with it.
        let turning = d.second_order(
            Label {
                name: "turn",
                of: "rate of turn, as bank can follow it",
                units: ["rad/s", "rad/s^2", "rad/s^3"],
            },
            heading_rate,
            [roll, damping],
            at(k.heading_rate),
            None,
        );
        let fast =
            d.sum("yaw_lead_speed", "m/s", "airspeed by the lead", &[term(&[yaw_lead, airspeed])]);
        let share =
            d.over("yaw_lead_share", "1", "over the turn-coordination speed", (fast, middle));
        let together = d.limit("together", "1", "how far yaw waits for bank", share, [zero, one]);
        let led = d.sum(
            "heading_rate_led",
            "rad/s",
            "rate of turn with the yaw model's own lag made up for",
            &[turning.value.into(), term(&[yaw_constant, turning.rate])],
        );
        let turned =
            d.blend("heading_rate_asked", "rad/s", "rate of turn", together, [heading_rate, led]);
        // In a coordinated turn the aircraft rolls about its flight path: to
        // keep v at zero, rolling with w asks for yaw, p w = r u.
        let flies = d.add("flies_forward", "1", "whether it flies", Kind::Above(trim_u, slow));
        let safe =
            d.add("trim_u_safe", "m/s", "u of the trim, not small", Kind::Maximum(trim_u, slow));
        let blended =
            d.sum("w_share", "m/s", "w of the trim by the blend", &[term(&[turn.blend, trim_w])]);
        let ratio = d.over("w_over_u", "1", "the same over u", (blended, safe));
        let slope =
            d.select("yaw_per_roll", "1", "yaw that rolling asks for", flies, [ratio, zero]);
        let rolling = d.sum(
            "rolling",
            "rad/s",
            "rate of bank with the yaw model's own lag made up for",
            &[bank.rate.into(), term(&[yaw_constant, bank.acceleration])],
        );
        let yaw = d.sum(
            "r_command",
            "rad/s",
            "rate of turn in body axes, and yaw for rolling",
            &[term(&[turned, k.cos_phi, k.cos_theta]), term(&[slope, rolling])],
        );
        let yaw = d.first_order(
            Label { name: "r", of: "yaw rate", units: ["rad/s", "rad/s^2", ""] },
            yaw,
            yaw_constant,
            at(r),
        );
        let heave = d.first_order(
            Label { name: "v_z", of: "vertical velocity", units: ["m/s", "m/s^2", ""] },
            v_z_command,
            heave_constant,
            at(k.down),
        );
        References { axes: [bank, nose, yaw, heave], velocity }
    }

    fn errors(&mut self, k: &Kinematics, mode: &Mode, references: &References) -> Errors {
        let steps = self.choices.delay_steps;
        let [phi, theta, r] = ["phi", "theta", "r"].map(|n| self.w(n));
        let ports = ["port_phi", "port_theta", "port_r", "port_v_z"].map(|n| self.port(n));
        let rate_ports = ["port_phi_rate", "port_theta_rate"].map(|n| self.port(n));
        self.d.group(
            "errors",
            "References, as late as hardware and rotors are, less what is measured; and the \
             integrals of that.",
        );
        let d = &mut self.d;
        let zero = d.number(0.0);
        let measured = [phi, theta, r, k.down];
        let rates = [k.phi_rate, k.theta_rate];
        let units = ["rad", "rad", "rad/s", "m/s"];
        let late = |d: &mut Diagram, name: &str, unit, start: Wire, input: Wire| {
            let name = format!("delayed_{name}");
            if steps == 0 {
                return d.sum(&name, unit, "reference", &[input.into()]);
            }
            let line = d.delay(&name, unit, "reference, delayed", steps, (mode.fresh, start));
            d.feed(line, input);
            line
        };
        let errors = std::array::from_fn(|i| {
            let (name, _, _) = AXES[i];
            let delayed = late(d, name, units[i], measured[i], references.axes[i].value);
            let mut terms: Vec<Term> = vec![delayed.into(), -measured[i]];
            terms.extend(ports[i].clone());
            d.sum(&format!("{name}_error"), units[i], "reference less what is measured", &terms)
        });
        let rate_errors = std::array::from_fn(|i| {
            let (name, _, _) = AXES[i];
            let delayed = late(d, &format!("{name}_rate"), "rad/s", zero, references.axes[i].rate);
            let mut terms: Vec<Term> = vec![delayed.into(), -rates[i]];
            terms.extend(rate_ports[i].clone());
            d.sum(&format!("{name}_rate_error"), "rad/s", "the same of the rate", &terms)
        });
        let integrals = std::array::from_fn(|i| {
            let (name, _, _) = AXES[i];
            let unit = ["rad s", "rad s", "rad", "m"][i];
            d.memory(
                &format!("{name}_integral"),
                unit,
                "integral of the error",
                Some((mode.fresh, zero)),
            )
        });
        Errors { errors, rates: rate_errors, integrals }
    }

    fn reference_model(
        &mut self,
        k: &Kinematics,
        mode: &Mode,
        _schedule: &Schedule,
        turn: &Turn,
        references: &References,
    ) -> Ideal {
        let s = self.choices.settings;
        self.d.group(
            "reference model",
            "What the states are while the references are followed: u and v have dynamics of their \
             own, the rest follows from the references by kinematics. Under a velocity demand the \
             velocities are known from their references.",
        );
        let trim: [Wire; 3] = ["u", "v", "w"].map(|a| self.entry("trim_velocity", a, "value"));
        let [trim_phi, trim_theta] =
            ["phi", "theta"].map(|a| self.entry("trim_attitude", a, "value"));
        let kappa = self.constant(
            "kappa",
            "1",
            "share of the velocity terms cancelled by feedback",
            s.kappa,
        );
        let [bank, nose, yaw, heave] = references.axes;
        let d = &mut self.d;
        let rho_phi = d.sum(
            "rho_phi",
            "rad",
            "bank of the reference, from the trim",
            &[bank.value.into(), -trim_phi],
        );
        let rho_theta = d.sum(
            "rho_theta",
            "rad",
            "pitch of the reference, from the trim",
            &[nose.value.into(), -trim_theta],
        );
        let rho = [rho_phi, rho_theta, bank.rate, nose.rate, yaw.value, heave.value];
        let stored: [Wire; 2] = std::array::from_fn(|i| {
            let name = ["u", "v"][i];
            d.memory(
                &format!("model_air_{name}"),
                "m/s",
                &format!("{name} of the reference model, through the air"),
                Some((mode.fresh, k.air[i])),
            )
        });
        let model: [Wire; 2] = std::array::from_fn(|i| {
            let name = ["u", "v"][i];
            d.sum(
                &format!("model_{name}"),
                "m/s",
                &format!("{name} of the reference model, from the trim"),
                &[stored[i].into(), -trim[i]],
            )
        });
        // Exact kinematics: in a turn the aircraft also pitches and rolls.
        let sr = d.function("sin_phi_ref", "of the reference's bank", Function::Sine, bank.value);
        let cr = d.function("cos_phi_ref", "of the reference's bank", Function::Cosine, bank.value);
        let sp =
            d.function("sin_theta_ref", "of the reference's pitch", Function::Sine, nose.value);
        let cp =
            d.function("cos_theta_ref", "of the reference's pitch", Function::Cosine, nose.value);
        let about = d.sum(
            "turn_about",
            "rad/s",
            "yaw and pitch that make the turn",
            &[yaw.value.into(), term(&[nose.rate, sr])],
        );
        let level = d.sum("level", "1", "share of level axes", &[term(&[cp, cr])]);
        let turning =
            d.over("turn_of_reference", "rad/s", "rate of turn of the reference", (about, level));
        let p = d.sum(
            "p_ideal",
            "rad/s",
            "p of the reference model",
            &[bank.rate.into(), -term(&[turning, sp])],
        );
        let q = d.sum(
            "q_ideal",
            "rad/s",
            "q of the reference model",
            &[term(&[nose.rate, cr]), term(&[turning, cp, sr])],
        );
        let along = d.sum(
            "along_ref",
            "m/s",
            "velocity forward of the reference, through the air",
            &[references.velocity[0].value.into(), k.wind.into()],
        );
        let lifted = d.sum(
            "lifted_ref",
            "m/s",
            "the same in the vertical plane",
            &[term(&[along, sp]), term(&[heave.value, cp])],
        );
        let tan = d.over("tan_phi_ref", "1", "of the reference's bank", (sr, cr));
        let none = d.sum(
            "v_y_without_v",
            "m/s",
            "a coordinated turn leaves no v",
            &[-term(&[lifted, tan])],
        );
        let across = d.blend(
            "across_ref",
            "m/s",
            "velocity to the right of the reference",
            turn.blend,
            [references.velocity[1].value, none],
        );
        let known = [
            d.sum(
                "u_known",
                "m/s",
                "u of the velocity references",
                &[term(&[along, cp]), -term(&[heave.value, sp])],
            ),
            d.sum(
                "v_known",
                "m/s",
                "v of the velocity references",
                &[term(&[across, cr]), term(&[lifted, sr])],
            ),
            d.sum(
                "w_known",
                "m/s",
                "w of the velocity references",
                &[term(&[lifted, cr]), -term(&[across, sr])],
            ),
        ];
        let columns = ["phi", "theta", "phi_dot", "theta_dot", "r", "v_z"];
        let linear = |b: &mut Self, state: &str| {
            let mut terms = b.row("reference_state", state, &["u", "v"], &model);
            terms.extend(b.row("reference_input", state, &columns, &rho));
            terms
        };
        let mut reference = [p; 8];
        for (i, state) in ["u", "v", "w"].into_iter().enumerate() {
            let terms = linear(self, state);
            let d = &mut self.d;
            let free = d.sum(
                &format!("{state}_free"),
                "m/s",
                "of the model's own dynamics, from the trim",
                &terms,
            );
            let given = d.sum(
                &format!("{state}_given"),
                "m/s",
                "of the velocity references, from the trim",
                &[known[i].into(), -trim[i]],
            );
            reference[i] = d.select(
                &format!("{state}_ideal"),
                "m/s",
                &format!("{state} of the reference model, from the trim"),
                mode.velocity,
                [given, free],
            );
        }
        (reference[3], reference[4], reference[5]) = (p, q, yaw.value);
        for (i, state) in ["phi", "theta"].into_iter().enumerate() {
            let terms = linear(self, state);
            reference[6 + i] = self.d.sum(
                &format!("{state}_ideal"),
                "rad",
                &format!("{state} of the reference model, from the trim"),
                &terms,
            );
        }
        let states = STATES.map(|s| s.0);
        let nu = NU.map(|s| s.0);
        let feed = [bank.acceleration, nose.acceleration, yaw.rate, heave.rate];
        for (i, name) in ["u", "v"].into_iter().enumerate() {
            let row = format!("{name}_dot");
            let mut terms = self.row("reference_dynamics", &row, &states, &reference);
            terms.extend(self.row("reference_drive", &row, &nu, &feed));
            let d = &mut self.d;
            let step = d.time_step();
            let rate = d.sum(&format!("model_{row}"), "m/s^2", "its rate", &terms);
            let moved = d.sum(
                &format!("model_{name}_moved"),
                "m/s",
                "after this step",
                &[stored[i].into(), term(&[step, rate])],
            );
            let next = d.select(
                &format!("model_{name}_now"),
                "m/s",
                "after this step; under a velocity demand, what is known",
                mode.velocity,
                [known[i], moved],
            );
            d.store(stored[i], next, Some(rate));
        }
        // x, and what feedback must answer for.
        let measured: [Wire; 5] = ["p", "q", "r", "phi", "theta"].map(|n| self.w(n));
        let mut deviation = [p; 8];
        let d = &mut self.d;
        for i in 0..3 {
            let name = states[i];
            deviation[i] = d.sum(
                &format!("{name}_off"),
                "m/s",
                &format!("{name} through the air, from the trim"),
                &[k.air[i].into(), -trim[i]],
            );
        }
        deviation[3..6].copy_from_slice(&measured[..3]);
        deviation[6] =
            d.sum("phi_off", "rad", "bank, from the trim", &[measured[3].into(), -trim_phi]);
        deviation[7] =
            d.sum("theta_off", "rad", "pitch, from the trim", &[measured[4].into(), -trim_theta]);
        let off = std::array::from_fn(|i| {
            let (name, unit) = STATES[i];
            let scale = |w: Wire| if i < 3 { term(&[kappa, w]) } else { w.into() };
            let mut terms = vec![scale(deviation[i])];
            if s.hybrid_feedforward {
                terms.push(-scale(reference[i]));
            }
            let comment = if i < 3 {
                "share of the deviation that feedback answers for"
            } else {
                "deviation that feedback answers for"
            };
            d.sum(&format!("{name}_answered"), unit, comment, &terms)
        });
        Ideal { reference, off }
    }

    fn accelerations(
        &mut self,
        fresh: Wire,
        e: &Errors,
        ideal: &Ideal,
        references: &References,
    ) -> Wanted {
        let s = self.choices.settings;
        self.d.group(
            "accelerations",
            "What is asked of phi'', theta'', r' and V_z': by the commands, and by feedback.",
        );
        let states = STATES.map(|s| s.0);
        let [bank, nose, yaw, heave] = references.axes;
        let feed = [bank.acceleration, nose.acceleration, yaw.rate, heave.rate];
        let mut commanded = feed;
        let mut wanted = feed;
        let mut followers = [None; 4];
        for i in 0..4 {
            let (name, channel, _) = AXES[i];
            let (row, unit) = NU[i];
            if s.hybrid_feedforward {
                let mut terms: Vec<Term> = vec![feed[i].into()];
                let f = self.row("feedback", row, &states, &ideal.reference);
                terms.extend(f.into_iter().map(|t| -t));
                commanded[i] = self.d.sum(
                    &format!("{name}_commanded"),
                    unit,
                    "nu_c - F x_ref: what the commands ask for",
                    &terms,
                );
            }
            let mut terms = Vec::new();
            if i < 2 {
                let k_d = self.entry("gains", channel, "k_d");
                terms.push(term(&[k_d, e.rates[i]]));
            }
            let [k_p, k_i] = ["k_p", "k_i"].map(|g| self.entry("gains", channel, g));
            let mut held = e.integrals[i];
            if i == 2
                && let Some(port) = self.port("port_heading")
            {
                // What is held is the integral of the output.
                held = self.d.sum(
                    "r_integral_port",
                    "rad",
                    "the integral with the port",
                    &[held.into(), port],
                );
            }
            terms.push(term(&[k_p, e.errors[i]]));
            terms.push(term(&[k_i, held]));
            let f = self.row("feedback", row, &states, &ideal.off);
            terms.extend(f.into_iter().map(|t| -t));
            wanted[i] = self.d.sum(
                &format!("{name}_feedback"),
                unit,
                "nu_e - F_k (x - x_ref): what feedback asks for",
                &terms,
            );
            if let Some(notch) = s.notch.axes()[i] {
                let asked = wanted[i];
                let wires = [
                    ("frequency", "rad/s", "frequency that the notch takes out", notch.frequency),
                    ("damping", "1", "damping ratio of the notch", notch.damping),
                    ("depth", "1", "factor with which its frequency passes", notch.depth),
                ]
                .map(|(what, unit, comment, value)| {
                    self.constant(&format!("notch_{channel}_{what}"), unit, comment, value)
                });
                let of = format!("what feedback asks for in {channel}");
                let rate = ["rad/s^3", "rad/s^3", "rad/s^3", "m/s^3"][i];
                let acceleration = ["rad/s^4", "rad/s^4", "rad/s^4", "m/s^4"][i];
                let label = Label { name, of: &of, units: [unit, rate, acceleration] };
                let out = self.d.notch(label, asked, wires, fresh);
                wanted[i] = out.output;
                followers[i] = Some([out.follower, asked]);
            }
        }
        Wanted { commanded, nu: wanted, followers }
    }

    fn pedal_power(&mut self, name: &str, collective: Wire) -> Wire {
        let growth = self.constant(
            "pedal_yaw_growth",
            "rad/s^2 per %^2",
            "of the pedals' power over yaw with collective",
            self.choices.off_trim.pedal_yaw,
        );
        let [low, high] = PEDAL_POWER_RANGE;
        let low = self.constant("pedal_power_min", "1", "least that is reckoned with", low);
        let high = self.constant("pedal_power_max", "1", "largest that is reckoned with", high);
        let per_power = self.entry("decoupling", "ped", "r_dot");
        let one = self.d.number(1.0);
        let raw = self.d.sum(
            &format!("{name}_raw"),
            "1",
            "pedals' power over yaw, relative to the trim's",
            &[one.into(), term(&[growth, per_power, collective])],
        );
        self.d.limit(name, "1", "the same within its limits", raw, [low, high])
    }

    fn inversion(&mut self, e: &Errors, ideal: &Ideal, wanted: &Wanted) {
        let c = self.choices;
        let nu = NU.map(|s| s.0);
        let sticks = STICKS.map(|s| s.0);
        let mut commanded = wanted.commanded;
        if c.settings.hybrid_feedforward {
            self.d.group(
                "lift away from the trim",
                "Pitching moment of the lift that the references ask for, with the tail's load \
                 that goes with them. The collective grows together with the load, so that its \
                 moment has half its end value on the mean; pedals come and go with the load \
                 standing.",
            );
            let [trim_u, trim_w] = ["u", "w"].map(|a| self.entry("trim_velocity", a, "value"));
            let by_collective = self.constant(
                "collective_pitch_growth",
                "1/m^2 per %",
                "of the collective's power over pitch with u w",
                c.off_trim.collective_pitch,
            );
            let by_pedal = self.constant(
                "pedal_pitch_growth",
                "1/m^2 per %",
                "of the pedals' power over pitch with u w",
                c.off_trim.pedal_pitch,
            );
            let d = &mut self.d;
            let half = d.number(0.5);
            let u = d.sum(
                "u_total",
                "m/s",
                "u of the reference model",
                &[trim_u.into(), ideal.reference[0].into()],
            );
            let w = d.sum(
                "w_total",
                "m/s",
                "w of the reference model",
                &[trim_w.into(), ideal.reference[2].into()],
            );
            let load = d.sum(
                "load",
                "m^2/s^2",
                "u w beyond the trim's",
                &[term(&[u, w]), -term(&[trim_u, trim_w])],
            );
            let terms = self.row("decoupling", "col", &nu, &commanded);
            let collective =
                self.d.sum("col_of_commands", "%", "collective that the commands ask for", &terms);
            let terms = self.row("decoupling", "ped", &nu, &commanded);
            let pedal = self.d.sum(
                "ped_at_trim",
                "%",
                "pedals that the commands ask for, at the trim's power",
                &terms,
            );
            let power = self.pedal_power("power_of_commands", collective);
            let d = &mut self.d;
            let pedal =
                d.over("ped_of_commands", "%", "pedals that the commands ask for", (pedal, power));
            let lifting = d.sum(
                "lifting",
                "rad/s^2",
                "pitch acceleration of that lift",
                &[term(&[half, by_collective, load, collective]), term(&[by_pedal, load, pedal])],
            );
            commanded[1] = d.sum(
                "theta_commanded_less",
                "rad/s^2",
                "what the commands ask for beyond it",
                &[commanded[1].into(), -lifting],
            );
        }
        self.d.group(
            "inversion and limits",
            "Sticks for the accelerations: what is commanded through the exact inverse, what \
             feedback asks for through an allocation of its own. An integral holds while its own \
             stick is at a limit and the error would push it further.",
        );
        let mut change = [commanded[0]; 4];
        let mut limits = [[commanded[0]; 2]; 4];
        for (j, stick) in sticks.into_iter().enumerate() {
            let mut terms = self.row("decoupling", stick, &nu, &commanded);
            terms.extend(self.row("allocation", stick, &nu, &wanted.nu));
            change[j] = self.d.sum(&format!("{stick}_change"), "%", "stick, from the trim", &terms);
            let [low, high] = c.limits[j];
            limits[j] = [
                self.constant(&format!("stick_{stick}_min"), "%", "lower limit", low),
                self.constant(&format!("stick_{stick}_max"), "%", "upper limit", high),
            ];
        }
        let trim: [Wire; 4] = sticks.map(|s| self.entry("trim_sticks", s, "value"));
        let (col, ped) = (2, 3);
        let d = &mut self.d;
        let asked = d.sum(
            "col_asked",
            "%",
            "collective before limits",
            &[trim[col].into(), change[col].into()],
        );
        let held = d.limit("col_held", "%", "collective within limits", asked, limits[col]);
        let moved = d.sum("col_moved", "%", "the same, from the trim", &[held.into(), -trim[col]]);
        let power = self.pedal_power("power_of_pedals", moved);
        let d = &mut self.d;
        change[ped] =
            d.over("ped_powered", "%", "pedals at the power that they have", (change[ped], power));
        let mut wanted_sticks = change;
        let mut answer = change;
        for j in 0..4 {
            let stick = sticks[j];
            wanted_sticks[j] = if j == col {
                asked
            } else {
                d.sum(
                    &format!("{stick}_asked"),
                    "%",
                    "stick before limits",
                    &[trim[j].into(), change[j].into()],
                )
            };
            answer[j] = if j == col {
                held
            } else {
                d.limit(
                    &format!("{stick}_held"),
                    "%",
                    "stick within limits",
                    wanted_sticks[j],
                    limits[j],
                )
            };
        }
        d.outputs = answer.to_vec();
        for i in 0..4 {
            let (name, _, stick) = AXES[i];
            let allocation = self.entry("allocation", sticks[stick], nu[i]);
            let d = &mut self.d;
            let zero = d.number(0.0);
            let [low, high] = limits[stick];
            let asked = wanted_sticks[stick];
            let push = d.sum(
                &format!("{name}_push"),
                "%",
                "how the error pushes the stick",
                &[term(&[allocation, e.errors[i]])],
            );
            let names = ["over", "up", "under", "down", "high", "low", "stuck"]
                .map(|n| format!("{name}_{n}"));
            let over =
                d.add(&names[0], "1", "the stick is above its limit", Kind::Above(asked, high));
            let up = d.add(&names[1], "1", "the error pushes it up", Kind::Above(push, zero));
            let under =
                d.add(&names[2], "1", "the stick is below its limit", Kind::Above(low, asked));
            let down = d.add(&names[3], "1", "the error pushes it down", Kind::Above(zero, push));
            let top = d.add(&names[4], "1", "both, upward", Kind::All(vec![over, up]));
            let bottom = d.add(&names[5], "1", "both, downward", Kind::All(vec![under, down]));
            let stuck = d.add(
                &names[6],
                "1",
                "whether the integral must hold",
                Kind::Any(vec![top, bottom]),
            );
            let grows = d.select(
                &format!("{name}_grows"),
                AXES_UNITS[i],
                "what is integrated",
                stuck,
                [zero, e.errors[i]],
            );
            d.integrate(
                e.integrals[i],
                &format!("{name}_integral_now"),
                "the integral after this step",
                grows,
            );
        }
        if c.engage {
            self.engagement(e, wanted, trim, answer);
        }
    }

    /// Engaging with given sticks: the integrals take what the law would
    /// otherwise lack.
    fn engagement(&mut self, e: &Errors, wanted: &Wanted, trim: [Wire; 4], answer: [Wire; 4]) {
        self.d.group(
            "engaging",
            "The integrals take what the law lacks of the given sticks, so that the next step's \
             sticks are these.",
        );
        let nu = NU.map(|s| s.0);
        let sticks = STICKS.map(|s| s.0);
        let given: [Wire; 4] = std::array::from_fn(|j| self.w(ENGAGEMENT[1 + j].0));
        let (col, ped) = (2, 3);
        // Pedals as the inversion asks for them, at the trim's power.
        let at_trim_power = |b: &mut Self, which: &str, sticks: [Wire; 4]| {
            let moved = b.d.sum(
                &format!("{which}_col_moved"),
                "%",
                "collective, from the trim",
                &[sticks[col].into(), -trim[col]],
            );
            let power = b.pedal_power(&format!("{which}_power"), moved);
            let pedal = b.d.sum(
                &format!("{which}_ped_moved"),
                "%",
                "pedals, from the trim",
                &[sticks[ped].into(), -trim[ped]],
            );
            b.d.sum(
                &format!("{which}_ped_asked"),
                "%",
                "the same at the trim's power",
                &[term(&[pedal, power])],
            )
        };
        let asked = at_trim_power(self, "given", given);
        let own = at_trim_power(self, "own", answer);
        let right: Vec<Wire> = (0..4)
            .map(|j| {
                let name = format!("{}_lacking", sticks[j]);
                let terms: [Term; 2] =
                    if j == ped { [asked.into(), -own] } else { [given[j].into(), -answer[j]] };
                self.d.sum(&name, "%", "what the law lacks", &terms)
            })
            .collect();
        let mut matrix = Vec::new();
        for stick in sticks {
            for column in nu {
                matrix.push(self.entry("allocation", stick, column));
            }
        }
        let solution = self.d.add(
            "lacking",
            "1",
            "accelerations that move the sticks so",
            Kind::Solve { matrix, right },
        );
        for i in 0..4 {
            let (name, channel, _) = AXES[i];
            let k_i = self.entry("gains", channel, "k_i");
            let d = &mut self.d;
            let (zero, one) = (d.number(0.0), d.number(1.0));
            let part = d.add(
                &format!("{name}_lacking"),
                NU[i].1,
                "one of them",
                Kind::Part { of: solution, index: i },
            );
            let some = d.add(
                &format!("{name}_has_integral"),
                "1",
                "whether there is an integral gain",
                Kind::Above(k_i, zero),
            );
            let safe =
                d.select(&format!("{name}_k_i_safe"), "1", "the gain, or 1", some, [k_i, one]);
            let value = d.over(
                &format!("{name}_engaged_quotient"),
                AXES_UNITS[i],
                "the integral that asks for it",
                (part, safe),
            );
            let value = d.select(
                &format!("{name}_engaged"),
                AXES_UNITS[i],
                "the integral after engaging",
                some,
                [value, zero],
            );
            d.engage(e.integrals[i], value);
            if let Some([follower, asked]) = wanted.followers[i] {
                // The notch is at rest on what is asked for with the integral.
                let rest = d.sum(
                    &format!("{name}_notch_engaged"),
                    NU[i].1,
                    "what feedback asks for after engaging",
                    &[asked.into(), term(&[k_i, value])],
                );
                d.engage(follower, rest);
            }
        }
    }

    fn finish(mut self) -> Diagram {
        self.d.group("monitors", "What may be looked at.");
        let (phi, lifted_of) = (self.w("delayed_phi"), self.w("delayed_theta"));
        let [due_x, due_y, v_z] = ["due_v_x", "due_v_y", "delayed_v_z"].map(|n| self.w(n));
        let (blend, integral) = (self.w("turn_blend"), self.w("r_integral"));
        let d = &mut self.d;
        // Where turn coordination has the bank, the velocity to the right is
        // that of flight without v.
        let st = d.function("sin_delayed_theta", "of the delayed pitch", Function::Sine, lifted_of);
        let ct =
            d.function("cos_delayed_theta", "of the delayed pitch", Function::Cosine, lifted_of);
        let sp = d.function("sin_delayed_phi", "of the delayed bank", Function::Sine, phi);
        let cp = d.function("cos_delayed_phi", "of the delayed bank", Function::Cosine, phi);
        let tan = d.over("tan_delayed_phi", "1", "of the delayed bank", (sp, cp));
        let lifted = d.sum(
            "lifted_delayed",
            "m/s",
            "velocity in the vertical plane",
            &[term(&[due_x, st]), term(&[v_z, ct])],
        );
        let none = d.sum(
            "v_y_coordinated",
            "m/s",
            "a coordinated turn leaves no v",
            &[-term(&[lifted, tan])],
        );
        d.blend(
            "shown_v_y",
            "m/s",
            "velocity to the right that is steered to",
            blend,
            [due_y, none],
        );
        d.sum("held_heading", "rad", "heading, as its integral holds it", &[-integral]);
        let monitors = MONITORS.map(|name| self.w(name)).to_vec();
        self.d.monitors = monitors;
        self.d
    }
}

const AXES_UNITS: [&str; 4] = ["rad", "rad", "rad/s", "m/s"];

#[cfg(test)]
mod tests {
    use super::*;

    fn choices() -> Choices {
        Choices {
            settings: LawSettings {
                kappa: 0.25,
                hybrid_feedforward: true,
                reference_delay: 0.15,
                roll_frequency: 2.0,
                pitch_frequency: 2.0,
                attitude_damping: 0.8,
                yaw_time_constant: 0.5,
                heave_time_constant: 2.0,
                notch: Notches::default(),
            },
            turn: TurnCoordination { speed: 25.7, width: 5.0 },
            off_trim: OffTrim::default(),
            limits: [[-100.0, 100.0]; 4],
            step: 0.01,
            delay_steps: 15,
            ports: true,
            engage: true,
        }
    }

    /// Every variant is whole: no wire leads nowhere, names are identifiers and
    /// stand once, every named block says what it is, and every memory and line
    /// is fed.
    #[test]
    fn every_variant_is_whole() {
        for variant in 0..32 {
            let mut c = choices();
            if variant & 16 == 0 {
                let notch = Some(Notch { frequency: 12.0, damping: 0.4, depth: 0.1 });
                c.settings.notch = Notches { pitch: notch, heave: notch, ..Notches::default() };
            }
            c.ports = variant & 1 == 0;
            c.engage = variant & 2 == 0;
            c.settings.hybrid_feedforward = variant & 4 == 0;
            if variant & 8 == 0 {
                c.delay_steps = 0;
            }
            for d in [diagram(&c), diagram(&c).pruned()] {
                let mut names = std::collections::BTreeSet::new();
                for (k, b) in d.blocks.iter().enumerate() {
                    assert!(b.kind.reads().iter().all(|w| w.0 < k), "{} reads ahead", b.name);
                    assert!(b.name.is_empty() || names.insert(b.name.clone()), "{}", b.name);
                    let sound = |x: char| x.is_ascii_lowercase() || x.is_ascii_digit() || x == '_';
                    assert!(b.name.chars().all(sound), "{}", b.name);
                    let told = matches!(b.kind, Kind::Entry(_)) || b.name.is_empty();
                    assert!(told || !b.comment.is_empty(), "{}", b.name);
                    if let Kind::Entry(place) = b.kind {
                        assert!(place < tables::count(), "{}", b.name);
                    }
                    let memory = matches!(b.kind, Kind::Memory { .. });
                    let stores = d.stores.iter().filter(|s| s.memory == Wire(k)).count();
                    assert_eq!(stores, usize::from(memory), "{}", b.name);
                    let line = matches!(b.kind, Kind::Delay { .. });
                    let feeds = d.feeds.iter().filter(|s| s.line == Wire(k)).count();
                    assert_eq!(feeds, usize::from(line), "{}", b.name);
                }
                assert_eq!(d.outputs.len(), 4);
                assert_eq!(d.monitors.len(), MONITORS.len());
            }
        }
    }
}
