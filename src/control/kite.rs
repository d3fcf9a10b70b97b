//! The region around −1 that a loop must keep out of.
//!
//! Gain margins g↑, g↓ and a phase margin ψ span a convex kite with the
//! vertices −g↓, −cos ψ ± j sin ψ and −1/g↑. A Nyquist curve that stays
//! outside meets all three margins, and their combinations too.

use num_complex::Complex64 as C;

/// |z| without the care of [`C::norm`] about overflow: a quarter of its time.
pub(super) fn magnitude(z: C) -> f64 {
    z.norm_sqr().sqrt()
}

/// A convex polygon that contains −1.
#[derive(Debug, Clone, PartialEq)]
pub struct Kite {
    vertices: Vec<C>,
    /// Change of each vertex with the phase margin, 1/rad, and with the
    /// logarithm of both gain margins.
    slopes: Vec<[C; 2]>,
    /// Distance of the farthest vertex from −1.
    radius: f64,
    /// Outward unit normal of the edge from each vertex to the next.
    normals: Vec<C>,
}

/// A unit normal and the signed separation it gives: positive where it
/// separates, minus the penetration where nothing does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Separation {
    /// Unit normal, pointing away from the kite.
    pub normal: C,
    /// Least distance of the segment from the kite's supporting line.
    pub distance: f64,
}

/// A normal may be used only if both ends of the segment lie at least this
/// far on its side of −1: else it would push the curve across the point.
const SIDE_TOLERANCE: f64 = 1e-3;

/// How much more the normal across the segment is favoured where the choice
/// is free: nearest-point normals stall at a vertex of the kite.
const ACROSS_BONUS: f64 = 0.05;

impl Kite {
    /// Kite of gain margins (factors ≥ 1) and a phase margin (rad).
    pub fn new(gain_up: f64, gain_down: f64, phase: f64) -> Self {
        let (sin, cos) = phase.sin_cos();
        // Counter-clockwise from the left.
        let zero = C::new(0.0, 0.0);
        let mut vertices = vec![C::new(-gain_down, 0.0), C::new(-cos, -sin)];
        let mut slopes = vec![[zero, C::new(-gain_down, 0.0)], [C::new(sin, -cos), zero]];
        if -1.0 / gain_up > -cos + 1e-9 {
            vertices.push(C::new(-1.0 / gain_up, 0.0));
            slopes.push([zero, C::new(1.0 / gain_up, 0.0)]);
        }
        vertices.push(C::new(-cos, sin));
        slopes.push([C::new(sin, cos), zero]);
        let n = vertices.len();
        let normals = (0..n)
            .map(|k| {
                let e = vertices[(k + 1) % n] - vertices[k];
                C::new(0.0, -1.0) * e / e.norm()
            })
            .collect();
        let radius = vertices.iter().map(|z| (z + 1.0).norm()).fold(0.0, f64::max);
        Self { vertices, slopes, radius, normals }
    }

    /// Vertices, counter-clockwise.
    pub fn vertices(&self) -> &[C] {
        &self.vertices
    }

