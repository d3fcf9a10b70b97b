//! Plants made from published matrices, to develop and test the tuning on.
//!
//! The residualised hover and forward-flight matrices of the reference paper's
//! appendix, linear in speed between (the forward ones at 70 kt, which their
//! own speed entries say), with lags in the effectors that stand for rotor
//! flapping and inflow. They are a test bed, not the aircraft: the product
//! tunes on the models that [`crate::linear`] derives.

use super::plant::Hardware;
use super::plant::{Matrix8, Matrix8x4, ModelClass, ModelInfo, ModelSet, Plant, TrimPoint, rigid};
use crate::units::{FOOT, KNOT};
use nalgebra::DMatrix;

/// Speed of the appendix's forward-flight matrices by their own entries
/// A(w,q) ≈ u₀, A(v,r) ≈ −u₀, m/s.
const FORWARD_SPEED: f64 = 117.33 * FOOT;

#[rustfmt::skip]
const A_HOVER: [f64; 64] = [
    -0.0079, 0.0098, 0.0014, 0.2365, 0.6854, 0.0287, 0.0, -32.17,
    0.0045, -0.0099, 0.0007, -0.3045, -0.0294, -0.0154, 32.17, 0.0,
    -0.0639, 0.0021, -0.0172, -0.0150, 0.3094, 0.1049, 0.0015, -0.0084,
    -0.0014, -0.0013, -0.0008, -0.1126, 0.1021, -0.0225, 0.0, 0.0,
    0.0005, -0.0014, -0.0003, -0.0653, -0.0957, -0.0056, 0.0, 0.0,
    0.0006, 0.0004, -0.0036, -0.0201, 0.0139, -0.0946, 0.0, 0.0,
    0.0, 0.0, 0.0, 1.0, 0.0, 0.0003, 0.0, 0.0,
    0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0,
];
#[rustfmt::skip]
const B_HOVER: [f64; 32] = [
    0.0194, -0.6596, -0.0004, 0.0,
    0.2363, 0.0001, -0.0001, 0.0,
    -0.0015, -0.0631, -1.6552, 0.3480,
    0.1839, 0.0006, -0.0002, 0.0049,
    -0.0014, 0.0814, 0.0001, 0.0,
    0.0379, 0.0014, -0.0009, 0.0256,
    0.0, 0.0, 0.0, 0.0,
    0.0, 0.0, 0.0, 0.0,
];
#[rustfmt::skip]
const A_FORWARD: [f64; 64] = [
    -0.0764, 0.0, 0.0569, -0.0032, 8.7042, 0.0041, 0.0, -32.1016,
    -0.0003, -0.0983, 0.0008, -8.4619, 0.0021, -117.2804, 32.1016, -0.0013,
    0.0478, -0.0002, -1.5518, 0.0773, 117.1017, 0.0140, 0.0199, 2.0971,
    0.0002, 0.0107, 0.0009, -0.2150, 0.0491, -0.1385, 0.0, 0.0,
    0.0031, 0.0002, -0.0322, -0.0308, -0.3888, -0.0065, 0.0, 0.0,
    0.0, 0.0357, 0.0005, -0.1600, 0.0065, -0.4482, 0.0, 0.0,
    0.0, 0.0, 0.0, 1.0, 0.0, -0.0653, 0.0, 0.0,
    0.0, 0.0, 0.0, 0.0, 1.0, 0.0006, 0.0, 0.0,
];
#[rustfmt::skip]
const B_FORWARD: [f64; 32] = [
    0.0238, -0.3477, 0.1617, -0.0356,
    0.0045, 0.0046, 0.0031, -0.0013,
    -0.1717, -4.0453, -2.8214, 0.6238,
    0.1343, 0.0018, -0.0006, 0.0039,
    -0.0021, 0.0412, -0.0190, 0.0060,
    0.0276, 0.0006, -0.0001, 0.0204,
    0.0, 0.0, 0.0, 0.0,
    0.0, 0.0, 0.0, 0.0,
];

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

/// Rows of ft-based states to SI: velocities in ft/s become m/s.
fn to_si(a: &[f64; 64], b: &[f64; 32]) -> (Matrix8, Matrix8x4) {
    let scale = |i: usize| if i < rigid::P { FOOT } else { 1.0 };
    let mut sa = Matrix8::from_row_slice(a);
    let mut sb = Matrix8x4::from_row_slice(b);
    for i in 0..8 {
        for j in 0..8 {
            sa[(i, j)] *= scale(i) / scale(j);
        }
        for j in 0..4 {
            sb[(i, j)] *= scale(i);
        }
    }
    (sa, sb)
}

/// The test-bed plant at a true airspeed in m/s.
pub fn plant(speed: f64, variation: &Variation) -> Plant {
    let (a0, b0) = to_si(&A_HOVER, &B_HOVER);
    let (a1, b1) = to_si(&A_FORWARD, &B_FORWARD);
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
