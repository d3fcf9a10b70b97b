//! The place that all pairs of disks which lie alike have in common.
//!
//! Lengths count in source radii. The source turns counter-clockwise: a pair of
//! which it does not is mirrored in y = 0. The pair is turned about the source's
//! shaft until the receiver's hub lies aft, at azimuth zero; where it then leans
//! to port it is mirrored once more. The receiver's own azimuth is turned until
//! its axes come from the source's by the shortest rotation from shaft to shaft.
//! With φ the azimuth of the receiver, α the turn of its own azimuth, and R(·)
//! the rotation of the harmonics,
//!
//! ```text
//! G(X) = S R(α) [D] G_c([D] R(−φ) X) [D] R(−φ),
//! ```
//!
//! where D = diag(1, 1, −1) stands for the second mirror, and S = D if the senses
//! of rotation differ.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::coaxial::CoaxialMap;
use super::general::{SeenDisk, general_map};
use super::{COAXIAL_OFFSET, COAXIAL_TILT, DiskGeometry, GeometryError, Map};
use crate::problem::InterferenceRule;

/// Pairs nearer to one another than this in every length (source radii) and
/// direction cosine are the same.
const SAME: f64 = 1e-9;

/// A pair without the turn, mirror, size and senses of rotation that do not
/// matter.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Canonical {
    Coaxial {
        /// The receiver above, source radii.
        height: f64,
        /// Of the receiver, source radii.
        radius: f64,
    },
    General {
        /// Of the receiver, source radii.
        radius: f64,
        /// Receiver's hub: aft of the source's and below it, source radii.
        aft: f64,
        down: f64,
        /// Receiver's shaft, x forward, y right, z down; y is never negative.
        shaft: [f64; 3],
    },
}

/// How a pair lies against its canonical place.
#[derive(Debug, Clone)]
pub(super) struct Placing {
    /// cos φ, sin φ.
    place: [f64; 2],
    /// cos α, sin α.
    turn: [f64; 2],
    /// −1 where the canonical pair is the mirror image.
    mirror: f64,
    /// −1 if the receiver's sense of rotation differs from the source's.
    pub(super) sine_sign: f64,
}

/// A rotation about z in axes x forward, y right, z down by +φ: it brings the
/// azimuth φ to zero.
fn about_shaft([cos, sin]: [f64; 2]) -> Matrix3<f64> {
    Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0)
}

