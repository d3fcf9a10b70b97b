//! Legends: their entries, and where they cover the least.

use std::fmt::Write as _;

use super::super::axis::Map;
use super::super::colors::role;
use super::super::svg::{Frame, clip_segment, coordinate as px, text_width};
use super::super::{Item, Panel, Tone};
use super::ink::*;
use super::panel::Artist;

/// One line of a legend.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Entry {
    pub(super) label: String,
    pub(super) sample: Sample,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Sample {
    Curve {
        color: usize,
        dash: usize,
        marker: usize,
        has_line: bool,
        has_marks: bool,
        width: f64,
        opacity: f64,
    },
    Swatch(Tone),
}

pub(super) fn entries(panel: &Panel) -> Vec<Entry> {
    let mut found: Vec<Entry> = Vec::new();
    for item in &panel.items {
        let entry = match item {
            Item::Line(s) => Entry {
                label: s.label.clone(),
                sample: Sample::Curve {
                    color: s.color,
                    dash: s.dash,
                    marker: s.marker,
                    has_line: s.has_line,
                    has_marks: s.has_marks,
                    width: s.width,
                    opacity: s.opacity,
                },
            },
            Item::Region { label, tone, .. } | Item::Band { label, tone, .. } => {
                Entry { label: label.clone(), sample: Sample::Swatch(*tone) }
            }
            _ => continue,
        };
        if !entry.label.is_empty() && !found.contains(&entry) {
            found.push(entry);
        }
    }
    // Curves before regions.
    found.sort_by_key(|e| matches!(e.sample, Sample::Swatch(_)));
    found
}

pub(super) fn entry_width(entry: &Entry) -> f64 {
    LEGEND_SAMPLE + 6.0 + text_width(&plain(&entry.label), LEGEND_SIZE)
}

/// Draws the shared legend in lines from `start`; returns the y below it.
pub(super) fn legend_above(
    out: &mut String,
    shared: &[Entry],
    start: f64,
    top: f64,
    limit: f64,
) -> f64 {
    let gap = 20.0;
    let mut x = start;
    let mut y = top + LEGEND_LINE - 4.0;
    for entry in shared {
        let width = entry_width(entry);
        if x > start && x + width > limit {
            x = start;
            y += LEGEND_LINE;
        }
        legend_entry(out, entry, x, y);
        x += width + gap;
    }
    y + 6.0
}

pub(super) fn legend_entry(out: &mut String, entry: &Entry, x: f64, baseline: f64) {
    let middle = baseline - 3.6;
    match &entry.sample {
        Sample::Curve { color, dash, marker, has_line, has_marks, width, opacity } => {
            let _ = write!(out, "<g opacity=\"{opacity}\">");
            if *has_line {
                let d = rule([x, middle], [x + LEGEND_SAMPLE, middle]);
                let _ = write!(out, "{}", curve_path(&d, *color, *dash, *width));
            }
            if *has_marks {
                let _ = write!(
                    out,
                    "{}",
                    mark(*marker, *color, [x + 0.5 * LEGEND_SAMPLE, middle], *has_line, "")
                );
            }
            let _ = write!(out, "</g>");
        }
        Sample::Swatch(tone) => {
            let (class, color) = tone_color(*tone);
            let _ = write!(
                out,
                "<rect x=\"{}\" y=\"{}\" width=\"{LEGEND_SAMPLE}\" height=\"9\" \
                 class=\"cx-f-{class} cx-s-{class}\" fill=\"{color}\" fill-opacity=\"{}\" \
                 stroke=\"{color}\" stroke-opacity=\"0.5\" stroke-width=\"0.8\"/>",
                px(x),
                px(middle - 4.5),
                tone_opacity(*tone)
            );
        }
    }
    let _ = writeln!(
        out,
        "{}",
        text(x + LEGEND_SAMPLE + 6.0, baseline, "start", LEGEND_SIZE, "fg", &entry.label)
    );
}

