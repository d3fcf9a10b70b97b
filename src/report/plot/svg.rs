//! The little of SVG and typography that the plots need.

use std::fmt::Write as _;

/// Width of a run of text in a sans-serif face, as a multiple of the font size.
///
/// The widths are rounded up from common faces, because the reader's browser
/// chooses the face: a label may be given a little too much room, never too little.
pub(super) fn text_width(text: &str, font_size: f64) -> f64 {
    text.chars().map(glyph_width).sum::<f64>() * font_size
}

fn glyph_width(c: char) -> f64 {
    match c {
        'i' | 'j' | 'l' | '|' | '\'' | '.' | ',' | ':' | ';' | '!' => 0.32,
        ' ' | 'f' | 't' | 'r' | 'I' | '(' | ')' | '[' | ']' | '/' | '-' => 0.39,
        'm' | 'M' | 'W' | 'w' | '%' | '@' => 0.92,
        '−' | '+' | '=' | '<' | '>' | '×' | '≤' | '≥' | '±' => 0.76,
        'A'..='Z' => 0.72,
        '⁰'..='⁹' | '¹' | '²' | '³' | '⁻' | '°' => 0.42,
        _ => 0.62,
    }
}

/// Text made safe for element content and for attribute values.
///
/// Control characters that XML 1.0 forbids become U+FFFD.
pub(in crate::report) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\t' | '\n' | '\r' => out.push(' '),
            c if (c as u32) < 0x20 || c as u32 == 0xFFFE || c as u32 == 0xFFFF => {
                out.push('\u{FFFD}');
            }
            c => out.push(c),
        }
    }
    out
}

/// A coordinate in pixels with two fixed decimals and no negative zero.
pub(super) fn coordinate(value: f64) -> String {
    fixed(value, 2)
}

/// `value` with `decimals` decimals, ASCII minus, and no negative zero.
pub(super) fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.bytes().all(|b| b == b'0' || b == b'.') => rest.to_string(),
        _ => text,
    }
}

/// The text with a true minus sign instead of a leading hyphen.
pub(super) fn typographic(number: &str) -> String {
    match number.strip_prefix('-') {
        Some(rest) => format!("−{rest}"),
        None => number.to_string(),
    }
}

/// A rectangle in pixels, y down.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    pub x: f64,
    pub y: f64,
    pub width: f64,
    pub height: f64,
}

impl Frame {
    pub fn right(&self) -> f64 {
        self.x + self.width
    }

    pub fn bottom(&self) -> f64 {
        self.y + self.height
    }

    pub fn grown(&self, by: f64) -> Self {
        Self {
            x: self.x - by,
            y: self.y - by,
            width: self.width + 2.0 * by,
            height: self.height + 2.0 * by,
        }
    }

    pub fn overlaps(&self, other: &Self) -> bool {
        self.x < other.right()
            && other.x < self.right()
            && self.y < other.bottom()
            && other.y < self.bottom()
    }

    pub fn contains(&self, [x, y]: [f64; 2]) -> bool {
        x >= self.x && x <= self.right() && y >= self.y && y <= self.bottom()
    }
}

/// The part of the segment `a`-`b` inside `frame` (Liang and Barsky), if any.
pub(super) fn clip_segment(frame: &Frame, a: [f64; 2], b: [f64; 2]) -> Option<[[f64; 2]; 2]> {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for (p, q) in [
        (-dx, a[0] - frame.x),
        (dx, frame.right() - a[0]),
        (-dy, a[1] - frame.y),
        (dy, frame.bottom() - a[1]),
    ] {
        if p == 0.0 {
            if q < 0.0 {
                return None;
            }
        } else if p < 0.0 {
            enter = enter.max(q / p);
        } else {
            leave = leave.min(q / p);
        }
    }
    if enter > leave {
        return None;
    }
    // The ends themselves are kept exactly, so that joined segments stay joined.
    let at = |t: f64| {
        if t == 0.0 {
            a
        } else if t == 1.0 {
            b
        } else {
            [a[0] + t * dx, a[1] + t * dy]
        }
    };
    Some([at(enter), at(leave)])
}