impl Canonical {
    pub(super) fn of(geometry: &DiskGeometry) -> Result<(Self, Placing), GeometryError> {
        geometry.check()?;
        let radius = geometry.receiver_radius / geometry.source_radius;
        let scaled = geometry.offset / geometry.source_radius;
        let sine_sign =
            if geometry.source_mirrored == geometry.receiver_mirrored { 1.0 } else { -1.0 };
        let aside = scaled.x.hypot(scaled.y);
        let mut placing = Placing { place: [1.0, 0.0], turn: [1.0, 0.0], mirror: 1.0, sine_sign };
        let tilt = (geometry.receiver_axes - Matrix3::identity()).amax();
        if aside <= COAXIAL_OFFSET && tilt <= COAXIAL_TILT {
            return Ok((Self::Coaxial { height: -scaled.z, radius }, placing));
        }
        // As a counter-clockwise source sees it.
        let flip = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0));
        let (offset, axes) = if geometry.source_mirrored {
            (flip * scaled, flip * geometry.receiver_axes * flip)
        } else {
            (scaled, geometry.receiver_axes)
        };
        if aside > COAXIAL_OFFSET {
            placing.place = [-offset.x / aside, offset.y / aside];
        }
        let turned = about_shaft(placing.place) * axes;
        let mut shaft = turned.column(2).into_owned();
        let own = shortest(&shaft).transpose() * turned;
        let length = own[(0, 0)].hypot(own[(1, 0)]);
        placing.turn = [own[(0, 0)] / length, own[(1, 0)] / length];
        if shaft.y.abs() <= SAME {
            shaft.y = 0.0;
        } else if shaft.y < 0.0 {
            placing.mirror = -1.0;
            shaft.y = -shaft.y;
        }
        let (aft, down) = (if aside > COAXIAL_OFFSET { aside } else { 0.0 }, offset.z);
        Ok((Self::General { radius, aft, down, shaft: shaft.into() }, placing))
    }

    /// Whether two pairs are the same but for rounding.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        let all = |pairs: &[(f64, f64)]| pairs.iter().all(|(a, b)| (a - b).abs() <= SAME);
        match (self, other) {
            (Self::Coaxial { height, radius }, Self::Coaxial { height: h, radius: r }) => {
                all(&[(*height, *h), (*radius, *r)])
            }
            (
                Self::General { radius, aft, down, shaft: [x, y, z] },
                Self::General { radius: r, aft: a, down: d, shaft: [i, j, k] },
            ) => all(&[(*radius, *r), (*aft, *a), (*down, *d), (*x, *i), (*y, *j), (*z, *k)]),
            _ => false,
        }
    }

    pub(super) fn tabulate(&self, rule: InterferenceRule) -> Result<Map, GeometryError> {
        match self {
            Self::Coaxial { height, radius } => {
                Ok(Map::Coaxial(CoaxialMap::new(*height, *radius, rule)?))
            }
            Self::General { shaft, .. } => {
                Ok(Map::General(general_map(&self.disk(), shaft[1] == 0.0, rule)?))
            }
        }
    }

    /// The receiver in its canonical place.
    pub(super) fn disk(&self) -> SeenDisk {
        match *self {
            Self::Coaxial { height, radius } => SeenDisk {
                radius,
                offset: Vector3::new(0.0, 0.0, -height),
                axes: Matrix3::identity(),
            },
            Self::General { radius, aft, down, shaft } => SeenDisk {
                radius,
                offset: Vector3::new(-aft, 0.0, down),
                axes: shortest(&shaft.into()),
            },
        }
    }
}

/// The shortest rotation of z to a shaft; of a shaft turned upside down, half a
/// turn about x.
fn shortest(shaft: &Vector3<f64>) -> Matrix3<f64> {
    Rotation3::rotation_between(&Vector3::z(), shaft)
        .map_or_else(|| Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0)), |r| *r.matrix())
}

impl Placing {
    /// The skew (aft, right) as the canonical pair sees it.
    #[inline]
    pub(super) fn skew(&self, [aft, right]: [f64; 2]) -> [f64; 2] {
        let [cos, sin] = self.place;
        [cos * aft + sin * right, self.mirror * (cos * right - sin * aft)]
    }

    /// Derivatives by the skew (aft, right) from those by the canonical one.
    #[inline]
    pub(super) fn gradient(
        &self,
        by_aft: Matrix3<f64>,
        by_right: Matrix3<f64>,
    ) -> (Matrix3<f64>, Matrix3<f64>) {
        let [cos, sin] = self.place;
        let by_right = by_right * self.mirror;
        (by_aft * cos - by_right * sin, by_aft * sin + by_right * cos)
    }

    /// A canonical matrix, row by row, in the axes of the pair.
    #[inline]
    pub(super) fn matrix(&self, g: &[f64; 9]) -> Matrix3<f64> {
        let [cos, sin] = self.place;
        let [own_cos, own_sin] = self.turn;
        let m = self.mirror;
        let mut out = Matrix3::zeros();
        // Sources' harmonics, then the receiver's.
        let row = |k: usize| {
            let (c, s) = (g[3 * k + 1], m * g[3 * k + 2]);
            [g[3 * k], c * cos - s * sin, c * sin + s * cos]
        };
        let [mean, along, across] = [row(0), row(1), row(2)];
        for column in 0..3 {
            let (c, s) = (along[column], m * across[column]);
            out[(0, column)] = mean[column];
            out[(1, column)] = c * own_cos - s * own_sin;
            out[(2, column)] = self.sine_sign * (c * own_sin + s * own_cos);
        }
        out
    }
}