    /// Vertices, and how each moves with the phase margin, 1/rad, and with the
    /// logarithm of both gain margins.
    pub fn vertices_with_slopes(&self) -> impl Iterator<Item = (C, [C; 2])> + '_ {
        self.vertices.iter().copied().zip(self.slopes.iter().copied())
    }

    fn support(&self, normal: C) -> f64 {
        self.vertices.iter().map(|z| (normal.conj() * z).re).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Whether the segment a–b is so far from −1 that no kite of this size can
    /// be within `distance` of it: the quick answer for most of a curve.
    pub fn is_far(&self, a: C, b: C, distance: f64) -> bool {
        let near = (a + 1.0).norm_sqr().min((b + 1.0).norm_sqr()).sqrt();
        near - magnitude(b - a) > self.radius + distance
    }

    /// Signed separation of the segment a–b from the kite: exact in sign, and
    /// exactly the penetration depth where they overlap (the axes of the
    /// separating-axis theorem are the edges' normals and the segment's).
    pub fn separation(&self, a: C, b: C) -> f64 {
        self.axes(a, b).map(|(n, _)| self.score(n, a, b)).fold(f64::NEG_INFINITY, f64::max)
    }

    fn score(&self, normal: C, a: C, b: C) -> f64 {
        let n = normal.conj();
        (n * a).re.min((n * b).re) - self.support(normal)
    }

    /// Candidate normals, with whether each is across the segment.
    fn axes(&self, a: C, b: C) -> impl Iterator<Item = (C, bool)> + '_ {
        let e = b - a;
        let length = magnitude(e);
        let n = C::new(0.0, 1.0) * e / length.max(1e-300);
        let across = [(n, true), (-n, true)].into_iter().filter(move |_| length > 1e-15);
        self.normals.iter().map(|&n| (n, false)).chain(across)
    }

    /// The normal to keep the segment outside with, and its separation. None
    /// of the candidates may have −1 on the wrong side; failing all, the
    /// direction from −1 to the segment's middle is used.
    pub fn separating_normal(&self, a: C, b: C) -> Separation {
        let mut best = (f64::NEG_INFINITY, None);
        let nearest = [a, b].map(|p| self.nearest_direction(p));
        let candidates = self.axes(a, b).chain(nearest.into_iter().flatten().map(|n| (n, false)));
        for (n, across) in candidates {
            let side = |p: C| (n.conj() * (p + 1.0)).re > SIDE_TOLERANCE;
            if !side(a) || !side(b) {
                continue;
            }
            let distance = self.score(n, a, b);
            let rank = distance + if across { ACROSS_BONUS } else { 0.0 };
            if rank > best.0 {
                best = (rank, Some(Separation { normal: n, distance }));
            }
        }
        best.1.unwrap_or_else(|| {
            let middle = 0.5 * (a + b) + 1.0;
            let normal = middle / middle.norm().max(1e-12);
            Separation { normal, distance: self.score(normal, a, b) }
        })
    }

    /// Unit vector from the kite's nearest point to p, if p is outside.
    fn nearest_direction(&self, p: C) -> Option<C> {
        let n = self.vertices.len();
        if (0..n).all(|k| (self.normals[k].conj() * (p - self.vertices[k])).re <= 0.0) {
            return None;
        }
        let mut best = (f64::INFINITY, None);
        for k in 0..n {
            let (z, e) = (self.vertices[k], self.vertices[(k + 1) % n] - self.vertices[k]);
            let t = (((p - z) * e.conj()).re / e.norm_sqr()).clamp(0.0, 1.0);
            let d = p - (z + e * t);
            let distance = magnitude(d);
            if distance < best.0 && distance > 1e-12 {
                best = (distance, Some(d / distance));
            }
        }
        best.1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn separation_has_the_right_sign_and_depth() {
        let k = Kite::new(2.0, 2.0, 0.25 * std::f64::consts::PI);
        // Through −1 vertically: deeper than the kite's half diagonal allows.
        assert!(k.separation(C::new(-1.0, -0.1), C::new(-1.0, 0.1)) < -0.3);
        // Just right of the right vertex.
        let s = k.separation(C::new(-0.49, -0.2), C::new(-0.49, 0.2));
        assert!((s - 0.01).abs() < 1e-12, "{s}");
        // A segment whose ends are both outside but which cuts the kite.
        assert!(k.separation(C::new(-1.0, 1.2), C::new(-1.0, -1.2)) < 0.0);
        let n = k.separating_normal(C::new(-0.3, -0.2), C::new(-0.3, 0.2));
        assert!((n.normal - 1.0).norm() < 1e-12);
    }

    /// The slopes are the differences of neighbouring kites.
    #[test]
    fn vertices_move_as_their_slopes_say() {
        let (g, p, h) = (2.0, 0.8, 1e-6);
        let base: Vec<_> = Kite::new(g, g, p).vertices_with_slopes().collect();
        let phase = Kite::new(g, g, p + h);
        let gain = Kite::new(g * f64::exp(h), g * f64::exp(h), p);
        for (k, (z, slopes)) in base.iter().enumerate() {
            assert!(((phase.vertices()[k] - z) / h - slopes[0]).norm() < 1e-5);
            assert!(((gain.vertices()[k] - z) / h - slopes[1]).norm() < 1e-5);
        }
    }

    /// A margin vertex hidden behind the phase margin's chord is left out.
    #[test]
    fn hull_stays_convex_when_the_gain_margin_is_small() {
        let k = Kite::new(1.1, 2.0, 0.25 * std::f64::consts::PI);
        assert_eq!(k.vertices().len(), 3);
    }
}
