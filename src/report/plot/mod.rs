//! Figures of panels with curves, written as SVG.
//!
//! A [`Figure`] is a grid of [`Panel`]s; a panel has two [`Axis`] and holds
//! [`Series`], reference lines, shaded regions and notes. The output is the
//! same bytes for the same input, and needs no font, script or network.
//!
//! ```
//! use coaxdesign::report::plot::{Axis, Figure, Panel, Series};
//!
//! let speed = [0.0, 20.0, 40.0];
//! let pitch = [3.4, 2.9, 1.2];
//! let svg = Figure::new("Trim")
//!     .panel(
//!         Panel::new(Axis::linear("airspeed", "kt"), Axis::linear("pitch attitude", "deg"))
//!             .line(Series::new("interactions on", &speed, &pitch).style(0).marks())
//!             .horizontal_line(0.0, ""),
//!     )
//!     .to_svg();
//! assert!(svg.starts_with("<svg"));
//! ```
//!
//! In titles, labels and names `_{...}` is set as a subscript and `^{...}` as a
//! superscript: `K_{P}`.
//!
//! What cannot be drawn is said in the figure itself and by [`Figure::notes`]:
//! a panel without finite data, a series whose coordinates differ in number,
//! points that a logarithmic axis cannot show.

mod axis;
mod colors;
pub mod diagram;
mod draw;
mod svg;

pub use axis::{Axis, Scale};
pub(super) use colors::variables;
pub use colors::{DARK_PALETTE, LIGHT_PALETTE, STYLESHEET, sequential_color};

pub(super) use svg::escape;

/// Number of distinct looks; style indices wrap around.
pub const STYLE_COUNT: usize = 8;

/// Where the legend of a figure goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Legend {
    /// Above the panels if they all have the same entries, otherwise in each panel.
    #[default]
    Auto,
    /// Once, above the panels.
    Above,
    /// In each panel, in the corner that covers the least of the curves.
    Inside,
    /// Beside each panel, on the right.
    Right,
    /// Nowhere.
    Hidden,
}

/// What a shaded region stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tone {
    /// Where the curves must not go.
    Forbidden,
    /// Grey, without judgement.
    Neutral,
    /// The colour of a style index.
    Style(usize),
}

/// One curve or cloud of points.
///
/// A style index sets colour, dash and marker together, so that a curve is
/// known in grey print too. The same index looks the same in every panel.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    label: String,
    hint: String,
    points: Vec<[f64; 2]>,
    color: usize,
    dash: usize,
    marker: usize,
    has_line: bool,
    has_marks: bool,
    width: f64,
    opacity: f64,
    mismatch: Option<(usize, usize)>,
}

impl Series {
    /// A line through `(x[i], y[i])`. Points that are not finite leave gaps.
    ///
    /// If the lengths differ nothing is drawn but a note that says so.
    #[must_use]
    pub fn new(label: &str, x: &[f64], y: &[f64]) -> Self {
        let mismatch = (x.len() != y.len()).then_some((x.len(), y.len()));
        let points = match mismatch {
            Some(_) => Vec::new(),
            None => x.iter().zip(y).map(|(&x, &y)| [x, y]).collect(),
        };
        Self { mismatch, ..Self::from_points(label, points) }
    }

    /// A line through `points`.
    #[must_use]
    pub fn from_points(label: &str, points: Vec<[f64; 2]>) -> Self {
        Self {
            label: label.to_string(),
            hint: String::new(),
            points,
            color: 0,
            dash: 0,
            marker: 0,
            has_line: true,
            has_marks: false,
            width: 1.6,
            opacity: 1.0,
            mismatch: None,
        }
    }

    /// What the series is, for readers who point at it, where the legend does
    /// not name it.
    #[must_use]
    pub fn hint(mut self, hint: &str) -> Self {
        self.hint = hint.to_string();
        self
    }

    /// The label, or what stands for it.
    fn spoken(&self) -> &str {
        if self.label.is_empty() { &self.hint } else { &self.label }
    }

    /// Colour, dash and marker number `index`.
    #[must_use]
    pub fn style(self, index: usize) -> Self {
        self.color(index).dash(index).marker(index)
    }

    /// Colour number `index`, leaving dash and marker.
    #[must_use]
    pub fn color(mut self, index: usize) -> Self {
        self.color = index % STYLE_COUNT;
        self
    }

    /// Dash pattern number `index`; 0 is solid.
    #[must_use]
    pub fn dash(mut self, index: usize) -> Self {
        self.dash = index % STYLE_COUNT;
        self
    }

