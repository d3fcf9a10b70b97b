//! The figures as a whole: well formed, honest, clipped, repeatable.

use super::svg::{Frame, text_width};
use super::*;
use quick_xml::events::Event;
use std::collections::BTreeSet;

/// Reads the SVG with an XML parser; returns element names and attribute values of interest.
fn parse(svg: &str) -> Vec<(String, Vec<(String, String)>)> {
    let mut reader = quick_xml::Reader::from_str(svg);
    reader.config_mut().check_end_names = true;
    let mut found = Vec::new();
    let mut depth = 0i32;
    loop {
        match reader.read_event().expect("well-formed XML") {
            Event::Start(e) => {
                depth += 1;
                found.push(element(&e));
            }
            Event::Empty(e) => found.push(element(&e)),
            Event::End(_) => depth -= 1,
            Event::Eof => break,
            _ => {}
        }
    }
    assert_eq!(depth, 0, "unclosed elements");
    found
}

fn element(e: &quick_xml::events::BytesStart<'_>) -> (String, Vec<(String, String)>) {
    let attributes = e
        .attributes()
        .map(|a| {
            let a = a.expect("well-formed attribute");
            (a.key.as_ref().to_string(), a.value.to_string())
        })
        .collect();
    (e.name().as_ref().to_string(), attributes)
}

fn attribute<'a>(e: &'a (String, Vec<(String, String)>), name: &str) -> Option<&'a str> {
    e.1.iter().find(|a| a.0 == name).map(|a| a.1.as_str())
}

fn sample() -> Figure {
    let x: Vec<f64> = (0..50).map(|i| 0.1 * 10f64.powf(f64::from(i) * 0.06)).collect();
    let y: Vec<f64> = x.iter().map(|x| -20.0 * x.log10()).collect();
    Figure::new("a < b & \"c\"")
        .columns(2)
        .panel(
            Panel::new(Axis::log("frequency", "rad/s"), Axis::linear("magnitude", "dB"))
                .title("q <- δ")
                .line(Series::new("one & only", &x, &y).style(1).marks())
                .horizontal_line(-3.0, "−3 dB")
                .vertical_line(2.0, "ω")
                .vertical_band(5.0, f64::INFINITY, Tone::Neutral, "not valid")
                .text(1.0, 0.0, "a < b", Anchor::Above),
        )
        .panel(
            Panel::new(Axis::linear("re", ""), Axis::linear("im", ""))
                .equal_aspect()
                .polygon(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], Tone::Forbidden, "keep out")
                .guide(&[[0.0, 0.0], [2.0, 2.0]], "ζ 0.7")
                .line(Series::from_points("cloud", vec![[0.2, 0.3], [3.0, 1.0]]).scatter()),
        )
}

#[test]
fn the_output_is_well_formed_xml_with_its_texts() {
    let svg = sample().to_svg();
    let elements = parse(&svg);
    assert_eq!(elements[0].0, "svg");
    assert_eq!(attribute(&elements[0], "role"), Some("img"));
    let ids: Vec<&str> = elements.iter().filter_map(|e| attribute(e, "id")).collect();
    let distinct: BTreeSet<&&str> = ids.iter().collect();
    assert_eq!(ids.len(), distinct.len(), "identifiers are unique");
    // Every reference to a clip path and every label reference has its target.
    for e in &elements {
        if let Some(clip) = attribute(e, "clip-path") {
            let id = clip.trim_start_matches("url(#").trim_end_matches(')');
            assert!(ids.contains(&id), "{clip}");
        }
        if let Some(label) = attribute(e, "aria-labelledby") {
            assert!(label.split(' ').all(|id| ids.contains(&id)), "{label}");
        }
    }
    assert!(svg.contains("a &lt; b &amp; &quot;c&quot;</title>"));
    assert!(!svg.contains("NaN") && !svg.contains("inf"));
}

#[test]
fn the_same_figure_gives_the_same_bytes() {
    assert_eq!(sample().to_svg(), sample().to_svg());
    assert_ne!(sample().to_svg(), sample().panel_size(200.0, 100.0).to_svg());
}