/// The polygon inside `frame` (Sutherland and Hodgman), possibly empty.
pub(super) fn clip_polygon(frame: &Frame, polygon: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut points = polygon.to_vec();
    // (axis, bound, sign): inside where sign * (p[axis] - bound) >= 0.
    for (axis, bound, sign) in
        [(0, frame.x, 1.0), (0, frame.right(), -1.0), (1, frame.y, 1.0), (1, frame.bottom(), -1.0)]
    {
        let inside = |p: &[f64; 2]| sign * (p[axis] - bound) >= 0.0;
        let mut kept = Vec::with_capacity(points.len() + 4);
        for i in 0..points.len() {
            let from = points[(i + points.len() - 1) % points.len()];
            let to = points[i];
            if inside(&from) != inside(&to) {
                let t = (bound - from[axis]) / (to[axis] - from[axis]);
                let mut cut = [from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1])];
                cut[axis] = bound;
                kept.push(cut);
            }
            if inside(&to) {
                kept.push(to);
            }
        }
        points = kept;
    }
    points
}

/// The `d` attribute of an open polyline with gaps.
///
/// Points that are not finite lift the pen. Everything outside `frame` is cut
/// away exactly, so that a curve leaving the frame leaves at its true slope.
pub(super) fn polyline(frame: &Frame, points: &[[f64; 2]]) -> String {
    let mut d = String::new();
    let mut pen: Option<[f64; 2]> = None;
    for pair in points.windows(2) {
        let [a, b] = [pair[0], pair[1]];
        if !(a[0].is_finite() && a[1].is_finite() && b[0].is_finite() && b[1].is_finite()) {
            pen = None;
            continue;
        }
        let Some([from, to]) = clip_segment(frame, a, b) else {
            pen = None;
            continue;
        };
        if pen != Some(from) {
            let _ = write!(d, "M{} {}", coordinate(from[0]), coordinate(from[1]));
            pen = Some(from);
        }
        // Steps below the resolution of the output would only swell the file.
        if (to[0] - from[0]).abs() < 0.005 && (to[1] - from[1]).abs() < 0.005 && to == b {
            continue;
        }
        let _ = write!(d, "L{} {}", coordinate(to[0]), coordinate(to[1]));
        pen = Some(to);
    }
    d
}

/// Curves with more points than this are thinned.
const MANY_POINTS: usize = 4000;
/// Width of the slices in which points are thinned, px.
const SLICE: f64 = 0.5;

/// A dense curve without the points that nobody can see.
///
/// In every slice of half a pixel the first, lowest, highest and last point
/// stay, so that no peak is lost. Curves that turn back in x are left as they are.
pub(super) fn thinned(points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    let forward = points
        .windows(2)
        .all(|p| !(p[0][0].is_finite() && p[1][0].is_finite()) || p[1][0] >= p[0][0]);
    if points.len() <= MANY_POINTS || !forward {
        return points;
    }
    let finite = |p: &[f64; 2]| p[0].is_finite() && p[1].is_finite();
    let together = |a: &[f64; 2], b: &[f64; 2]| {
        finite(a) == finite(b) && (!finite(a) || (a[0] / SLICE).floor() == (b[0] / SLICE).floor())
    };
    let mut kept = Vec::new();
    for slice in points.chunk_by(together) {
        let last = slice.len() - 1;
        let by_height = |a: &usize, b: &usize| slice[*a][1].total_cmp(&slice[*b][1]);
        let lowest = (0..=last).min_by(by_height).unwrap_or(0);
        let highest = (0..=last).max_by(by_height).unwrap_or(last);
        let mut indices = [0, lowest, highest, last];
        indices.sort_unstable();
        for (i, index) in indices.into_iter().enumerate() {
            if i == 0 || index != indices[i - 1] {
                kept.push(slice[index]);
            }
        }
    }
    kept
}

