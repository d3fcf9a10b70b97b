//! Plants made from published matrices, to develop and test the tuning on.
//!
//! The residualised hover and forward-flight matrices of the reference paper's
//! appendix, linear in speed between (the forward ones at 70 kt, which their
//! own speed entries say), with lags in the effectors that stand for rotor
//! flapping and inflow. They are a test bed, not the aircraft: the product
//! tunes on the models that [`crate::linear`] derives.

use super::plant::Hardware;
use super::plant::{Matrix8, Matrix8x4, ModelClass, ModelInfo, ModelSet, Plant, TrimPoint, rigid};
use crate::linear::io::set_from_json;
use crate::units::{FOOT, KNOT};
use nalgebra::DMatrix;
use std::sync::LazyLock;

/// Speed of the appendix's forward-flight matrices by their own entries
/// A(w,q) ≈ u₀, A(v,r) ≈ −u₀, m/s.
const FORWARD_SPEED: f64 = 117.33 * FOOT;

/// The printed models of hover and forward flight, SI: A and B.
static PRINTED: LazyLock<[(Matrix8, Matrix8x4); 2]> = LazyLock::new(|| {
    let set = set_from_json(include_str!("../studies/coax2d/appendix.json"))
        .unwrap_or_else(|error| unreachable!("the printed models: {error}"));
    [0, 1].map(|k| {
        let model = &set.models()[k];
        (Matrix8::from_fn(|i, j| model.a()[(i, j)]), Matrix8x4::from_fn(|i, j| model.b()[(i, j)]))
    })
});

/// A variation of the test-bed plant.
#[derive(Debug, Clone, Copy)]
pub struct Variation {
    /// Mass and inertia over nominal.
    pub mass: f64,
    /// Factors on the effectiveness of lat, lon, col, ped.
    pub effectiveness: [f64; 4],
    /// Flapping lag of the cyclic sticks, s.
    pub flap_lag: f64,
}

/// The nominal plant.
pub const NOMINAL: Variation = Variation { mass: 1.0, effectiveness: [1.0; 4], flap_lag: 0.047 };

/// The lags assumed for the default hardware.
pub const HARDWARE: Hardware = Hardware {
    actuator_bandwidth: 30.0,
    actuator_damping: 0.8,
    delay: 0.035,
    sensor_bandwidth: 60.0,
};

/// The test-bed plant at a true airspeed in m/s.
pub fn plant(speed: f64, variation: &Variation) -> Plant {
    let [(a0, b0), (a1, b1)] = *PRINTED;
    let f = speed / FORWARD_SPEED;
    let (a, b) = (a0 + (a1 - a0) * f, b0 + (b1 - b0) * f);
    // Kinematics and gravity stay; what is left are forces per mass.
    let pitch = a[(rigid::PHI, rigid::R)].atan();
    let velocity = [speed, 0.0, speed * pitch.tan()];
    let mut kinematic = Matrix8::zeros();
    for (i, j) in [
        (rigid::U, rigid::THETA),
        (rigid::V, rigid::PHI),
        (rigid::W, rigid::PHI),
        (rigid::W, rigid::THETA),
    ] {
        kinematic[(i, j)] = a[(i, j)];
    }
    for i in [rigid::PHI, rigid::THETA] {
        kinematic.set_row(i, &a.row(i));
    }
    kinematic[(rigid::W, rigid::Q)] = velocity[0];
    kinematic[(rigid::V, rigid::R)] = -velocity[0];
    kinematic[(rigid::U, rigid::Q)] = -velocity[2];
    kinematic[(rigid::V, rigid::P)] = velocity[2];
    let a = kinematic + (a - kinematic) / variation.mass;
    let mut b = b / variation.mass;
    for (j, factor) in variation.effectiveness.iter().enumerate() {
        b.column_mut(j).scale_mut(*factor);
    }
    // Effector lags: flapping in the cyclics, a lead-lag of heave damping and
    // inflow in collective, inflow in pedal: d = direct + (1 - direct)/(τ s + 1).
    let lags =
        [(0.0, variation.flap_lag), (0.0, variation.flap_lag), (0.12 / 0.07, 0.07), (0.0, 0.05)];
    let mut full_a = DMatrix::zeros(12, 12);
    let mut full_b = DMatrix::zeros(12, 4);
    full_a.view_mut((0, 0), (8, 8)).copy_from(&a);
    for (j, (direct, tau)) in lags.into_iter().enumerate() {
        full_a[(8 + j, 8 + j)] = -1.0 / tau;
        full_b[(8 + j, j)] = 1.0 / tau;
        for i in 0..8 {
            full_a[(i, 8 + j)] = b[(i, j)] * (1.0 - direct);
            full_b[(i, j)] = b[(i, j)] * direct;
        }
    }
    Plant {
        speed,
        a: full_a,
        b: full_b,
        measured: std::array::from_fn(|i| i),
        reduced_a: a,
        reduced_b: b,
        trim: TrimPoint {
            velocity_body: velocity,
            roll: 0.0,
            pitch,
            sticks: [0.0, 0.0, 50.0, 0.0],
        },
    }
}

/// The nominal model, and with `robust` four variations, at speeds in knots.
pub fn model_set(speeds_kt: &[f64], robust: bool) -> ModelSet {
    let mut list = vec![("nominal", NOMINAL, 0.0)];
    if robust {
        list.push(("mass+10%", Variation { mass: 1.1, ..NOMINAL }, 0.0));
        list.push(("mass-10%", Variation { mass: 0.9, ..NOMINAL }, 0.0));
        let effectiveness = [0.85, 0.95, 0.85, 0.85];
        list.push(("interactions off", Variation { effectiveness, ..NOMINAL }, 0.0));
        list.push(("slow", Variation { flap_lag: 0.060, ..NOMINAL }, 0.010));
    }
    ModelSet {
        models: list
            .iter()
            .map(|&(name, _, extra_delay)| ModelInfo {
                name: name.into(),
                class: if name == "nominal" { ModelClass::Nominal } else { ModelClass::OffNominal },
                extra_delay,
            })
            .collect(),
        plants: speeds_kt
            .iter()
            .map(|kt| list.iter().map(|(_, v, _)| plant(kt * KNOT, v)).collect())
            .collect(),
    }
}
