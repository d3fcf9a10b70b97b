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
    let row = |d: Diagram, y: f64, name: &str, sign: &str, trim: &str| {
        d.wire(&[[8.0, y], [75.0, y]], &format!("{name} cmd"))
            .block([135.0, y], [120.0, 44.0], &["reference", "lag and delay"])
            .line(&[[135.0, y - 22.0], [135.0, y - 36.0], [455.0, y - 36.0]], "")
            .text([300.0, y - 36.0], Anchor::Above, "acceleration of the reference")
            .wire(&[[455.0, y - 36.0], [455.0, y - r]], "")
            .wire(&[[195.0, y], [240.0 - r, y]], "")
            .sum([240.0, y], &[(Anchor::Left, "+"), (Anchor::Below, "−")])
            .wire(&[[240.0, y + 32.0], [240.0, y + r]], "")
            .text([240.0, y + 30.0], Anchor::Below, &format!("{name} flown"))
            .wire(&[[240.0 + r, y], [290.0, y]], "e")
            .strong_block([350.0, y], [120.0, 44.0], &["K_{P} + K_{I}/s", "limited, no windup"])
            .wire(&[[410.0, y], [455.0 - r, y]], "")
            .sum([455.0, y], &[(Anchor::Left, "+"), (Anchor::Above, "+")])
            .wire(&[[455.0 + r, y], [490.0, y]], "")
            .block([515.0, y], [50.0, 32.0], &["1/g"])
            .wire(&[[540.0, y], [585.0 - r, y]], "")
            .sum([585.0, y], &[(Anchor::Left, sign), (Anchor::Above, "+")])
            .wire(&[[585.0, y - 30.0], [585.0, y - r]], "")
            .text([585.0, y - 28.0], Anchor::Above, trim)
    };
    let (top, bottom) = (70.0, 185.0);
    let d = Diagram::new("Outer loop: velocities over the ground in heading axes", 860.0, 280.0)
        .description(
            "Each velocity command runs through a reference. The error of the velocity flown \
             against it, through proportional and integral gains, and the reference's \
             acceleration, both over gravity, are added to the trim attitude: forward to pitch, \
             sideward to bank, there with the bank that a turn needs. Around the \
             turn-coordination speed the bank command passes over to that of a coordinated turn.",
        );
    let d = row(d, top, "V_{x}", "−", "θ trim");
    let d = row(d, bottom, "V_{y}", "+", "φ trim + atan(V_{x} ψ'/g)");
    d.wire(&[[585.0 + r, top], [850.0, top]], "θ cmd")
        .wire(&[[585.0 + r, bottom], [655.0, bottom]], "φ cmd")
        .block(
            [725.0, bottom],
            [140.0, 50.0],
            &["(1 − b) φ + b φ_{turn}", &format!("b(V) about {}", labels.turn_speed)],
        )
        .wire(&[[795.0, bottom], [850.0, bottom]], "φ' cmd")
        .wire(&[[8.0, 258.0], [585.0, 258.0]], "")
        .text([40.0, 258.0], Anchor::Above, "ψ' cmd")
        .block([675.0, 258.0], [180.0, 32.0], &["φ_{turn} = φ trim + atan(V ψ'/g)"])
        .wire(&[[725.0, 242.0], [725.0, bottom + 25.0]], "")
}

