//! Frames: body, hub, mirrored hub.
//!
//! The body frame has x forward, y to starboard, z down. A hub frame follows
//! from it by cant φ_m about x and tilt β_m about y (Eqs. 1–4). The theory of
//! a rotor is written for counter-clockwise rotation seen from above; a
//! clockwise rotor lives in the mirror image of its hub frame, y reversed.

use crate::problem::{Direction, Station};

/// A matrix of rows.
pub type Matrix3 = [[f64; 3]; 3];

/// Position of a station from the centre of gravity, body frame, m.
#[must_use]
pub fn position_body(station: &Station, center_of_gravity: &Station) -> [f64; 3] {
    [
        center_of_gravity.fuselage_station - station.fuselage_station,
        station.butt_line - center_of_gravity.butt_line,
        center_of_gravity.water_line - station.water_line,
    ]
}

/// Rotation from the body frame to a hub frame, Eq. 3.
#[must_use]
pub fn body_to_hub(cant: f64, tilt: f64) -> Matrix3 {
    let (sc, cc) = cant.sin_cos();
    let (st, ct) = tilt.sin_cos();
    [[ct, st * sc, -st * cc], [0.0, cc, sc], [st, -ct * sc, ct * cc]]
}

/// Rotation about x, from the body frame to one canted by an angle, rad.
#[must_use]
pub fn about_x(angle: f64) -> Matrix3 {
    let (s, c) = angle.sin_cos();
    [[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]]
}

/// Rotation about y by an angle, rad, nose up positive.
#[must_use]
pub fn about_y(angle: f64) -> Matrix3 {
    let (s, c) = angle.sin_cos();
    [[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]]
}

/// Matrix product.
#[must_use]
pub fn product(a: &Matrix3, b: &Matrix3) -> Matrix3 {
    let mut c = [[0.0; 3]; 3];
    for (row, out) in a.iter().zip(&mut c) {
        for (j, value) in out.iter_mut().enumerate() {
            *value = row[0] * b[0][j] + row[1] * b[1][j] + row[2] * b[2][j];
        }
    }
    c
}

/// From the body frame to a rotor's own, perhaps mirrored, hub frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HubFrame {
    /// Rows map velocities and forces of the body frame.
    pub polar: Matrix3,
    /// +1 where the frame is right-handed, −1 where it is mirrored: rates and
    /// moments map by `handedness · polar`.
    pub handedness: f64,
}

impl HubFrame {
    /// The frame of a rotor with the given cant and tilt, rad.
    #[must_use]
    pub fn new(cant: f64, tilt: f64, direction: Direction) -> Self {
        let mut polar = body_to_hub(cant, tilt);
        let handedness = match direction {
            Direction::CounterClockwise => 1.0,
            Direction::Clockwise => {
                for entry in &mut polar[1] {
                    *entry = -*entry;
                }
                -1.0
            }
        };
        Self { polar, handedness }
    }

    /// An angular velocity of the body frame in the hub frame.
    #[inline(always)]
    #[must_use]
    pub fn rate_hub(&self, rate_body: [f64; 3]) -> [f64; 3] {
        self.polar.map(|row| {
            self.handedness
                * (row[0] * rate_body[0] + row[1] * rate_body[1] + row[2] * rate_body[2])
        })
    }

    /// Rows map rates and moments of the body frame.
    #[must_use]
    pub fn axial(&self) -> Matrix3 {
        self.polar.map(|row| row.map(|entry| self.handedness * entry))
    }
}
