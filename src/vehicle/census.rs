//! What the sections of a rotor's blades meet over its disk: stall, drag
//! divergence, reversed flow, and the section that is worst off.
//!
//! Shares are of the area that the blades sweep, over as many azimuths as were
//! counted. A section counts as
//!
//! * reversed where the air meets its trailing edge first (u_T < 0);
//! * stalled where its angle of attack is beyond that of the largest or least
//!   lift at its Mach number, not reversed, and the air is faster than a fifth
//!   of the tip speed: slower sections carry nothing;
//! * beyond drag divergence where its Mach number is beyond the one at which
//!   ∂c_d/∂M reaches 0.1 at its angle, or beyond 0.9, not stalled.

use crate::vehicle::airfoil::Section;

/// Part of the tip speed below which a section carries nothing.
const SLOW: f64 = 0.2;

/// A blade section and the air that it meets.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SectionFlow {
    /// Radius r/R.
    pub station: f64,
    /// Azimuth in the rotor's own hub frame, rad, from over the tail in the
    /// direction of rotation.
    pub azimuth: f64,
    /// Angle of attack, rad.
    pub angle_of_attack: f64,
    /// Mach number.
    pub mach: f64,
    /// Velocity of the air along the chord over the tip speed, positive onto
    /// the leading edge.
    pub along_chord: f64,
}

/// Sections counted, and the one that is worst off.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Census {
    /// Sections, weighted with r/R.
    counted: f64,
    stalled: f64,
    diverging: f64,
    reversed: f64,
    /// How far the worst section is on the way to stall (1: there), or to drag
    /// divergence, whichever is further.
    pub severity: f64,
    /// The worst section.
    pub worst: SectionFlow,
}

impl Census {
    /// Counts a section.
    pub fn add(&mut self, section: &Section, flow: SectionFlow) {
        let weight = flow.station;
        self.counted += weight;
        if flow.along_chord < 0.0 {
            self.reversed += weight;
            return;
        }
        if flow.along_chord < SLOW {
            return;
        }
        let stall = section.stall_fraction(flow.angle_of_attack, flow.mach);
        let divergence = flow.mach / section.drag_divergence(flow.angle_of_attack);
        if stall > 1.0 {
            self.stalled += weight;
        } else if divergence > 1.0 {
            self.diverging += weight;
        }
        let severity = stall.max(divergence);
        if severity > self.severity {
            self.severity = severity;
            self.worst = flow;
        }
    }

    /// Counts what another has counted.
    pub fn merge(&mut self, other: &Self) {
        self.counted += other.counted;
        self.stalled += other.stalled;
        self.diverging += other.diverging;
        self.reversed += other.reversed;
        if other.severity > self.severity {
            self.severity = other.severity;
            self.worst = other.worst;
        }
    }

    /// Whether there are blades to speak of.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.counted == 0.0
    }

    fn share(&self, part: f64) -> f64 {
        if self.is_empty() { 0.0 } else { part / self.counted }
    }

    /// Share of the disk that is stalled, 0 to 1.
    #[must_use]
    pub fn stalled(&self) -> f64 {
        self.share(self.stalled)
    }

    /// Share of the disk beyond drag divergence or Mach 0.9, 0 to 1.
    #[must_use]
    pub fn diverging(&self) -> f64 {
        self.share(self.diverging)
    }

    /// Share of the disk in reversed flow, 0 to 1.
    #[must_use]
    pub fn reversed(&self) -> f64 {
        self.share(self.reversed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::{Airfoil, Polar};
    use std::f64::consts::TAU;

    fn plain() -> Section {
        Section::new(&Airfoil::Analytic {
            lift_slope: 5.7,
            zero_lift_angle: 0.0,
            drag: 0.01,
            polar: Polar::default(),
            small_angles: false,
        })
        .unwrap()
    }

    /// A rigid rotor edgewise to the flow: the air is reversed within a circle
    /// of diameter μ R, a share of μ²/4 of the disk.
    #[test]
    fn val_reversed_flow_is_a_circle_of_diameter_mu() {
        for mu in [0.2, 0.5, 0.8] {
            let mut census = Census::default();
            for k in 0..720 {
                let azimuth = TAU * f64::from(k) / 720.0;
                for j in 0..400 {
                    let station = (f64::from(j) + 0.5) / 400.0;
                    let along_chord = station + mu * azimuth.sin();
                    let flow = SectionFlow {
                        station,
                        azimuth,
                        angle_of_attack: 0.0,
                        mach: 0.1,
                        along_chord,
                    };
                    census.add(&plain(), flow);
                }
            }
            assert!((census.reversed() - 0.25 * mu * mu).abs() < 2e-4, "{mu}: {census:?}");
            assert_eq!(census.stalled(), 0.0);
            assert_eq!(census.diverging(), 0.0);
        }
    }

    /// Parts count as the whole, and the worst of them is the worst.
    #[test]
    fn merged_parts_are_the_whole() {
        let flow = |station: f64, angle: f64, mach: f64| SectionFlow {
            station,
            azimuth: station,
            angle_of_attack: angle,
            mach,
            along_chord: station,
        };
        let flows =
            [flow(0.3, 0.5, 0.2), flow(0.6, 0.1, 0.5), flow(0.9, 0.02, 0.95), flow(0.1, 1.0, 0.1)];
        let mut whole = Census::default();
        let mut parts = Census::default();
        for f in flows {
            whole.add(&plain(), f);
            let mut part = Census::default();
            part.add(&plain(), f);
            parts.merge(&part);
        }
        assert_eq!(whole, parts);
        assert!((whole.stalled() - 0.3 / 1.9).abs() < 1e-12);
        assert!((whole.diverging() - 0.9 / 1.9).abs() < 1e-12);
        assert_eq!(whole.worst.station, 0.3);
        assert!(Census::default().is_empty());
        assert_eq!(Census::default().stalled(), 0.0);
    }
}