    /// Marker number `index`, drawn with [`Series::marks`] or [`Series::scatter`].
    #[must_use]
    pub fn marker(mut self, index: usize) -> Self {
        self.marker = index % STYLE_COUNT;
        self
    }

    /// Marks the points as well as the line.
    #[must_use]
    pub fn marks(mut self) -> Self {
        self.has_marks = true;
        self
    }

    /// Marks the points without a line.
    #[must_use]
    pub fn scatter(mut self) -> Self {
        self.has_marks = true;
        self.has_line = false;
        self
    }

    /// Line width, px.
    #[must_use]
    pub fn width(mut self, width: f64) -> Self {
        self.width = width;
        self
    }

    /// Draws the series faintly, as a background to others.
    #[must_use]
    pub fn faint(mut self) -> Self {
        self.opacity = 0.4;
        self
    }
}

/// A table of numbers drawn as coloured cells.
#[derive(Debug, Clone, PartialEq)]
struct Heatmap {
    /// Rows from top to bottom.
    values: Vec<Vec<f64>>,
    label: String,
    decimals: usize,
    threshold: Option<f64>,
}

/// What a panel holds besides its series.
#[derive(Debug, Clone, PartialEq)]
enum Item {
    Line(Series),
    Region {
        label: String,
        tone: Tone,
        points: Vec<[f64; 2]>,
        outlined: bool,
        problem: Option<String>,
    },
    Band {
        label: String,
        tone: Tone,
        x: (f64, f64),
        y: (f64, f64),
    },
    HorizontalLine {
        value: f64,
        label: String,
    },
    VerticalLine {
        value: f64,
        label: String,
    },
    Guide {
        points: Vec<[f64; 2]>,
        label: String,
    },
    Text {
        at: [f64; 2],
        text: String,
        anchor: Anchor,
    },
}

/// Which side of a point its text lies on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// To the right of the point.
    Right,
    /// To the left of the point.
    Left,
    /// Above the point.
    Above,
    /// Below the point.
    Below,
}

/// One set of axes and what is drawn in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    title: String,
    x: Axis,
    y: Axis,
    items: Vec<Item>,
    heatmap: Option<Heatmap>,
    equal_aspect: bool,
}

impl Panel {
    /// An empty panel.
    #[must_use]
    pub fn new(x: Axis, y: Axis) -> Self {
        Self { title: String::new(), x, y, items: Vec::new(), heatmap: None, equal_aspect: false }
    }

    /// Title above the panel.
    #[must_use]
    pub fn title(mut self, title: &str) -> Self {
        self.title = title.to_string();
        self
    }

    /// Adds a series.
    #[must_use]
    pub fn line(mut self, series: Series) -> Self {
        self.items.push(Item::Line(series));
        self
    }

    /// A reference line at `y = value`. It widens the range to be seen.
    #[must_use]
    pub fn horizontal_line(mut self, value: f64, label: &str) -> Self {
        self.items.push(Item::HorizontalLine { value, label: label.to_string() });
        self
    }

    /// A reference line at `x = value`. It widens the range to be seen.
    #[must_use]
    pub fn vertical_line(mut self, value: f64, label: &str) -> Self {
        self.items.push(Item::VerticalLine { value, label: label.to_string() });
        self
    }

    /// Shades a rectangle. Bounds may be infinite, and do not widen the range.
    #[must_use]
    pub fn band(mut self, x: (f64, f64), y: (f64, f64), tone: Tone, label: &str) -> Self {
        self.items.push(Item::Band { label: label.to_string(), tone, x, y });
        self
    }

    /// Shades the span `low <= x <= high`.
    #[must_use]
    pub fn vertical_band(self, low: f64, high: f64, tone: Tone, label: &str) -> Self {
        self.band((low, high), (f64::NEG_INFINITY, f64::INFINITY), tone, label)
    }

    /// Shades the span `low <= y <= high`.
    #[must_use]
    pub fn horizontal_band(self, low: f64, high: f64, tone: Tone, label: &str) -> Self {
        self.band((f64::NEG_INFINITY, f64::INFINITY), (low, high), tone, label)
    }

    /// Fills a closed polygon and draws its outline. It widens the range to be seen.
    #[must_use]
    pub fn polygon(mut self, points: &[[f64; 2]], tone: Tone, label: &str) -> Self {
        self.items.push(Item::Region {
            label: label.to_string(),
            tone,
            points: points.to_vec(),
            outlined: true,
            problem: None,
        });
        self
    }