/// The inner loop (Fig. 12): command models, error gains, inversion for
/// commands and an allocation of its own for feedback.
#[must_use]
pub fn inner_loop(labels: &LawLabels) -> Diagram {
    let r = Diagram::sum_radius();
    let (up, y, down, low) = (60.0, 150.0, 240.0, 300.0);
    // Where wires cross without meeting, one steps over the other.
    let hop = |d: Diagram, x: f64, y: f64| {
        d.line(&[[x - 6.0, y], [x, y - 6.0]], "").line(&[[x, y - 6.0], [x + 6.0, y]], "")
    };
    let d = Diagram::new("Inner loop: command models and dynamic inversion", 900.0, 325.0)
        .description(
            "Commands run through models. Their accelerations, less what the ideal model's state \
             does by itself, go through the inverse of the control matrix. The delayed model \
             values minus the measured ones pass proportional, integral and derivative gains; \
             less the feedback of the state's deviation from the ideal one, they go through the \
             allocation of feedback. Both are added to the trim sticks.",
        )
        .wire(&[[8.0, y], [85.0, y]], "φ, θ, r, V_{z}")
        .text([45.0, y], Anchor::Below, "cmd")
        .block(
            [155.0, y],
            [140.0, 66.0],
            &["command models", &labels.attitude_model, &labels.rate_models],
        )
        .line(&[[155.0, y - 33.0], [155.0, up], [300.0, up]], "")
        .wire(&[[300.0, up], [560.0 - r, up]], "ν_{c}: accelerations of the models")
        .sum([560.0, up], &[(Anchor::Left, "+"), (Anchor::Below, "−")])
        .wire(&[[560.0 + r, up], [615.0, up]], "")
        .strong_block([665.0, up], [100.0, 44.0], &["B_{d}^{−1}", "exact inverse"])
        .wire(&[[715.0, up], [790.0, up], [790.0, 105.0 - r]], "")
        .wire(&[[225.0, y], [255.0, y]], "")
        .block([290.0, y], [70.0, 44.0], &["delay", &labels.reference_delay])
        .wire(&[[325.0, y], [370.0 - r, y]], "")
        .sum([370.0, y], &[(Anchor::Left, "+"), (Anchor::Below, "−")])
        .wire(&[[370.0 + r, y], [400.0, y]], "")
        .strong_block([447.0, y], [94.0, 44.0], &["K_{P} + K_{I}/s", "+ K_{D} s"])
        .line(&[[494.0, y], [509.0, y]], "ν_{e}")
        .wire(&[[521.0, y], [560.0 - r, y]], "")
        .sum([560.0, y], &[(Anchor::Left, "+"), (Anchor::Below, "−")])
        .wire(&[[560.0 + r, y], [615.0, y]], "")
        .strong_block([665.0, y], [100.0, 44.0], &["M", "allocation"])
        .wire(&[[715.0, y], [790.0, y], [790.0, 105.0 + r]], "")
        .sum([790.0, 105.0], &[(Anchor::Left, "+"), (Anchor::Above, "+"), (Anchor::Below, "+")])
        .wire(&[[745.0, 105.0], [790.0 - r, 105.0]], "")
        .text([745.0, 105.0], Anchor::Left, "δ trim")
        .wire(&[[790.0 + r, 105.0], [892.0, 105.0]], "sticks δ")
        .wire(&[[155.0, y + 33.0], [155.0, down], [215.0, down]], "")
        .block([285.0, down], [140.0, 44.0], &["ideal model", "of the commands"])
        .line(&[[355.0, down], [364.0, down]], "")
        .line(&[[376.0, down], [515.0, down]], "")
        .text([440.0, down], Anchor::Above, "x_{ref}")
        .dot([515.0, down])
        .wire(&[[515.0, down], [515.0, 118.0]], "")
        .block([515.0, 105.0], [36.0, 26.0], &["F"])
        .wire(&[[533.0, 105.0], [560.0, 105.0], [560.0, up + r]], "")
        .wire(&[[515.0, down], [560.0 - r, down]], "")
        .sum([560.0, down], &[(Anchor::Left, "−"), (Anchor::Below, "+")])
        .wire(&[[560.0 + r, down], [605.0, down]], "")
        .block(
            [665.0, down],
            [120.0, 44.0],
            &["F_{att} + κ F_{uvw}", &format!("κ = {}", labels.inverted_share)],
        )
        .wire(&[[725.0, down], [745.0, down], [745.0, 198.0], [560.0, 198.0], [560.0, y + r]], "")
        .line(&[[8.0, low], [560.0, low]], "")
        .text([50.0, low], Anchor::Above, "x, measured")
        .wire(&[[560.0, low], [560.0, down + r]], "")
        .dot([370.0, low])
        .wire(&[[370.0, low], [370.0, y + r]], "")
        .text([370.0, 200.0], Anchor::Left, "φ, θ, r, V_{z}");
    let d = hop(d, 515.0, y);
    hop(d, 370.0, down)
}

/// What flows from one group of blocks to another.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Flow {
    /// Place of the group that it comes from.
    pub from: usize,
    /// Place of the group that it goes to.
    pub to: usize,
    /// Names of the signals.
    pub signals: Vec<String>,
}

/// Names that a crossing shows; of more it says how many.
const SHOWN: usize = 2;

/// The law as it is computed: its groups of blocks on the diagonal, in order.
/// What a group gives stands in its row, in the column of the group that takes
/// it: above the diagonal in the same step, below it one step later.
#[must_use]
pub fn computed(groups: &[&str], flows: &[Flow]) -> Diagram {
    let (box_size, pitch) = ([128.0, 34.0], [138.0, 52.0]);
    let at =
        |column: usize, row: usize| [75.0 + pitch[0] * column as f64, 32.0 + pitch[1] * row as f64];
    let count = groups.len();
    let (width, height) = (pitch[0] * count as f64 + 20.0, pitch[1] * count as f64 + 20.0);
    let mut d = Diagram::new("The law, block by block", width, height).description(
        "Groups of the law's blocks in the order in which they are computed, and the signals that \
         flow between them. A signal leaves its group along the row and enters another along the \
         column.",
    );
    // Wires first: boxes and texts stand over them.
    for flow in flows {
        let (start, corner, end) =
            (at(flow.from, flow.from), at(flow.to, flow.from), at(flow.to, flow.to));
        let side = if flow.to > flow.from { 1.0 } else { -1.0 };
        d = d.wire(
            &[
                [start[0] + side * 0.5 * box_size[0], start[1]],
                corner,
                [end[0], end[1] - side * 0.5 * box_size[1]],
            ],
            "",
        );
    }
    for flow in flows {
        let corner = at(flow.to, flow.from);
        let shown = if flow.signals.len() > SHOWN {
            format!("{} signals", flow.signals.len())
        } else {
            flow.signals.join(", ")
        };
        d = d.dot(corner).text(corner, Anchor::Above, &shown);
    }
    for (k, group) in groups.iter().enumerate() {
        d = d.strong_block(at(k, k), box_size, &[group]);
    }
    d
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_flows_stands_in_its_row_and_column() {
        let flow = |from, to, signals: &[&str]| Flow {
            from,
            to,
            signals: signals.iter().map(|s| (*s).to_string()).collect(),
        };
        let flows = [flow(0, 1, &["v_x"]), flow(0, 2, &["a", "b", "c"]), flow(2, 0, &["due"])];
        let svg = computed(&["kinematics", "errors", "inversion"], &flows).to_svg("law");
        for text in ["kinematics", "inversion", "v_x", "3 signals", "due"] {
            assert!(svg.contains(text), "{text}");
        }
    }

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
