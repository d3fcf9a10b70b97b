//! Axes, channels, effectors and the gains that belong to them.

use serde::{Deserialize, Serialize};
use std::fmt;

/// An axis of the inner loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Axis {
    /// Bank angle φ: attitude command, attitude hold.
    Roll,
    /// Pitch angle θ: attitude command, attitude hold.
    Pitch,
    /// Yaw rate r: rate command, direction hold.
    Yaw,
    /// Earth-vertical velocity, positive down.
    Heave,
}

impl Axis {
    /// All axes in the order of every four-vector of outputs.
    pub const ALL: [Axis; 4] = [Axis::Roll, Axis::Pitch, Axis::Yaw, Axis::Heave];

    /// Place in a four-vector of outputs.
    pub fn index(self) -> usize {
        self as usize
    }

    /// Name used in files.
    pub fn name(self) -> &'static str {
        match self {
            Axis::Roll => "roll",
            Axis::Pitch => "pitch",
            Axis::Yaw => "yaw",
            Axis::Heave => "heave",
        }
    }

    /// The effector whose loop this axis closes.
    pub fn effector(self) -> Effector {
        match self {
            Axis::Roll => Effector::Lateral,
            Axis::Pitch => Effector::Longitudinal,
            Axis::Yaw => Effector::Pedal,
            Axis::Heave => Effector::Collective,
        }
    }
}

impl fmt::Display for Axis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A pilot's stick, as seen by the control law.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Effector {
    /// Lateral cyclic.
    Lateral,
    /// Longitudinal cyclic.
    Longitudinal,
    /// Collective.
    Collective,
    /// Pedal.
    Pedal,
}

impl Effector {
    /// Place in every control vector: lat, lon, col, ped.
    pub fn index(self) -> usize {
        self as usize
    }
}

/// A feedback channel: an inner axis, or an outer velocity loop around it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Channel {
    /// Inner roll.
    Roll,
    /// Inner pitch.
    Pitch,
    /// Inner yaw.
    Yaw,
    /// Inner heave; it is the vertical part of the translational rate command.
    Heave,
    /// Longitudinal ground velocity in heading axes, through pitch.
    Vx,
    /// Lateral ground velocity in heading axes, through roll.
    Vy,
}

impl Channel {
    /// All channels in the order of [`GainSet`].
    pub const ALL: [Channel; 6] =
        [Channel::Roll, Channel::Pitch, Channel::Yaw, Channel::Heave, Channel::Vx, Channel::Vy];

    /// Place in a [`GainSet`].
    pub fn index(self) -> usize {
        self as usize
    }

    /// Name used in files.
    pub fn name(self) -> &'static str {
        match self {
            Channel::Vx => "vx",
            Channel::Vy => "vy",
            _ => self.axis().name(),
        }
    }

    /// The inner axis that the channel commands or is.
    pub fn axis(self) -> Axis {
        match self {
            Channel::Roll | Channel::Vy => Axis::Roll,
            Channel::Pitch | Channel::Vx => Axis::Pitch,
            Channel::Yaw => Axis::Yaw,
            Channel::Heave => Axis::Heave,
        }
    }

    /// Whether it is an outer velocity loop.
    pub fn is_outer(self) -> bool {
        matches!(self, Channel::Vx | Channel::Vy)
    }

    /// The outer loop that commands an inner axis, where there is one.
    pub fn outer(self) -> Option<Channel> {
        match self {
            Channel::Roll => Some(Channel::Vy),
            Channel::Pitch => Some(Channel::Vx),
            _ => None,
        }
    }

    /// The inner channel whose loop has most to do with this one's: at speed
    /// pitch and heave move each other's outputs, roll and yaw everywhere.
    pub fn partner(self) -> Channel {
        match self {
            Channel::Roll | Channel::Vy => Channel::Yaw,
            Channel::Pitch | Channel::Vx => Channel::Heave,
            Channel::Yaw => Channel::Roll,
            Channel::Heave => Channel::Pitch,
        }
    }

    /// Which of K_D, K_P, K_I exist.
    pub fn gains(self) -> &'static [Gain] {
        match self {
            Channel::Roll | Channel::Pitch => {
                &[Gain::Derivative, Gain::Proportional, Gain::Integral]
            }
            _ => &[Gain::Proportional, Gain::Integral],
        }
    }

    /// Whether a gain acts on the held quantity, which the disturbance of the
    /// rejection metrics is added to. Attitude holds leave the rate signal
    /// clean: K_D in roll and pitch, K_P on yaw rate. In heave and in the
    /// outer loops the held quantity is the velocity that both gains see.
    pub fn holds(self, gain: Gain) -> bool {
        match self {
            Channel::Roll | Channel::Pitch => gain != Gain::Derivative,
            Channel::Yaw => gain == Gain::Integral,
            Channel::Heave | Channel::Vx | Channel::Vy => true,
        }
    }
}

