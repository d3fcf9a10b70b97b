//! Block diagrams of the multi-loop dynamic-inversion law, after Figs. 10 to 12
//! of the reference paper, with the signals as this program's law has them.

use super::plot::diagram::{Anchor, Diagram};

/// What the diagrams print of a particular law; texts with their units.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LawLabels {
    /// Share κ of the velocity feedback that is inverted, like `0.25`.
    pub inverted_share: String,
    /// Delay τ of the references, like `0.146 s`.
    pub reference_delay: String,
    /// Command model of the attitudes, like `ω 2 rad/s, ζ 0.8`.
    pub attitude_model: String,
    /// Command model of yaw rate and vertical velocity, like `0.5 s, 2 s`.
    pub rate_models: String,
    /// Actuators and their delay, like `30 rad/s, 35 ms`.
    pub actuators: String,
    /// Sensors, like `60 rad/s`.
    pub sensors: String,
    /// Speed of turn coordination, like `50 kt`.
    pub turn_speed: String,
}

/// The whole loop (Fig. 10): commands, outer loop, inner loop, rotorcraft.
#[must_use]
pub fn closed_loop(labels: &LawLabels) -> Diagram {
    let y = 75.0;
    Diagram::new("The closed loop", 820.0, 215.0)
        .description(
            "Velocity and heading-rate commands enter the outer loop, which commands bank and \
             pitch to the inner loop. The inner loop commands sticks, the mixer and actuators \
             move the blades, and sensors feed the rotorcraft's motion back to both loops. The \
             schedule gives both loops their trim, matrices and gains by airspeed.",
        )
        .wire(&[[8.0, y], [115.0, y]], "V_{x}, V_{y}, ψ' cmd")
        .strong_block([175.0, y], [120.0, 56.0], &["outer loop", "velocity"])
        .wire(&[[235.0, y], [315.0, y]], "φ, θ cmd")
        .strong_block([375.0, y], [120.0, 56.0], &["inner loop", "attitude, inversion"])
        .wire(&[[435.0, y], [500.0, y]], "sticks δ")
        .block([560.0, y], [120.0, 56.0], &["mixer, actuators", &labels.actuators])
        .wire(&[[620.0, y], [675.0, y]], "blades")
        .block([735.0, y], [120.0, 56.0], &["rotorcraft"])
        .wire(&[[8.0, 30.0], [355.0, 30.0], [355.0, y - 28.0]], "V_{z}, ψ' cmd")
        .line(&[[735.0, y + 28.0], [735.0, 165.0], [620.0, 165.0]], "")
        .block([560.0, 165.0], [120.0, 40.0], &["sensors", &labels.sensors])
        .line(&[[500.0, 165.0], [160.0, 165.0]], "")
        .wire(&[[375.0, 165.0], [375.0, y + 28.0]], "x")
        .dot([375.0, 165.0])
        .wire(&[[160.0, 165.0], [160.0, y + 28.0]], "velocity")
        .block([275.0, 133.0], [110.0, 26.0], &["schedule over V"])
        .wire(&[[245.0, 120.0], [195.0, y + 28.0]], "")
        .wire(&[[305.0, 120.0], [348.0, y + 28.0]], "")
}

/// The outer loop (Fig. 11): translational rate command and turn coordination.
#[must_use]
pub fn outer_loop(labels: &LawLabels) -> Diagram {
    let r = Diagram::sum_radius();
    let (top, bottom) = (60.0, 140.0);
    let row = |d: Diagram, y: f64, name: &str, gain: &str, sign: &str, out: &str| {
        d.wire(&[[10.0, y], [90.0 - r, y]], &format!("{name} cmd"))
            .sum([90.0, y], &[(Anchor::Left, "+"), (Anchor::Below, "−")])
            .wire(&[[90.0, y + 32.0], [90.0, y + r]], "")
            .text([90.0, y + 30.0], Anchor::Below, name)
            .wire(&[[90.0 + r, y], [150.0, y]], "e")
            .block([215.0, y], [130.0, 44.0], &[gain, "PI, held at ±35 deg"])
            .wire(&[[280.0, y], [345.0 - r, y]], "")
            .sum([345.0, y], &[(Anchor::Left, sign), (Anchor::Above, "+")])
            .wire(&[[345.0, y - 32.0], [345.0, y - r]], "")
            .text([345.0, y - 31.0], Anchor::Right, &format!("{out} trim"))
    };
    let d = Diagram::new("Outer loop: velocities over the ground in heading axes", 720.0, 230.0)
        .description(
            "Errors of forward velocity command pitch and errors of sideward velocity command \
             bank, each through a proportional-integral gain over gravity and added to the trim \
             attitude. Around the turn-coordination speed the bank command passes over to that \
             of a coordinated turn.",
        );
    let d = row(d, top, "V_{x}", "(K_{P} + K_{I}/s)/g", "−", "θ");
    let d = row(d, bottom, "V_{y}", "(K_{P} + K_{I}/s)/g", "+", "φ");
    d.wire(&[[345.0 + r, top], [700.0, top]], "θ cmd")
        .wire(&[[345.0 + r, bottom], [500.0, bottom]], "φ cmd")
        .block(
            [565.0, bottom],
            [130.0, 50.0],
            &["(1 − b) φ + b φ_{turn}", &format!("b(V) about {}", labels.turn_speed)],
        )
        .wire(&[[630.0, bottom], [700.0, bottom]], "φ' cmd")
        .wire(&[[10.0, 207.0], [430.0, 207.0]], "")
        .text([48.0, 207.0], Anchor::Above, "ψ' cmd")
        .block([500.0, 207.0], [140.0, 32.0], &["φ_{turn} = atan(V ψ'/g)"])
        .wire(&[[570.0, 207.0], [585.0, 207.0], [585.0, bottom + 25.0]], "")
}