    /// Fills between `low[i]` and `high[i]` over `x[i]`. Points that are not
    /// finite are left out. If the lengths differ nothing is filled, and a note says so.
    #[must_use]
    pub fn fill_between(
        mut self,
        x: &[f64],
        low: &[f64],
        high: &[f64],
        tone: Tone,
        label: &str,
    ) -> Self {
        let same = x.len() == low.len() && x.len() == high.len();
        let problem = (!same).then(|| {
            format!(
                "not filled, {} abscissae but {} lower and {} upper bounds",
                x.len(),
                low.len(),
                high.len()
            )
        });
        let kept: Vec<(f64, f64, f64)> = x
            .iter()
            .zip(low.iter().zip(high))
            .map(|(&x, (&low, &high))| (x, low, high))
            .filter(|_| same)
            .filter(|(x, low, high)| x.is_finite() && low.is_finite() && high.is_finite())
            .collect();
        let points = kept
            .iter()
            .map(|&(x, low, _)| [x, low])
            .chain(kept.iter().rev().map(|&(x, _, high)| [x, high]))
            .collect();
        self.items.push(Item::Region {
            label: label.to_string(),
            tone,
            points,
            outlined: false,
            problem,
        });
        self
    }

    /// A thin grey line with its label where it leaves the frame, like a line
    /// of constant damping. It does not widen the range.
    #[must_use]
    pub fn guide(mut self, points: &[[f64; 2]], label: &str) -> Self {
        self.items.push(Item::Guide { points: points.to_vec(), label: label.to_string() });
        self
    }

    /// Text beside a point. It does not widen the range.
    #[must_use]
    pub fn text(mut self, x: f64, y: f64, text: &str, anchor: Anchor) -> Self {
        self.items.push(Item::Text { at: [x, y], text: text.to_string(), anchor });
        self
    }

    /// Draws a unit of x as long as a unit of y. Only for two linear axes.
    #[must_use]
    pub fn equal_aspect(mut self) -> Self {
        self.equal_aspect = true;
        self
    }

    /// Coloured cells with their numbers, on category axes; the first row is
    /// at the top. Cells below `threshold` are framed and underlined. Values that are
    /// not finite are drawn as empty cells with a dash.
    #[must_use]
    pub fn heatmap(
        mut self,
        values: &[Vec<f64>],
        label: &str,
        decimals: usize,
        threshold: Option<f64>,
    ) -> Self {
        self.heatmap = Some(Heatmap {
            values: values.to_vec(),
            label: label.to_string(),
            decimals,
            threshold,
        });
        self
    }

    fn series(&self) -> impl Iterator<Item = &Series> {
        self.items.iter().filter_map(|item| match item {
            Item::Line(series) => Some(series),
            _ => None,
        })
    }

    /// What could not be drawn as given.
    fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        for (name, axis) in [("x", &self.x), ("y", &self.y)] {
            if let (Some((low, high)), None) = (axis.range, axis.resolve(None)) {
                notes.push(format!("{name} axis: no range from {low} to {high}"));
            }
        }
        for item in &self.items {
            if let Item::Region { label, problem: Some(problem), .. } = item {
                notes.push(format!("{label}: {problem}"));
            }
        }
        if let Some(map) = &self.heatmap {
            let (rows, columns) = (self.y.places(), self.x.places());
            if map.values.len() != rows || map.values.iter().any(|r| r.len() != columns) {
                notes.push(format!(
                    "{}: the values do not fill {rows} rows of {columns}",
                    map.label
                ));
            }
        }
        for series in self.series() {
            if let Some((x, y)) = series.mismatch {
                notes.push(format!("{}: not drawn, {x} abscissae but {y} ordinates", series.label));
                continue;
            }
            let finite: Vec<_> =
                series.points.iter().filter(|p| p[0].is_finite() && p[1].is_finite()).collect();
            let shown =
                finite.iter().filter(|p| self.x.accepts(p[0]) && self.y.accepts(p[1])).count();
            if finite.is_empty() {
                notes.push(format!("{}: no data", series.label));
            } else if shown < finite.len() {
                notes.push(format!(
                    "{}: {} of {} points are not positive and have no place on a log axis",
                    series.label,
                    finite.len() - shown,
                    finite.len()
                ));
            }
        }
        notes
    }
}

/// A grid of panels under one title.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    title: String,
    subtitle: String,
    description: String,
    panels: Vec<Panel>,
    columns: usize,
    share_x: bool,
    panel_size: (f64, f64),
    legend: Legend,
    adaptive: bool,
    id: Option<String>,
    class: Option<String>,
}

