//! From a described figure to the text of its SVG.
//!
//! Two passes: the first chooses ranges and ticks, and from the width of their
//! labels the margins; the second draws each panel in its final place.

mod heatmap;
pub(super) mod ink;
mod legend;
mod panel;

use std::fmt::Write as _;

use super::axis::Ticks;
use super::colors::STYLESHEET;
use super::svg::{Frame, coordinate as px, escape};
use super::{Figure, Item, Legend, Panel, Series};
use ink::*;
use legend::{Entry, Sample, entries, entry_width, legend_above};
use panel::Artist;

/// Ranges and ticks of a panel, before its place is known.
struct Plan {
    x: Option<(f64, f64)>,
    y: Option<(f64, f64)>,
    x_ticks: Ticks,
    y_ticks: Ticks,
    labels_x: bool,
}

/// Smallest and largest value along an axis over all that asks to be seen.
fn extent(panel: &Panel, axis: usize) -> Option<(f64, f64)> {
    let along = if axis == 0 { &panel.x } else { &panel.y };
    let other = if axis == 0 { &panel.y } else { &panel.x };
    let mut range: Option<(f64, f64)> = None;
    let mut widen = |value: f64| {
        if along.accepts(value) {
            range = Some(range.map_or((value, value), |(a, b)| (a.min(value), b.max(value))));
        }
    };
    let mut has_data = false;
    for item in &panel.items {
        match item {
            Item::Line(Series { points, .. }) | Item::Region { points, .. } => {
                for p in points {
                    if other.accepts(p[1 - axis]) && along.accepts(p[axis]) {
                        has_data = true;
                        widen(p[axis]);
                    }
                }
            }
            Item::HorizontalLine { value, .. } if axis == 1 => widen(*value),
            Item::VerticalLine { value, .. } if axis == 0 => widen(*value),
            _ => {}
        }
    }
    // Reference lines alone are not data.
    if has_data { range } else { None }
}

fn empty_ticks() -> Ticks {
    Ticks { major: Vec::new(), minor: Vec::new(), exponent: 0 }
}

/// Widens one of two ranges so that both have the same scale.
fn equalize(x: (f64, f64), y: (f64, f64), size: (f64, f64)) -> ((f64, f64), (f64, f64)) {
    let unit = ((x.1 - x.0) / size.0).max((y.1 - y.0) / size.1);
    let around = |r: (f64, f64), length: f64| {
        let middle = 0.5 * (r.0 + r.1);
        let half = 0.5 * unit * length;
        (middle - half, middle + half)
    };
    (around(x, size.0), around(y, size.1))
}

fn plans(figure: &Figure) -> Vec<Plan> {
    let (width, height) = figure.panel_size;
    let columns = figure.columns;
    let extents: Vec<_> = figure.panels.iter().map(|p| extent(p, 0)).collect();
    figure
        .panels
        .iter()
        .enumerate()
        .map(|(index, panel)| {
            let mut x_extent = extents[index];
            if figure.share_x {
                for other in (index % columns..figure.panels.len()).step_by(columns) {
                    x_extent = match (x_extent, extents[other]) {
                        (Some(a), Some(b)) => Some((a.0.min(b.0), a.1.max(b.1))),
                        (a, b) => a.or(b),
                    };
                }
            }
            let mut x = panel.x.resolve(x_extent);
            let mut y = panel.y.resolve(extent(panel, 1));
            if panel.heatmap.is_none() && extent(panel, 1).is_none() {
                // Fixed ranges without data would look like data that are elsewhere.
                y = None;
            }
            if let (true, Some(xr), Some(yr)) = (panel.equal_aspect, x, y)
                && !panel.x.is_log()
                && !panel.y.is_log()
            {
                let (a, b) = equalize(xr, yr, figure.panel_size);
                (x, y) = (Some(a), Some(b));
            }
            let x_ticks = x.map_or_else(empty_ticks, |(low, high)| {
                // Fewer ticks where their labels are long.
                let mut most = (width / 32.0).clamp(3.0, 12.0) as usize;
                loop {
                    let ticks = panel.x.ticks(low, high, most);
                    let widest =
                        ticks.major.iter().map(|t| label_width(&t.label)).fold(0.0, f64::max);
                    let fits = (widest + 10.0) * ticks.major.len() as f64 <= width;
                    if fits || most <= 2 {
                        break ticks;
                    }
                    most -= 1;
                }
            });
            let y_ticks = y.map_or_else(empty_ticks, |(low, high)| {
                let most = if panel.heatmap.is_some() {
                    usize::MAX
                } else {
                    (height / 19.0).clamp(3.0, 10.0) as usize
                };
                panel.y.ticks(low, high, most)
            });
            Plan {
                x,
                y,
                x_ticks,
                y_ticks,
                labels_x: !figure.share_x || index + columns >= figure.panels.len(),
            }
        })
        .collect()
}

