//! Plots as PNG: the SVG of a plot, drawn at twice its size.
//!
//! Fonts are carried along, so that a machine without any gives the same
//! picture.

use resvg::tiny_skia::{Color, Pixmap, Transform};
use resvg::usvg::{Options, Tree};

use super::CliError;

/// Pixels per unit of the SVG: sharp on a slide and in a printed report.
const SCALE: f32 = 2.0;
/// The first font; the second has the signs that it lacks.
const FONTS: [&[u8]; 2] = [epaint_default_fonts::UBUNTU_LIGHT, epaint_default_fonts::HACK_REGULAR];

/// The bytes of a PNG file.
///
/// # Errors
/// [`CliError::Internal`]: a plot that is no SVG, or is too large for memory.
pub(super) fn from_svg(svg: &str) -> Result<Vec<u8>, CliError> {
    let fault = |what: &str| CliError::Internal(format!("the plot cannot be drawn: {what}"));
    let mut options = Options::default();
    let fonts = options.fontdb_mut();
    for font in FONTS {
        fonts.load_font_data(font.to_vec());
    }
    fonts.set_sans_serif_family("Ubuntu");
    let tree = Tree::from_str(svg, &options).map_err(|error| fault(&error.to_string()))?;
    let size = tree.size().to_int_size().scale_by(SCALE).ok_or_else(|| fault("it has no size"))?;
    let mut picture =
        Pixmap::new(size.width(), size.height()).ok_or_else(|| fault("it is too large"))?;
    picture.fill(Color::WHITE);
    resvg::render(&tree, Transform::from_scale(SCALE, SCALE), &mut picture.as_mut());
    picture.encode_png().map_err(|error| fault(&error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use coaxdesign::report::plot::{Axis, Figure, Panel, Series};

    #[test]
    fn a_plot_is_drawn_with_its_lines_and_its_words() {
        let draw = |title: &str, values: &[f64]| {
            let panel = Panel::new(Axis::linear("θ", "deg"), Axis::linear("power", "hp"))
                .line(Series::new("", &[0.0, 1.0, 2.0], values));
            let svg = Figure::new(title).panel(panel).to_svg();
            Pixmap::decode_png(&from_svg(&svg).unwrap()).unwrap()
        };
        let picture = draw("θ₀ over power", &[1.0, 3.0, 2.0]);
        assert!(picture.width() > 400 && picture.height() > 200);
        // The ground is white and opaque.
        assert_eq!(picture.pixel(0, 0).unwrap().demultiply().red(), 255);
        assert!(picture.pixels().iter().all(|p| p.alpha() == 255));
        // Another title and another line are another picture, so both are drawn.
        let dark = |p: &Pixmap| p.pixels().iter().filter(|p| p.red() < 128).count();
        assert!(dark(&picture) > 1000);
        assert_ne!(dark(&picture), dark(&draw("a", &[1.0, 3.0, 2.0])));
        assert_ne!(picture.data(), draw("θ₀ over power", &[1.0, 2.0, 3.0]).data());
    }
}
