//! One panel: regions, grid, curves, marks, ticks and lettering, in that order.

use std::fmt::Write as _;

use super::super::axis::{Map, Tick};
use super::super::svg::{
    Frame, clip_segment, coordinate as px, escape, polygon, polyline, text_width, thinned,
};
use super::super::{Anchor, Item, Panel, Series};
use super::ink::*;
use super::legend::{entries, legend_entry};
use super::{Plan, y_caption};

/// Draws one panel.
pub(super) struct Artist<'a> {
    pub(super) out: &'a mut String,
    pub(super) panel: &'a Panel,
    pub(super) plan: &'a Plan,
    pub(super) frame: Frame,
    /// Space of the column to the left of its frames.
    pub(super) left: f64,
    pub(super) index: usize,
}

impl Artist<'_> {
    pub(super) fn put(&mut self, element: &str) {
        self.out.push_str(element);
        self.out.push('\n');
    }

    pub(super) fn draw(&mut self, legend_inside: bool, legend_right: bool) {
        let frame = self.frame;
        let clip = format!("{ID}-clip{}", self.index);
        let (Some(x), Some(y)) = (self.plan.x, self.plan.y) else {
            self.put("<g>");
            self.titles();
            self.border();
            let note = text(
                frame.x + 0.5 * frame.width,
                frame.y + 0.5 * frame.height + 4.0,
                "middle",
                LABEL_SIZE,
                "muted",
                "no data",
            );
            self.put(&note);
            self.notes();
            self.put("</g>");
            return;
        };
        let to_x = Map {
            low: x.0,
            high: x.1,
            log: self.panel.x.is_log(),
            start: frame.x,
            end: frame.right(),
        };
        let (start, end) = if self.panel.heatmap.is_some() {
            (frame.y, frame.bottom())
        } else {
            (frame.bottom(), frame.y)
        };
        let to_y = Map { low: y.0, high: y.1, log: self.panel.y.is_log(), start, end };
        let kind = |log: bool| if log { "log" } else { "linear" };
        let head = if self.panel.heatmap.is_some() {
            "<g>".to_string()
        } else {
            // What a script needs to turn a place in the frame into values.
            format!(
                "<g data-frame=\"{} {} {} {}\" data-x=\"{:e} {:e} {}\" data-y=\"{:e} {:e} {}\" \
                 data-x-unit=\"{}\" data-y-unit=\"{}\" data-x-name=\"{}\" data-y-name=\"{}\">",
                px(frame.x),
                px(frame.y),
                px(frame.width),
                px(frame.height),
                x.0,
                x.1,
                kind(to_x.log),
                y.0,
                y.1,
                kind(to_y.log),
                escape(&plain(&self.panel.x.unit)),
                escape(&plain(&self.panel.y.unit)),
                escape(&plain(&self.panel.x.label)),
                escape(&plain(&self.panel.y.label)),
            )
        };
        self.put(&head);
        self.put(&format!(
            "<clipPath id=\"{clip}\"><rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/></clipPath>",
            px(frame.x),
            px(frame.y),
            px(frame.width),
            px(frame.height)
        ));
        if let Some(map) = self.panel.heatmap.as_ref() {
            self.cells(map, &to_x, &to_y);
        } else {
            self.put(&format!("<g clip-path=\"url(#{clip})\">"));
            self.regions(&to_x, &to_y);
            self.grid(&to_x, &to_y);
            self.reference_lines(&to_x, &to_y);
            self.curves(&to_x, &to_y);
            self.put("</g>");
        }
        self.border();
        self.ticks(&to_x, &to_y);
        self.titles();
        if self.panel.heatmap.is_none() {
            self.marks(&to_x, &to_y);
            self.writing(&to_x, &to_y);
        }
        self.notes();
        if legend_inside {
            self.legend_in_corner(&to_x, &to_y);
        } else if legend_right {
            let (x, mut y) = (frame.right() + 12.0, frame.y + 11.0);
            for entry in entries(self.panel) {
                legend_entry(self.out, &entry, x, y);
                y += LEGEND_LINE;
            }
        }
        self.put("</g>");
    }

    fn regions(&mut self, to_x: &Map, to_y: &Map) {
        let wide = self.frame.grown(CLIP_MARGIN);
        for item in &self.panel.items {
            match item {
                Item::Band { tone, x, y, label } => {
                    let side = |map: &Map, value: f64| {
                        if value == f64::NEG_INFINITY || (map.log && value <= 0.0) {
                            map.start
                        } else if value == f64::INFINITY {
                            map.end
                        } else {
                            let (a, b) = (map.start.min(map.end), map.start.max(map.end));
                            map.pixel(value).clamp(a - CLIP_MARGIN, b + CLIP_MARGIN)
                        }
                    };
                    let (x0, x1) = (side(to_x, x.0), side(to_x, x.1));
                    let (y0, y1) = (side(to_y, y.0), side(to_y, y.1));
                    let (class, color) = tone_color(*tone);
                    self.put(&format!(
                        "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" class=\"cx-f-{class}\" \
                         fill=\"{color}\" fill-opacity=\"{}\"><title>{}</title></rect>",
                        px(x0.min(x1)),
                        px(y0.min(y1)),
                        px((x1 - x0).abs()),
                        px((y1 - y0).abs()),
                        tone_opacity(*tone),
                        escape(label)
                    ));
                }
                Item::Region { tone, points, outlined, label, .. } => {
                    let pixels: Vec<[f64; 2]> =
                        points.iter().map(|p| [to_x.pixel(p[0]), to_y.pixel(p[1])]).collect();
                    let d = polygon(&wide, &pixels);
                    if d.is_empty() {
                        continue;
                    }
                    let (class, color) = tone_color(*tone);
                    let outline = if *outlined {
                        format!("stroke=\"{color}\" stroke-opacity=\"0.6\" stroke-width=\"0.9\"")
                    } else {
                        "stroke=\"none\"".to_string()
                    };
                    let stroke_class =
                        if *outlined { format!(" cx-s-{class}") } else { String::new() };
                    self.put(&format!(
                        "<path d=\"{d}\" class=\"cx-f-{class}{stroke_class}\" fill=\"{color}\" \
                         fill-opacity=\"{}\" {outline}><title>{}</title></path>",
                        tone_opacity(*tone),
                        escape(label)
                    ));
                }
                _ => {}
            }
        }
    }

    fn grid(&mut self, to_x: &Map, to_y: &Map) {
        let frame = self.frame;
        let vertical = |v: f64| {
            let x = to_x.pixel(v);
            rule([x, frame.y], [x, frame.bottom()])
        };
        let horizontal = |v: f64| {
            let y = to_y.pixel(v);
            rule([frame.x, y], [frame.right(), y])
        };
        let plan = self.plan;
        let mut minor = String::new();
        minor.extend(plan.x_ticks.minor.iter().map(|&v| vertical(v)));
        minor.extend(plan.y_ticks.minor.iter().map(|&v| horizontal(v)));
        let mut major = String::new();
        major.extend(plan.x_ticks.major.iter().map(|t| vertical(t.value)));
        major.extend(plan.y_ticks.major.iter().map(|t| horizontal(t.value)));
        for (d, name) in [(minor, "minor"), (major, "grid")] {
            if !d.is_empty() {
                self.put(&format!(
                    "<path d=\"{d}\" fill=\"none\" stroke-width=\"0.8\" {}/>",
                    stroke(name)
                ));
            }
        }
    }

    fn reference_lines(&mut self, to_x: &Map, to_y: &Map) {
        let frame = self.frame;
        let wide = frame.grown(CLIP_MARGIN);
        for item in &self.panel.items {
            let d = match item {
                Item::HorizontalLine { value, .. } if self.panel.y.accepts(*value) => {
                    let y = to_y.pixel(*value);
                    polyline(&wide, &[[frame.x, y], [frame.right(), y]])
                }
                Item::VerticalLine { value, .. } if self.panel.x.accepts(*value) => {
                    let x = to_x.pixel(*value);
                    polyline(&wide, &[[x, frame.y], [x, frame.bottom()]])
                }
                Item::Guide { points, .. } => {
                    let pixels: Vec<[f64; 2]> =
                        points.iter().map(|p| [to_x.pixel(p[0]), to_y.pixel(p[1])]).collect();
                    let d = polyline(&wide, &pixels);
                    self.put(&format!(
                        "<path d=\"{d}\" fill=\"none\" stroke-width=\"0.7\" \
                         stroke-opacity=\"0.55\" {}/>",
                        stroke("muted")
                    ));
                    continue;
                }
                _ => continue,
            };
            self.put(&format!(
                "<path d=\"{d}\" fill=\"none\" stroke-width=\"1\" stroke-dasharray=\"5 3\" {}/>",
                stroke("muted")
            ));
        }
    }

    fn curves(&mut self, to_x: &Map, to_y: &Map) {
        let wide = self.frame.grown(CLIP_MARGIN);
        let panel = self.panel;
        for series in panel.series().filter(|s| s.has_line) {
            let pixels: Vec<[f64; 2]> =
                series.points.iter().map(|p| [to_x.pixel(p[0]), to_y.pixel(p[1])]).collect();
            let d = polyline(&wide, &thinned(pixels));
            if d.is_empty() {
                continue;
            }
            let path = curve_path(&d, series.color, series.dash, series.width);
            self.put(&format!(
                "<g opacity=\"{}\" data-label=\"{}\"><title>{}</title>{path}</g>",
                series.opacity,
                escape(&plain(series.spoken())),
                escape(&self.summary(series))
            ));
        }
    }

    /// What a series holds, for hovering readers.
    fn summary(&self, series: &Series) -> String {
        let shown: Vec<f64> = series
            .points
            .iter()
            .filter(|p| p[0].is_finite() && p[1].is_finite())
            .map(|p| p[1])
            .collect();
        let low = shown.iter().copied().fold(f64::INFINITY, f64::min);
        let high = shown.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let gaps = series.points.len() - shown.len();
        let mut out = format!(
            "{}: {} points, {} to {} {}",
            plain(series.spoken()),
            shown.len(),
            readable(low),
            readable(high),
            self.panel.y.unit
        );
        if gaps > 0 {
            let _ = write!(out, ", {gaps} missing");
        }
        out.trim_start_matches(": ").trim_end().to_string()
    }

    fn marks(&mut self, to_x: &Map, to_y: &Map) {
        let panel = self.panel;
        let reach = self.frame.grown(0.01);
        for series in panel.series().filter(|s| s.has_marks) {
            let few = series.points.len() <= MOST_MARKS;
            let mut group = format!("<g opacity=\"{}\">", series.opacity);
            for p in &series.points {
                let pixel = [to_x.pixel(p[0]), to_y.pixel(p[1])];
                if !reach.contains(pixel) {
                    continue;
                }
                let hover = if few {
                    format!(
                        "{}: {} {}, {} {}",
                        plain(series.spoken()),
                        readable(p[0]),
                        panel.x.unit,
                        readable(p[1]),
                        panel.y.unit
                    )
                } else {
                    String::new()
                };
                group.push_str(&mark(
                    series.marker,
                    series.color,
                    pixel,
                    series.has_line,
                    hover.trim_start_matches(": ").trim_end(),
                ));
            }
            group.push_str("</g>");
            self.put(&group);
        }
    }

    /// Labels of reference lines and guides, and free text.
    fn writing(&mut self, to_x: &Map, to_y: &Map) {
        let frame = self.frame;
        let mut verticals = 0;
        let mut placed: Vec<Frame> = Vec::new();
        let panel = self.panel;
        for item in &panel.items {
            match item {
                Item::HorizontalLine { value, label }
                    if !label.is_empty() && panel.y.accepts(*value) =>
                {
                    let y = to_y.pixel(*value);
                    if y < frame.y - 0.5 || y > frame.bottom() + 0.5 {
                        continue;
                    }
                    let above = y - frame.y > NOTE_SIZE + 4.0;
                    let baseline = if above { y - 3.5 } else { y + NOTE_SIZE + 2.0 };
                    let note =
                        halo_text(frame.right() - 5.0, baseline, "end", NOTE_SIZE, "muted", label);
                    self.put(&note);
                }
                Item::VerticalLine { value, label }
                    if !label.is_empty() && panel.x.accepts(*value) =>
                {
                    let x = to_x.pixel(*value);
                    if x < frame.x - 0.5 || x > frame.right() + 0.5 {
                        continue;
                    }
                    let width = text_width(label, NOTE_SIZE);
                    let fits = x + 5.0 + width < frame.right();
                    let (at, anchor) = if fits { (x + 4.0, "start") } else { (x - 4.0, "end") };
                    let baseline = frame.y + 12.0 + f64::from(verticals) * (NOTE_SIZE + 3.0);
                    verticals += 1;
                    let note = halo_text(at, baseline, anchor, NOTE_SIZE, "muted", label);
                    self.put(&note);
                }
                Item::Guide { points, label } if !label.is_empty() => {
                    let pixels: Vec<[f64; 2]> =
                        points.iter().map(|p| [to_x.pixel(p[0]), to_y.pixel(p[1])]).collect();
                    if let Some((note, place)) = guide_label(&frame, &pixels, label) {
                        // Crowded guides are named as far as there is room.
                        if !placed.iter().any(|p| p.overlaps(&place)) {
                            self.put(&note);
                            placed.push(place);
                        }
                    }
                }
                Item::Text { at, text: note, anchor } => {
                    let pixel = [to_x.pixel(at[0]), to_y.pixel(at[1])];
                    if !frame.contains(pixel) {
                        continue;
                    }
                    let [x, y] = pixel;
                    let (x, y, side) = match anchor {
                        Anchor::Right => (x + 6.0, y + 3.4, "start"),
                        Anchor::Left => (x - 6.0, y + 3.4, "end"),
                        Anchor::Above => (x, y - 8.0, "middle"),
                        Anchor::Below => (x, y + NOTE_SIZE + 6.0, "middle"),
                    };
                    let note = halo_text(x, y, side, NOTE_SIZE, "fg", note);
                    self.put(&note);
                }
                _ => {}
            }
        }
    }

    fn border(&mut self) {
        let f = self.frame;
        self.put(&format!(
            "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" fill=\"none\" \
             stroke-width=\"0.9\" {}/>",
            px(f.x),
            px(f.y),
            px(f.width),
            px(f.height),
            stroke("frame")
        ));
    }

    fn ticks(&mut self, to_x: &Map, to_y: &Map) {
        let f = self.frame;
        let plan = self.plan;
        let mut d = String::new();
        for (list, length) in [
            (plan.x_ticks.major.iter().map(|t| t.value).collect::<Vec<_>>(), TICK_LENGTH),
            (plan.x_ticks.minor.clone(), 0.5 * TICK_LENGTH),
        ] {
            for value in list {
                let x = to_x.pixel(value);
                d.push_str(&rule([x, f.bottom()], [x, f.bottom() + length]));
            }
        }
        for (list, length) in [
            (plan.y_ticks.major.iter().map(|t| t.value).collect::<Vec<_>>(), TICK_LENGTH),
            (plan.y_ticks.minor.clone(), 0.5 * TICK_LENGTH),
        ] {
            for value in list {
                let y = to_y.pixel(value);
                d.push_str(&rule([f.x - length, y], [f.x, y]));
            }
        }
        if !d.is_empty() {
            self.put(&format!(
                "<path d=\"{d}\" fill=\"none\" stroke-width=\"0.9\" {}/>",
                stroke("frame")
            ));
        }
        let mut labels = String::new();
        if plan.labels_x {
            let baseline = f.bottom() + TICK_LENGTH + TICK_SIZE + 1.0;
            for Tick { value, label } in &plan.x_ticks.major {
                labels.push_str(&tick_text(to_x.pixel(*value), baseline, "middle", label));
            }
            if plan.x_ticks.exponent != 0 {
                labels.push_str(&text(
                    f.right(),
                    baseline + LABEL_SIZE + 5.0,
                    "end",
                    TICK_SIZE,
                    "fg",
                    &factor_text(plan.x_ticks.exponent),
                ));
            }
        }
        for Tick { value, label } in &plan.y_ticks.major {
            labels.push_str(&tick_text(
                f.x - TICK_LENGTH - 3.0,
                to_y.pixel(*value) + 3.5,
                "end",
                label,
            ));
        }
        if plan.y_ticks.exponent != 0 {
            labels.push_str(&text(
                f.x,
                f.y - 5.0,
                "start",
                TICK_SIZE,
                "fg",
                &factor_text(plan.y_ticks.exponent),
            ));
        }
        if !labels.is_empty() {
            self.put(&labels);
        }
    }

    fn titles(&mut self) {
        let f = self.frame;
        let panel = self.panel;
        if !panel.title.is_empty() {
            let lift = if self.plan.y_ticks.exponent != 0 { TICK_SIZE + 8.0 } else { 6.0 };
            self.put(&format!(
                "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\" font-size=\"{PANEL_TITLE_SIZE}\" \
                 font-weight=\"600\" {}>{}</text>",
                px(f.x + 0.5 * f.width),
                px(f.y - lift),
                fill("fg"),
                rich(&panel.title, PANEL_TITLE_SIZE)
            ));
        }
        let caption = panel.x.caption();
        if self.plan.labels_x && !caption.is_empty() {
            let y = f.bottom() + TICK_LENGTH + TICK_SIZE + LABEL_SIZE + 6.0;
            self.put(&text(f.x + 0.5 * f.width, y, "middle", LABEL_SIZE, "fg", &caption));
        }
        // At the edge of the column, so that the labels of a column line up.
        let x = f.x - self.left + LABEL_SIZE;
        let y = f.y + 0.5 * f.height;
        for (line, words) in y_caption(panel, f.height).iter().enumerate() {
            self.put(&format!(
                "<text transform=\"translate({} {}) rotate(-90)\" text-anchor=\"middle\" \
                 font-size=\"{LABEL_SIZE}\" {}>{}</text>",
                px(x + line as f64 * (LABEL_SIZE + 2.0)),
                px(y),
                fill("fg"),
                rich(words, LABEL_SIZE)
            ));
        }
    }

    /// Says in the panel what it does not show.
    fn notes(&mut self) {
        let f = self.frame;
        let notes: Vec<String> = self
            .panel
            .notes()
            .iter()
            .flat_map(|note| wrap(&plain(note), NOTE_SIZE, f.width - 12.0))
            .collect();
        for (i, note) in notes.iter().rev().enumerate() {
            let y = f.bottom() - 6.0 - i as f64 * (NOTE_SIZE + 3.0);
            if y < f.y + NOTE_SIZE {
                break;
            }
            let note = halo_text(f.x + 6.0, y, "start", NOTE_SIZE, "forbidden", note);
            self.put(&note);
        }
    }
}