/// Widest panel that a phone shows without making its letters smaller, px.
const NARROW_PANEL: f64 = 255.0;

impl Figure {
    /// A figure without panels.
    #[must_use]
    pub fn new(title: &str) -> Self {
        Self {
            title: title.to_string(),
            subtitle: String::new(),
            description: String::new(),
            panels: Vec::new(),
            columns: 1,
            share_x: false,
            panel_size: (320.0, 190.0),
            legend: Legend::Auto,
            adaptive: false,
            id: None,
            class: None,
        }
    }

    /// A line in smaller type under the title, like the flight condition.
    #[must_use]
    pub fn subtitle(mut self, subtitle: &str) -> Self {
        self.subtitle = subtitle.to_string();
        self
    }

    /// What the figure shows, for readers who cannot see it.
    #[must_use]
    pub fn description(mut self, description: &str) -> Self {
        self.description = description.to_string();
        self
    }

    /// Adds a panel; panels fill the grid row by row.
    #[must_use]
    pub fn panel(mut self, panel: Panel) -> Self {
        self.panels.push(panel);
        self
    }

    /// Adds the panels of another figure; panels without a title take its.
    #[must_use]
    pub fn append(mut self, other: Self) -> Self {
        let title = other.title;
        self.panels.extend(other.panels.into_iter().map(|mut panel| {
            if panel.title.is_empty() {
                panel.title.clone_from(&title);
            }
            panel
        }));
        self
    }

    /// Number of columns, at least one.
    #[must_use]
    pub fn columns(mut self, columns: usize) -> Self {
        self.columns = columns.max(1);
        self
    }

    /// Gives the panels of a column one x range, labelled at the lowest only.
    #[must_use]
    pub fn share_x(mut self) -> Self {
        self.share_x = true;
        self
    }

    /// Size of the frame of each panel, px.
    #[must_use]
    pub fn panel_size(mut self, width: f64, height: f64) -> Self {
        self.panel_size = (width.max(40.0), height.max(30.0));
        self
    }

    /// Where the legend goes.
    #[must_use]
    pub fn legend(mut self, legend: Legend) -> Self {
        self.legend = legend;
        self
    }

    /// Embeds [`STYLESHEET`], so that a reader whose system is dark sees the
    /// figure on a dark ground. Without it the figure is light, unless a page
    /// around it brings the stylesheet.
    #[must_use]
    pub fn adaptive(mut self) -> Self {
        self.adaptive = true;
        self
    }

    /// Prefix of the identifiers inside the SVG. The default is made from the
    /// contents, which is enough unless a page holds the same figure twice.
    #[must_use]
    pub fn id(mut self, id: &str) -> Self {
        self.id = Some(id.to_string());
        self
    }

    /// A class of the `<svg>` element, for the style sheet of a page around it.
    #[must_use]
    pub fn class(mut self, class: &str) -> Self {
        self.class = Some(class.to_string());
        self
    }

    /// The figure for a narrow page: panels one below the other, no wider than
    /// a phone. `None` where it already is, or cannot be made so.
    #[must_use]
    pub fn narrow(&self) -> Option<Self> {
        let (width, height) = self.panel_size;
        let columns = self.columns.min(self.panels.len().max(1));
        if self.panels.iter().any(|panel| panel.heatmap.is_some())
            || (columns == 1 && width <= NARROW_PANEL + 30.0)
        {
            return None;
        }
        let scale = (NARROW_PANEL / width).min(1.0);
        let equal = self.panels.iter().any(|panel| panel.equal_aspect);
        let mut narrow = self.clone().columns(1);
        narrow.panel_size = (width * scale, if equal { height * scale } else { height });
        // Panels of one column share less: keep every axis labelled.
        narrow.share_x = self.share_x && columns == 1;
        Some(narrow)
    }

    /// Whether the figure is a wide table that a narrow page has to scroll.
    #[must_use]
    pub fn is_long(&self) -> bool {
        self.panels.iter().any(|panel| panel.heatmap.is_some())
    }

    /// The title, for the heading of a section around the figure.
    #[must_use]
    pub fn title_text(&self) -> &str {
        &self.title
    }

    /// Everything that could not be drawn as given, one sentence each. Empty
    /// when the figure shows all it was given.
    #[must_use]
    pub fn notes(&self) -> Vec<String> {
        self.panels.iter().flat_map(Panel::notes).collect()
    }

    /// The figure as one `<svg>` element, also valid as a file of its own.
    #[must_use]
    pub fn to_svg(&self) -> String {
        draw::figure(self)
    }
}

#[cfg(test)]
mod tests;
