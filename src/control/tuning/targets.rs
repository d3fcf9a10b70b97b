//! What a tuning must meet: the targets of a channel, the elastic requirements
//! made of them, and what each target costs.

use super::super::axis::Channel;
use super::super::plant::ModelClass;
use serde::{Deserialize, Serialize};

/// What one class of models must meet in one channel; factors, rad, rad/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Targets {
    /// Gain margin upward, factor.
    pub gain_up: f64,
    /// Gain margin downward, factor.
    pub gain_down: f64,
    /// Phase margin, rad.
    pub phase: f64,
    /// Least disturbance rejection bandwidth, rad/s.
    pub drb: Option<f64>,
    /// Largest disturbance rejection peak, factor.
    pub drp: Option<f64>,
    /// Least crossover, rad/s.
    pub crossover_min: Option<f64>,
    /// Largest crossover, rad/s.
    pub crossover_max: Option<f64>,
}

/// Specification of one channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChannelSpec {
    /// For nominal models.
    pub nominal: Targets,
    /// For off-nominal models.
    pub off_nominal: Targets,
    /// Least and largest K_I/K_P, 1/s.
    pub integral_ratio: [f64; 2],
    /// Factor on this channel's prices: above one, its specs give way last.
    pub priority: f64,
    /// Lowest and highest speed at which the channel is closed, m/s.
    pub speeds: [f64; 2],
    /// Phase margin that the tuning adds in an inner axis while the outer
    /// loops are open, for what they take, rad.
    pub phase_reserve: f64,
}

impl Targets {
    /// The margins alone.
    pub(super) fn margins_only(&self) -> Self {
        Self { drb: None, drp: None, crossover_min: None, crossover_max: None, ..*self }
    }
}

impl ChannelSpec {
    /// Whether the channel is closed at a speed, m/s.
    pub fn applies(&self, speed: f64) -> bool {
        let slack = 1e-6;
        speed >= self.speeds[0] - slack && speed <= self.speeds[1] + slack
    }

    /// Targets of a class.
    pub fn targets(&self, class: ModelClass) -> &Targets {
        match class {
            ModelClass::Nominal => &self.nominal,
            ModelClass::OffNominal => &self.off_nominal,
        }
    }
}

/// Kinds of elastic requirements, in the order of the slacks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Requirement {
    /// The kite of gain and phase margins.
    Margin,
    /// Disturbance rejection bandwidth.
    RejectionBandwidth,
    /// Disturbance rejection peak.
    RejectionPeak,
    /// Least crossover.
    CrossoverMin,
    /// Largest crossover.
    CrossoverMax,
}

impl Requirement {
    /// All kinds.
    pub const ALL: [Requirement; 5] = [
        Requirement::Margin,
        Requirement::RejectionBandwidth,
        Requirement::RejectionPeak,
        Requirement::CrossoverMin,
        Requirement::CrossoverMax,
    ];
    /// Price of a unit of violation, relative to the activity at the start.
    pub(super) fn price(self) -> f64 {
        match self {
            Requirement::Margin => 300.0,
            Requirement::RejectionBandwidth
            | Requirement::RejectionPeak
            | Requirement::CrossoverMin
            | Requirement::CrossoverMax => 100.0,
        }
    }
}

/// Number of requirement kinds.
pub(super) const KINDS: usize = Requirement::ALL.len();

/// A target of a channel that can be moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Target {
    /// Phase margin, deg.
    PhaseMargin,
    /// Gain margins, dB.
    GainMargin,
    /// Disturbance rejection bandwidth, rad/s.
    Drb,
    /// Disturbance rejection peak, dB.
    Drp,
    /// Least crossover, rad/s.
    CrossoverMin,
    /// Largest crossover, rad/s.
    CrossoverMax,
}

impl Target {
    /// All targets.
    pub const ALL: [Target; 6] = [
        Target::PhaseMargin,
        Target::GainMargin,
        Target::Drb,
        Target::Drp,
        Target::CrossoverMin,
        Target::CrossoverMax,
    ];

    /// Targets that have a price: all but the largest crossover, which the least
    /// activity keeps away from by itself.
    pub const PRICED: [Target; 5] =
        [Target::PhaseMargin, Target::GainMargin, Target::Drb, Target::Drp, Target::CrossoverMin];

    /// The tightening that its price is of: in rad, natural logarithm of a
    /// gain factor, of a level or of a frequency, and in words.
    pub fn unit_tightening(self) -> (f64, &'static str) {
        const NEPER_PER_DECIBEL: f64 = std::f64::consts::LN_10 / 20.0;
        match self {
            Target::PhaseMargin => (std::f64::consts::PI / 180.0, "1 deg more"),
            Target::GainMargin => (0.25 * NEPER_PER_DECIBEL, "0.25 dB more"),
            Target::Drb => (0.02, "2 % more"),
            Target::Drp => (0.1 * NEPER_PER_DECIBEL, "0.1 dB less"),
            Target::CrossoverMin => (0.02, "2 % more"),
            Target::CrossoverMax => (0.02, "2 % less"),
        }
    }
}

/// Price of a target at a speed, from the duals of the last program.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Price {
    /// The channel.
    pub channel: Channel,
    /// Speed, m/s.
    pub speed: f64,
    /// The target.
    pub target: Target,
    /// Rise of the actuator activity at this speed for
    /// [`Target::unit_tightening`], %; to first order, with the other speeds'
    /// part of the cost counted as if it arose here. Not negative: what is
    /// harder is not cheaper.
    pub percent: f64,
}