/// The `d` attribute of a closed polygon cut to `frame`.
pub(super) fn polygon(frame: &Frame, points: &[[f64; 2]]) -> String {
    let finite: Vec<[f64; 2]> =
        points.iter().copied().filter(|p| p[0].is_finite() && p[1].is_finite()).collect();
    let inside = clip_polygon(frame, &finite);
    let mut d = String::new();
    for (i, p) in inside.iter().enumerate() {
        let command = if i == 0 { 'M' } else { 'L' };
        let _ = write!(d, "{command}{} {}", coordinate(p[0]), coordinate(p[1]));
    }
    if !d.is_empty() {
        d.push('Z');
    }
    d
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const FRAME: Frame = Frame { x: 0.0, y: 0.0, width: 100.0, height: 50.0 };

    #[test]
    fn a_segment_is_cut_at_its_true_slope_and_not_clamped() {
        // y = 2 x from (-10, -20) to (60, 120) meets the frame at (0, 0) and (25, 50).
        let [a, b] = clip_segment(&FRAME, [-10.0, -20.0], [60.0, 120.0]).unwrap();
        assert!((a[0]).abs() < 1e-12 && (a[1]).abs() < 1e-12);
        assert!((b[0] - 25.0).abs() < 1e-12 && (b[1] - 50.0).abs() < 1e-12);
    }

    #[test]
    fn a_segment_that_passes_a_corner_outside_is_dropped() {
        assert_eq!(clip_segment(&FRAME, [-10.0, 5.0], [5.0, -10.0]), None);
        assert_eq!(clip_segment(&FRAME, [0.0, 60.0], [100.0, 60.0]), None);
    }

    #[test]
    fn cutting_a_polygon_keeps_the_area_inside() {
        // A diamond about (0, 25) with half-width 20: its right half is inside.
        let diamond = [[-20.0, 25.0], [0.0, 5.0], [20.0, 25.0], [0.0, 45.0]];
        let cut = clip_polygon(&FRAME, &diamond);
        let area: f64 = (0..cut.len())
            .map(|i| {
                let (p, q) = (cut[i], cut[(i + 1) % cut.len()]);
                0.5 * (p[0] * q[1] - q[0] * p[1])
            })
            .sum();
        assert!((area.abs() - 400.0).abs() < 1e-9, "{area}");
    }

    #[test]
    fn thinning_keeps_every_peak_and_every_gap() {
        let mut points: Vec<[f64; 2]> = (0..50_000)
            .map(|i| [f64::from(i) * 0.002, 25.0 + 5.0 * (f64::from(i) * 0.01).sin()])
            .collect();
        points[12_345][1] = 49.0;
        points[23_456][1] = 1.0;
        points[34_567][1] = f64::NAN;
        let thin = thinned(points.clone());
        assert!(thin.len() < 1000, "{}", thin.len());
        assert!(thin.contains(&points[12_345]) && thin.contains(&points[23_456]));
        assert_eq!(thin.iter().filter(|p| p[1].is_nan()).count(), 1);
        assert_eq!((thin[0], thin[thin.len() - 1]), (points[0], points[49_999]));
        // A curve that turns back keeps all its points.
        let spiral: Vec<[f64; 2]> = (0..5000).map(|i| [f64::from(i).sin(), 0.0]).collect();
        assert_eq!(thinned(spiral.clone()), spiral);
    }

    proptest! {
        #[test]
        fn what_is_left_of_a_segment_is_inside_and_on_its_line(
            a in prop::array::uniform2(-300.0..300.0f64), b in prop::array::uniform2(-300.0..300.0f64),
        ) {
            if let Some(ends) = clip_segment(&FRAME, a, b) {
                for p in ends {
                    prop_assert!(FRAME.grown(1e-9).contains(p), "{p:?}");
                    let cross = (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]);
                    prop_assert!(cross.abs() < 1e-6, "{cross}");
                }
            } else {
                // Nothing of it is inside, as many points along it confirm.
                for i in 0..=200 {
                    let t = f64::from(i) / 200.0;
                    let p = [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])];
                    prop_assert!(!FRAME.contains(p));
                }
            }
        }
    }

    #[test]
    fn a_gap_lifts_the_pen() {
        let d =
            polyline(&FRAME, &[[1.0, 1.0], [2.0, 2.0], [f64::NAN, 3.0], [4.0, 4.0], [5.0, 5.0]]);
        assert_eq!(d, "M1.00 1.00L2.00 2.00M4.00 4.00L5.00 5.00");
    }

    #[test]
    fn no_number_is_minus_zero() {
        assert_eq!(fixed(-0.0004, 2), "0.00");
        assert_eq!(fixed(-0.006, 2), "-0.01");
        assert_eq!(fixed(-0.0, 0), "0");
    }

    #[test]
    fn text_is_escaped_and_forbidden_characters_are_replaced() {
        assert_eq!(
            escape("a<b & \"c\" > 'd'\u{1}"),
            "a&lt;b &amp; &quot;c&quot; &gt; &#39;d&#39;\u{FFFD}"
        );
    }
}