/// The inner loop (Fig. 12): command models, error gains and inversion.
#[must_use]
pub fn inner_loop(labels: &LawLabels) -> Diagram {
    let r = Diagram::sum_radius();
    let y = 95.0;
    Diagram::new("Inner loop: command models and dynamic inversion", 900.0, 290.0)
        .description(
            "Each command runs through its model, whose acceleration is fed forward. The delayed \
             model value minus the measured one passes the proportional, integral and derivative \
             gains. Their sum, less the inverted feedback of the state and the share of the \
             velocity feedback that is fed forward from the ideal model, is decoupled into \
             sticks and added to the trim.",
        )
        .wire(&[[8.0, y], [95.0, y]], "φ, θ, r, V_{z} cmd")
        .block(
            [165.0, y],
            [140.0, 66.0],
            &["command models", &labels.attitude_model, &labels.rate_models],
        )
        .line(&[[165.0, y - 33.0], [165.0, 30.0], [515.0, 30.0]], "")
        .text([340.0, 30.0], Anchor::Above, "accelerations of the models, fed forward")
        .wire(&[[515.0, 30.0], [515.0, y - r]], "")
        .wire(&[[235.0, y], [275.0, y]], "")
        .block([310.0, y], [70.0, 44.0], &["delay", &labels.reference_delay])
        .wire(&[[345.0, y], [375.0 - r, y]], "")
        .sum([375.0, y], &[(Anchor::Left, "+"), (Anchor::Below, "−")])
        .wire(&[[375.0 + r, y], [400.0, y]], "")
        .strong_block([445.0, y], [90.0, 44.0], &["K_{P} + K_{I}/s", "+ K_{D} s"])
        .wire(&[[490.0, y], [515.0 - r, y]], "")
        .sum([515.0, y], &[(Anchor::Left, "+"), (Anchor::Above, "+")])
        .wire(&[[515.0 + r, y], [590.0 - r, y]], "ν")
        .sum([590.0, y], &[(Anchor::Left, "+"), (Anchor::Below, "−")])
        .wire(&[[590.0 + r, y], [645.0, y]], "")
        .strong_block([690.0, y], [90.0, 44.0], &["B_{d}^{−1}", "inversion"])
        .wire(&[[735.0, y], [790.0 - r, y]], "Δδ")
        .sum([790.0, y], &[(Anchor::Left, "+"), (Anchor::Above, "+")])
        .wire(&[[790.0, 50.0], [790.0, y - r]], "")
        .text([790.0, 52.0], Anchor::Above, "δ trim")
        .wire(&[[790.0 + r, y], [890.0, y]], "sticks δ")
        .wire(&[[165.0, y + 33.0], [165.0, 195.0], [205.0, 195.0]], "")
        .block([275.0, 195.0], [140.0, 44.0], &["ideal model", "of the commands"])
        .line(&[[345.0, 195.0], [368.0, 195.0]], "")
        .line(&[[368.0, 195.0], [375.0, 188.0], [382.0, 195.0]], "")
        .wire(&[[382.0, 195.0], [455.0, 195.0]], "x_{ref}")
        .block([530.0, 195.0], [150.0, 44.0], &["(1 − κ) F_{uvw}", "fed forward"])
        .line(&[[605.0, 195.0], [660.0, 195.0], [660.0, 150.0], [590.0, 150.0]], "")
        .dot([590.0, 150.0])
        .line(&[[10.0, 258.0], [375.0, 258.0]], "")
        .text([60.0, 258.0], Anchor::Above, "x, measured")
        .wire(&[[375.0, 258.0], [375.0, y + r]], "")
        .text([375.0, 150.0], Anchor::Left, "φ, θ, r, V_{z}")
        .dot([375.0, 258.0])
        .wire(&[[375.0, 258.0], [455.0, 258.0]], "")
        .block(
            [530.0, 258.0],
            [150.0, 44.0],
            &["F_{att} + κ F_{uvw}", &format!("κ = {}", labels.inverted_share)],
        )
        .line(&[[605.0, 258.0], [680.0, 258.0], [680.0, 135.0], [590.0, 135.0]], "")
        .line(&[[590.0, 150.0], [590.0, 135.0]], "")
        .dot([590.0, 135.0])
        .wire(&[[590.0, 135.0], [590.0, y + r]], "")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_diagrams_carry_their_numbers() {
        let labels = LawLabels {
            inverted_share: "0.25".into(),
            reference_delay: "0.146 s".into(),
            actuators: "30 rad/s".into(),
            turn_speed: "50 kt".into(),
            ..LawLabels::default()
        };
        let inner = inner_loop(&labels).to_svg("inner");
        assert!(inner.contains("κ = 0.25") && inner.contains("0.146 s"));
        assert!(outer_loop(&labels).to_svg("outer").contains("about 50 kt"));
        assert!(closed_loop(&labels).to_svg("whole").contains("30 rad/s"));
    }
}