#[test]
fn nothing_to_draw_is_said() {
    let nan = Figure::new("t").panel(
        Panel::new(Axis::linear("x", ""), Axis::linear("y", "")).line(Series::new(
            "s",
            &[0.0, 1.0],
            &[f64::NAN, f64::NAN],
        )),
    );
    assert!(nan.to_svg().contains(">no data</text>"));
    assert_eq!(nan.notes(), ["s: no data"]);
    parse(&nan.to_svg());

    let empty = Figure::new("t");
    assert!(empty.to_svg().contains(">no data</text>"));
    parse(&empty.to_svg());

    // A fixed range does not turn missing data into an empty plot.
    let fixed = Figure::new("t").panel(
        Panel::new(Axis::linear("x", "").range(0.0, 1.0), Axis::linear("y", "").range(0.0, 1.0))
            .horizontal_line(0.5, "limit"),
    );
    assert!(fixed.to_svg().contains(">no data</text>"));
}

#[test]
fn coordinates_that_differ_in_number_are_said_and_not_drawn() {
    let figure = Figure::new("t").panel(
        Panel::new(Axis::linear("x", ""), Axis::linear("y", ""))
            .line(Series::new("good", &[0.0, 1.0], &[0.0, 1.0]))
            .line(Series::new("bad", &[0.0, 1.0], &[0.0])),
    );
    let said = "bad: not drawn, 2 abscissae but 1 ordinates";
    assert_eq!(figure.notes(), [said]);
    assert!(figure.to_svg().contains(said));
}

#[test]
fn points_without_a_place_on_a_log_axis_are_counted() {
    let figure = Figure::new("t").panel(
        Panel::new(Axis::log("x", ""), Axis::linear("y", "")).line(Series::new(
            "s",
            &[0.0, 1.0, 10.0],
            &[1.0, 2.0, 3.0],
        )),
    );
    assert_eq!(
        figure.notes(),
        ["s: 1 of 3 points are not positive and have no place on a log axis"]
    );
}

#[test]
fn a_range_or_a_table_that_does_not_fit_is_said() {
    let names = |n: &[&str]| n.iter().map(|s| (*s).to_string()).collect::<Vec<_>>();
    let figure = Figure::new("t")
        .panel(
            Panel::new(Axis::log("x", "").range(0.0, 1.0), Axis::linear("y", ""))
                .line(Series::new("s", &[0.1, 1.0], &[1.0, 2.0]))
                .fill_between(&[0.1, 1.0], &[0.0], &[1.0, 2.0], Tone::Neutral, "spread"),
        )
        .panel(
            Panel::new(
                Axis::categories("x", "", &names(&["a"])),
                Axis::categories("y", "", &names(&["b"])),
            )
            .heatmap(&[vec![1.0, 123.0], vec![456.0]], "margin", 0, None),
        );
    assert_eq!(
        figure.notes(),
        [
            "x axis: no range from 0 to 1",
            "spread: not filled, 2 abscissae but 1 lower and 2 upper bounds",
            "margin: the values do not fill 1 rows of 1",
        ]
    );
    let svg = figure.to_svg();
    assert!(svg.contains("margin: the values do not fill"));
    // Nothing is drawn outside the named places.
    assert!(!svg.contains(">123<") && !svg.contains(">456<"));
}

/// Every coordinate of every path of curves in the figure.
fn path_points(svg: &str) -> Vec<[f64; 2]> {
    let mut found = Vec::new();
    for e in parse(svg) {
        if e.0 != "path" || attribute(&e, "stroke-linejoin").is_none() {
            continue;
        }
        let d = attribute(&e, "d").unwrap_or_default().to_string();
        for part in d.split(['M', 'L']).filter(|p| !p.is_empty()) {
            let mut numbers = part.split(' ').map(|n| n.parse::<f64>().unwrap());
            found.push([numbers.next().unwrap(), numbers.next().unwrap()]);
        }
    }
    found
}