/// The label of a guide, just inside where it leaves the frame.
fn guide_label(frame: &Frame, pixels: &[[f64; 2]], label: &str) -> Option<(String, Frame)> {
    let last = pixels
        .windows(2)
        .filter(|pair| pair.iter().flatten().all(|v| v.is_finite()))
        .filter_map(|pair| clip_segment(frame, pair[0], pair[1]))
        .next_back()?[1];
    let [x, y] = last;
    let near = 12.0;
    let (anchor, x) = if frame.right() - x < near + 0.5 * text_width(label, NOTE_SIZE) {
        ("end", x - 3.0)
    } else if x - frame.x < near + 0.5 * text_width(label, NOTE_SIZE) {
        ("start", x + 3.0)
    } else {
        ("middle", x)
    };
    let y = if y - frame.y < near {
        y + NOTE_SIZE + 1.0
    } else if frame.bottom() - y < near {
        y - 3.0
    } else {
        y - 2.0
    };
    let width = text_width(label, NOTE_SIZE);
    let left = match anchor {
        "start" => x,
        "end" => x - width,
        _ => x - 0.5 * width,
    };
    let place = Frame { x: left, y: y - NOTE_SIZE, width, height: NOTE_SIZE };
    let note = halo_text(x, y, anchor, NOTE_SIZE - 0.5, "muted", label);
    Some((note, place))
}
