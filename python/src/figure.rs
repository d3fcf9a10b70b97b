//! Figures of the report, for notebooks.

use coaxdesign::report::figures::{Curve, CurvePanel, Marks, time_history_figure};
use coaxdesign::units::{Kind, System};
use pyo3::prelude::*;

/// A curve: its name, and values in SI and radians.
type Line = (String, Vec<f64>);
/// A panel: quantity, kind by name, smallest span in the shown unit, curves.
type Panel = (String, String, f64, Vec<Line>);

/// Histories over time, s, in the units that people read.
#[pyfunction]
pub fn history_svg(
    title: &str,
    subtitle: &str,
    us: bool,
    time: Vec<f64>,
    panels: Vec<Panel>,
) -> String {
    let system = if us { System::Us } else { System::Si };
    let panels: Vec<CurvePanel> = panels
        .into_iter()
        .map(|(quantity, kind, minimum_span, lines)| {
            let known = Kind::ALL.into_iter().find(|known| format!("{known:?}") == kind);
            let kind = known.unwrap_or(Kind::Dimensionless);
            let curves = lines.into_iter().enumerate().map(|(style, (name, values))| Curve {
                name,
                style,
                x: time.clone(),
                y: values.iter().map(|value| kind.from_si(*value, system)).collect(),
                marks: Marks::Without,
            });
            CurvePanel {
                title: String::new(),
                quantity,
                unit: kind.symbol(system).into(),
                minimum_span,
                curves: curves.collect(),
            }
        })
        .collect();
    let figure = time_history_figure(title, 2, &panels);
    if subtitle.is_empty() { figure.to_svg() } else { figure.subtitle(subtitle).to_svg() }
}