#[test]
fn curves_leave_the_frame_at_their_slope() {
    // A line that shoots through a fixed range: its drawn part keeps its slope
    // and no part of it lies along the frame.
    let figure = Figure::new("t").legend(Legend::Hidden).panel(
        Panel::new(Axis::linear("x", "").range(0.0, 1.0), Axis::linear("y", "").range(0.0, 1.0))
            .line(Series::new("", &[-1e12, 1e12], &[-1e12, 1e12])),
    );
    let points = path_points(&figure.to_svg());
    assert_eq!(points.len(), 2);
    let slope = (points[1][1] - points[0][1]) / (points[1][0] - points[0][0]);
    // The default frame is 320 by 190, y down.
    assert!((slope + 190.0 / 320.0).abs() < 1e-3, "{slope}");
    assert!(points.iter().flatten().all(|v| v.abs() < 1e3));
}

#[test]
fn a_unit_is_equally_long_on_both_axes() {
    let square = vec![[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];
    let figure = Figure::new("t").legend(Legend::Hidden).panel(
        Panel::new(Axis::linear("x", ""), Axis::linear("y", ""))
            .equal_aspect()
            .line(Series::from_points("", square)),
    );
    let p = path_points(&figure.to_svg());
    assert!((p[1][0] - p[0][0] - (p[1][1] - p[2][1])).abs() < 0.02);
}

#[test]
fn a_shared_axis_shows_one_range_and_labels_once() {
    let panel =
        |x: [f64; 2]| {
            Panel::new(Axis::linear("airspeed", "kt").tight(), Axis::linear("y", ""))
                .line(Series::new("s", &x, &[0.0, 1.0]))
        };
    let figure = Figure::new("t")
        .share_x()
        .legend(Legend::Hidden)
        .panel(panel([0.0, 50.0]))
        .panel(panel([50.0, 100.0]));
    let svg = figure.to_svg();
    assert_eq!(svg.matches(">airspeed (kt)</text>").count(), 1);
    let p = path_points(&svg);
    // The first curve ends where the second begins.
    assert!((p[1][0] - p[2][0]).abs() < 0.02, "{p:?}");
}

#[test]
fn styles_are_the_same_in_every_panel() {
    let panel = || {
        Panel::new(Axis::linear("x", ""), Axis::linear("y", ""))
            .line(Series::new("on", &[0.0, 1.0], &[0.0, 1.0]).style(0))
            .line(Series::new("off", &[0.0, 1.0], &[1.0, 2.0]).style(1))
    };
    let svg = Figure::new("t").panel(panel()).panel(panel()).to_svg();
    // Two curves and one shared legend entry of each style.
    assert_eq!(svg.matches(LIGHT_PALETTE[0]).count(), 3);
    assert_eq!(svg.matches(LIGHT_PALETTE[1]).count(), 3);
    assert_eq!(svg.matches("stroke-dasharray=\"7 3.2\"").count(), 3);
}

#[test]
fn a_heatmap_writes_its_numbers_and_marks_what_fails() {
    let names = |n: &[&str]| n.iter().map(|s| (*s).to_string()).collect::<Vec<_>>();
    let figure = Figure::new("t").panel(
        Panel::new(
            Axis::categories("airspeed", "kt", &names(&["0", "20"])),
            Axis::categories("", "", &names(&["roll", "pitch"])),
        )
        .heatmap(
            &[vec![12.34, -0.04], vec![-5.0, f64::NAN]],
            "design margin (%)",
            1,
            Some(0.0),
        ),
    );
    let svg = figure.to_svg();
    parse(&svg);
    for number in [">12.3<", ">−0.04<", ">−5.0<", ">–<"] {
        assert!(svg.contains(number), "{number}");
    }
    assert_eq!(svg.matches("text-decoration=\"underline\"").count(), 2);
}

#[test]
fn the_stylesheet_is_embedded_on_request_only() {
    assert!(!sample().to_svg().contains("<style>"));
    let svg = sample().adaptive().to_svg();
    assert!(svg.contains("prefers-color-scheme:dark"));
    parse(&svg);
}

#[test]
fn text_is_given_enough_room() {
    // Widths of Helvetica in units of a thousandth (Adobe Font Metrics, 1989):
    // airspeed 556+222+333+500+556+556+556+556, -180.5 584+4*556+278 in all.
    assert!(text_width("airspeed", 1.0) >= 3.835);
    assert!(text_width("−180.5", 1.0) >= 3.086);
    let frame = Frame { x: 0.0, y: 0.0, width: 1.0, height: 1.0 };
    assert!(frame.contains([1.0, 0.0]) && !frame.contains([1.1, 0.0]));
}

#[test]
fn subscripts_are_set_and_stripped_from_hover_texts() {
    let figure = Figure::new("t").panel(
        Panel::new(Axis::linear("x", ""), Axis::linear("K_{P} & more", "1/s^{2}"))
            .line(Series::new("K_{I}, b_c", &[0.0, 1.0], &[0.0, 1.0])),
    );
    let svg = figure.to_svg();
    parse(&svg);
    let set = "K<tspan dy=\"3\" font-size=\"8.25\">P</tspan>\
               <tspan dy=\"-3\" dx=\"3.30\">&amp; more (1/s</tspan>\
               <tspan dy=\"-4\" font-size=\"8.25\">2</tspan><tspan dy=\"4\">)</tspan>";
    assert!(svg.contains(set), "{svg}");
    assert!(svg.contains("<title>KI, b_c: 2 points"));
    assert!(svg.contains(", b_c</tspan></text>"));
}

#[test]
fn a_narrow_figure_has_one_column_that_fits_a_phone() {
    let wide = sample();
    let narrow = wide.narrow().expect("two columns are wide");
    let width = |figure: &Figure| -> f64 {
        attribute(&parse(&figure.to_svg())[0], "width").unwrap().parse().unwrap()
    };
    assert!(width(&narrow) < 375.0, "{}", width(&narrow));
    assert!(width(&wide) > 1.5 * width(&narrow));
    // Nothing is lost, and what is narrow stays.
    assert_eq!(narrow.notes(), wide.notes());
    assert_eq!(narrow.narrow(), None);
    assert!(narrow.class("narrow").to_svg().contains("class=\"cx-plot narrow\""));
}

#[test]
fn a_script_finds_names_units_and_places() {
    let figure = Figure::new("t").panel(
        Panel::new(Axis::linear("airspeed", "kt").range(0.0, 10.0), Axis::linear("P_{s}", "hp"))
            .line(Series::new("", &[0.0, 10.0], &[1.0, 2.0]).hint("upper, on").marks()),
    );
    let elements = parse(&figure.to_svg());
    let panel = elements.iter().find(|e| attribute(e, "data-frame").is_some()).unwrap();
    assert_eq!(attribute(panel, "data-x-name"), Some("airspeed"));
    assert_eq!(attribute(panel, "data-x-unit"), Some("kt"));
    assert_eq!(attribute(panel, "data-y-name"), Some("Ps"));
    assert!(elements.iter().any(|e| attribute(e, "data-label") == Some("upper, on")));
    // A mark says where it is: the ends of the axis are the sides of the frame.
    let frame: Vec<f64> =
        attribute(panel, "data-frame").unwrap().split(' ').map(|n| n.parse().unwrap()).collect();
    let places: Vec<f64> = elements
        .iter()
        .filter_map(|e| attribute(e, "data-at"))
        .map(|at| at.split(' ').next().unwrap().parse().unwrap())
        .collect();
    assert_eq!(places.len(), 2);
    assert!((places[0] - frame[0]).abs() < 0.011);
    assert!((places[1] - frame[0] - frame[2]).abs() < 0.011);
}

#[test]
fn appended_panels_keep_their_figure_s_title() {
    let one = |title: &str| {
        Figure::new(title).panel(
            Panel::new(Axis::linear("x", ""), Axis::linear("y", "")).line(Series::new(
                "s",
                &[0.0, 1.0],
                &[0.0, 1.0],
            )),
        )
    };
    let svg = Figure::new("all").append(one("roll")).append(one("pitch")).to_svg();
    assert!(svg.contains(">roll</text>") && svg.contains(">pitch</text>"));
}