/// Space around the frame of a panel.
#[derive(Clone, Copy, Default)]
struct Margins {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
}

/// The label of the y axis, broken where it is longer than the axis.
fn y_caption(panel: &Panel, height: f64) -> Vec<String> {
    wrap(&panel.y.caption(), LABEL_SIZE, height + 8.0)
}

fn margins(panel: &Panel, plan: &Plan, height: f64, legend_right: bool) -> Margins {
    let widest = plan.y_ticks.major.iter().map(|t| label_width(&t.label)).fold(12.0, f64::max);
    let mut m =
        Margins { left: TICK_LENGTH + 4.0 + widest + 4.0, right: 14.0, top: 8.0, bottom: 10.0 };
    let lines = y_caption(panel, height).len();
    if lines > 0 {
        m.left += 5.0 + lines as f64 * (LABEL_SIZE + 2.0);
    }
    if !panel.title.is_empty() {
        m.top += PANEL_TITLE_SIZE + 5.0;
    }
    if plan.y_ticks.exponent != 0 {
        m.top += TICK_SIZE + 3.0;
    }
    if plan.labels_x {
        m.bottom += TICK_LENGTH + TICK_SIZE + 3.0;
        if !panel.x.caption().is_empty() {
            m.bottom += LABEL_SIZE + 6.0;
        }
    }
    if panel.heatmap.is_some() {
        m.right += 62.0;
    }
    if legend_right {
        let widest = entries(panel).iter().map(entry_width).fold(0.0, f64::max);
        if widest > 0.0 {
            m.right += widest + 10.0;
        }
    }
    m
}