impl Artist<'_> {
    pub(super) fn legend_in_corner(&mut self, to_x: &Map, to_y: &Map) {
        let list = entries(self.panel);
        if list.is_empty() {
            return;
        }
        let f = self.frame;
        let width = list.iter().map(entry_width).fold(0.0, f64::max) + 12.0;
        let height = list.len() as f64 * LEGEND_LINE + 6.0;
        let gap = 6.0;
        let samples = self.samples(to_x, to_y);
        let lefts = [f.right() - width - gap, f.x + gap, f.x + 0.5 * (f.width - width)];
        let tops = [f.y + gap, f.bottom() - height - gap];
        let mut best: Option<(usize, Frame)> = None;
        for left in lefts {
            for top in tops {
                let place = Frame { x: left, y: top, width, height };
                let near = place.grown(3.0);
                let covered = samples.iter().filter(|p| near.contains(**p)).count();
                if best.as_ref().is_none_or(|(least, _)| covered < *least) {
                    best = Some((covered, place));
                }
            }
        }
        let Some((_, place)) = best else { return };
        self.put(&format!(
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" rx=\"2\" \
             class=\"cx-f-bg cx-s-grid\" fill=\"{}\" fill-opacity=\"0.88\" stroke=\"{}\" \
             stroke-width=\"0.8\"/>",
            px(place.x),
            px(place.y),
            px(width),
            px(height),
            role("bg"),
            role("grid")
        ));
        for (i, entry) in list.iter().enumerate() {
            let baseline = place.y + 14.0 + i as f64 * LEGEND_LINE;
            legend_entry(self.out, entry, place.x + 6.0, baseline);
        }
    }

    /// Pixels covered by curves, marks and text, to keep the legend off them.
    fn samples(&self, to_x: &Map, to_y: &Map) -> Vec<[f64; 2]> {
        const SPACING: f64 = 4.0;
        let mut found = Vec::new();
        for item in &self.panel.items {
            match item {
                Item::Line(series) => {
                    let pixels: Vec<[f64; 2]> = series
                        .points
                        .iter()
                        .map(|p| [to_x.pixel(p[0]), to_y.pixel(p[1])])
                        .collect();
                    if series.has_marks {
                        // A mark weighs as much as the ink of its outline.
                        found.extend(pixels.iter().flat_map(|p| [*p; 4]));
                    }
                    if series.has_line {
                        for pair in pixels.windows(2) {
                            let finite = pair.iter().flatten().all(|v| v.is_finite());
                            if let (true, Some([a, b])) =
                                (finite, clip_segment(&self.frame, pair[0], pair[1]))
                            {
                                let length = (b[0] - a[0]).hypot(b[1] - a[1]);
                                let count = (length / SPACING).ceil().max(1.0);
                                found.extend((0..count as usize).map(|i| {
                                    let t = i as f64 / count;
                                    [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
                                }));
                            }
                        }
                    }
                }
                Item::Text { at, text, .. } => {
                    let (x, y) = (to_x.pixel(at[0]), to_y.pixel(at[1]));
                    let half = 0.5 * text_width(text, NOTE_SIZE);
                    found.extend([[x - half, y], [x, y], [x + half, y]]);
                }
                Item::HorizontalLine { value, label } if !label.is_empty() => {
                    let y = to_y.pixel(*value) - 6.0;
                    let reach = text_width(label, NOTE_SIZE);
                    found.extend(
                        (0..=8).map(|i| [self.frame.right() - reach * f64::from(i) / 8.0, y]),
                    );
                }
                Item::VerticalLine { value, label } if !label.is_empty() => {
                    let x = to_x.pixel(*value);
                    let reach = text_width(label, NOTE_SIZE);
                    found.extend(
                        (0..=8).map(|i| [x + reach * f64::from(i) / 8.0, self.frame.y + 10.0]),
                    );
                }
                _ => {}
            }
        }
        found
    }
}