impl From<Axis> for Channel {
    fn from(axis: Axis) -> Self {
        match axis {
            Axis::Roll => Channel::Roll,
            Axis::Pitch => Channel::Pitch,
            Axis::Yaw => Channel::Yaw,
            Axis::Heave => Channel::Heave,
        }
    }
}

impl fmt::Display for Channel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// One gain of a channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Gain {
    /// K_D, on the error's rate.
    Derivative,
    /// K_P, on the error.
    Proportional,
    /// K_I, on the error's integral.
    Integral,
}

impl Gain {
    /// Place in [`ChannelGains`] read as an array.
    pub fn index(self) -> usize {
        self as usize
    }
}

/// Gains of one channel.
///
/// Attitude axes: K_D in 1/s, K_P in 1/s², K_I in 1/s³. Rate and velocity
/// channels: K_D = 0, K_P in 1/s, K_I in 1/s².
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChannelGains {
    /// Gain on the error's rate.
    pub k_d: f64,
    /// Gain on the error.
    pub k_p: f64,
    /// Gain on the error's integral.
    pub k_i: f64,
}

impl ChannelGains {
    /// From K_D, K_P, K_I.
    pub fn new(k_d: f64, k_p: f64, k_i: f64) -> Self {
        Self { k_d, k_p, k_i }
    }

    /// One gain.
    pub fn get(&self, gain: Gain) -> f64 {
        self.array()[gain.index()]
    }

    /// K_D, K_P, K_I.
    pub fn array(&self) -> [f64; 3] {
        [self.k_d, self.k_p, self.k_i]
    }

    /// The existing gains of a channel, in the order of [`Channel::gains`].
    pub fn values(&self, channel: Channel) -> Vec<f64> {
        channel.gains().iter().map(|&g| self.get(g)).collect()
    }

    /// Inverse of [`ChannelGains::values`]; missing gains are zero.
    pub fn from_values(channel: Channel, values: &[f64]) -> Self {
        let mut a = [0.0; 3];
        for (&g, &v) in channel.gains().iter().zip(values) {
            a[g.index()] = v;
        }
        Self::new(a[0], a[1], a[2])
    }

    /// Linear blend: `(1 − t)·self + t·other`.
    pub fn blend(&self, other: &Self, t: f64) -> Self {
        let (a, b) = (self.array(), other.array());
        let c: [f64; 3] = std::array::from_fn(|i| (1.0 - t) * a[i] + t * b[i]);
        Self::new(c[0], c[1], c[2])
    }
}

/// Gains of every channel at one speed, by [`Channel::index`]. A channel that
/// is off has zero gains.
pub type GainSet = [ChannelGains; 6];

/// A set with the outer loops open.
pub fn inner_only(gains: &GainSet) -> GainSet {
    let mut g = *gains;
    g[Channel::Vx.index()] = ChannelGains::default();
    g[Channel::Vy.index()] = ChannelGains::default();
    g
}