/// The whole figure.
pub(super) fn figure(figure: &Figure) -> String {
    let plans = plans(figure);
    let columns = figure.columns.min(figure.panels.len().max(1));
    let rows = figure.panels.len().div_ceil(columns);
    let (width, height) = figure.panel_size;

    let mut shared: Vec<Entry> = Vec::new();
    for entry in figure.panels.iter().flat_map(entries) {
        if !shared.contains(&entry) {
            shared.push(entry);
        }
    }
    shared.sort_by_key(|e| matches!(e.sample, Sample::Swatch(_)));
    let above = match figure.legend {
        Legend::Above => true,
        Legend::Auto => {
            figure.panels.len() > 1
                && figure.panels.iter().map(entries).any(|e| e.len() == shared.len())
        }
        _ => false,
    };
    let inside = match figure.legend {
        Legend::Inside => true,
        Legend::Auto => !above,
        _ => false,
    };
    let right = figure.legend == Legend::Right;

    let all: Vec<Margins> = figure
        .panels
        .iter()
        .zip(&plans)
        .map(|(panel, plan)| margins(panel, plan, height, right))
        .collect();
    let over = |pick: fn(&Margins) -> f64, stride: (usize, usize)| -> f64 {
        all.iter().skip(stride.0).step_by(stride.1.max(1)).map(pick).fold(0.0, f64::max)
    };
    let lefts: Vec<f64> = (0..columns).map(|c| over(|m| m.left, (c, columns))).collect();
    let rights: Vec<f64> = (0..columns).map(|c| over(|m| m.right, (c, columns))).collect();
    let in_row = |r: usize| &all[(r * columns).min(all.len())..((r + 1) * columns).min(all.len())];
    let tops: Vec<f64> =
        (0..rows).map(|r| in_row(r).iter().map(|m| m.top).fold(0.0, f64::max)).collect();
    let bottoms: Vec<f64> =
        (0..rows).map(|r| in_row(r).iter().map(|m| m.bottom).fold(0.0, f64::max)).collect();
    let total_width = if figure.panels.is_empty() {
        320.0
    } else {
        2.0 * OUTER_MARGIN
            + lefts.iter().sum::<f64>()
            + rights.iter().sum::<f64>()
            + columns as f64 * width
    };

    let mut body = String::new();
    let mut y = OUTER_MARGIN;
    let room = total_width - 2.0 * OUTER_MARGIN;
    let start = OUTER_MARGIN + lefts.first().copied().unwrap_or(0.0);
    for line in wrap(&figure.title, 1.06 * TITLE_SIZE, room) {
        y += TITLE_SIZE;
        let _ = writeln!(
            body,
            "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\" font-size=\"{TITLE_SIZE}\" \
             font-weight=\"600\" {}>{}</text>",
            px(0.5 * total_width),
            px(y),
            fill("fg"),
            escape(&line)
        );
        y += 5.0;
    }
    for line in wrap(&figure.subtitle, SUBTITLE_SIZE, room) {
        y += SUBTITLE_SIZE;
        let _ = writeln!(
            body,
            "{}",
            text(0.5 * total_width, y, "middle", SUBTITLE_SIZE, "muted", &line)
        );
        y += 4.0;
    }
    if above && !shared.is_empty() {
        y += 4.0;
        y = legend_above(&mut body, &shared, start, y, total_width - OUTER_MARGIN);
    }
    if figure.panels.is_empty() {
        y += 30.0;
        let _ = writeln!(
            body,
            "{}",
            text(0.5 * total_width, y, "middle", LABEL_SIZE, "muted", "no data")
        );
        y += 20.0;
    }

    for row in 0..rows {
        y += tops[row];
        let mut x = OUTER_MARGIN;
        for column in 0..columns {
            x += lefts[column];
            let index = row * columns + column;
            if let (Some(panel), Some(plan)) = (figure.panels.get(index), plans.get(index)) {
                let frame = Frame { x, y, width, height };
                let mut artist =
                    Artist { out: &mut body, panel, plan, frame, left: lefts[column], index };
                artist.draw(inside, right);
            }
            x += width + rights[column];
        }
        y += height + bottoms[row];
    }
    let total_height = y + 2.0;

    let description =
        if figure.description.is_empty() { describe(figure) } else { figure.description.clone() };
    let id =
        figure.id.clone().map_or_else(|| format!("f{:016x}", fingerprint(&body)), |s| slug(&s));
    let body = body.replace(ID, &id);
    let style =
        if figure.adaptive { format!("<style>{STYLESHEET}</style>\n") } else { String::new() };
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"cx-plot{class}\" width=\"{w}\" height=\"{h}\" \
         viewBox=\"0 0 {w} {h}\" role=\"img\" aria-labelledby=\"{id}-title {id}-desc\" \
         font-family=\"{FONTS}\">\n<title id=\"{id}-title\">{title}</title>\n\
         <desc id=\"{id}-desc\">{description}</desc>\n{style}\
         <rect width=\"{w}\" height=\"{h}\" {background}/>\n{body}</svg>\n",
        w = px(total_width),
        h = px(total_height),
        title = escape(&figure.title),
        description = escape(&description),
        background = fill("bg"),
        class = figure.class.as_ref().map_or_else(String::new, |name| format!(" {}", escape(name))),
    )
}

/// A description made from the panels, for readers who cannot see the figure.
fn describe(figure: &Figure) -> String {
    let panels: Vec<String> = figure
        .panels
        .iter()
        .map(|panel| {
            let names: Vec<String> =
                panel.series().map(|s| plain(&s.label)).filter(|l| !l.is_empty()).collect();
            let what = plain(&format!("{} against {}", panel.y.caption(), panel.x.caption()));
            if names.is_empty() { what } else { format!("{what}: {}", names.join(", ")) }
        })
        .collect();
    format!("{} panels. {}.", figure.panels.len(), panels.join("; "))
}

/// FNV-1a, to tell figures of a page apart without a counter.
fn fingerprint(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    })
}

/// An XML identifier made from free text.
fn slug(text: &str) -> String {
    let mut out = String::from("f-");
    for c in text.chars() {
        out.push(if c.is_ascii_alphanumeric() || c == '-' { c } else { '-' });
    }
    out
}
