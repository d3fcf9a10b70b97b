//! A page of text, figures and tables in one file.
//!
//! The file needs nothing else: its style and script are inside, and it forbids
//! itself the network. It follows the reader's light or dark setting, prints in
//! light colours, and can be read and operated with the keyboard alone. Without
//! scripts everything is still there to read.

use std::fmt::Write as _;

use super::plot::{Figure, STYLESHEET, escape, variables};
use super::table::Table;

/// A page.
#[derive(Debug, Clone, PartialEq)]
pub struct Page {
    title: String,
    summary: String,
    sections: Vec<Section>,
}

/// A section under a heading.
#[derive(Debug, Clone, PartialEq)]
pub struct Section {
    heading: String,
    blocks: Vec<Block>,
}

#[derive(Debug, Clone, PartialEq)]
enum Block {
    Paragraph(String),
    List(Vec<String>),
    Preformatted { summary: String, text: String },
    Figure { figure: Box<Figure>, caption: String },
    Table(Box<Table>),
}

impl Section {
    /// A section without contents.
    #[must_use]
    pub fn new(heading: &str) -> Self {
        Self { heading: heading.to_string(), blocks: Vec::new() }
    }

    /// Adds a paragraph of plain text.
    #[must_use]
    pub fn paragraph(mut self, text: &str) -> Self {
        self.blocks.push(Block::Paragraph(text.to_string()));
        self
    }

    /// Adds a list of plain texts.
    #[must_use]
    pub fn list(mut self, items: &[String]) -> Self {
        self.blocks.push(Block::List(items.to_vec()));
        self
    }

    /// Adds text as it stands, like a log, folded behind `summary`.
    #[must_use]
    pub fn preformatted(mut self, summary: &str, text: &str) -> Self {
        self.blocks
            .push(Block::Preformatted { summary: summary.to_string(), text: text.to_string() });
        self
    }

    /// Adds a numbered figure. What it could not draw is said under it.
    #[must_use]
    pub fn figure(mut self, figure: Figure, caption: &str) -> Self {
        self.blocks.push(Block::Figure { figure: Box::new(figure), caption: caption.to_string() });
        self
    }

    /// Adds a table.
    #[must_use]
    pub fn table(mut self, table: Table) -> Self {
        self.blocks.push(Block::Table(Box::new(table)));
        self
    }
}

impl Page {
    /// A page without sections.
    #[must_use]
    pub fn new(title: &str) -> Self {
        Self { title: title.to_string(), summary: String::new(), sections: Vec::new() }
    }

    /// A sentence under the title.
    #[must_use]
    pub fn summary(mut self, summary: &str) -> Self {
        self.summary = summary.to_string();
        self
    }

    /// Adds a section.
    #[must_use]
    pub fn section(mut self, section: Section) -> Self {
        self.sections.push(section);
        self
    }

    /// The page as one HTML file.
    #[must_use]
    pub fn to_html(&self) -> String {
        let mut body = String::new();
        let mut number = 0;
        for (index, section) in self.sections.iter().enumerate() {
            let heading = escape(&section.heading);
            let _ = writeln!(
                body,
                "<section aria-labelledby=\"section-{index}\">\n\
                 <h2 id=\"section-{index}\">{heading}</h2>"
            );
            for block in &section.blocks {
                write_block(&mut body, block, &mut number);
            }
            body.push_str("</section>\n");
        }
        let mut contents = String::new();
        if self.sections.len() > 1 {
            contents.push_str("<nav aria-label=\"Contents\"><ul>\n");
            for (index, section) in self.sections.iter().enumerate() {
                let _ = writeln!(
                    contents,
                    "<li><a href=\"#section-{index}\">{}</a></li>",
                    escape(&section.heading)
                );
            }
            contents.push_str("</ul></nav>\n");
        }
        let summary = if self.summary.is_empty() {
            String::new()
        } else {
            format!("<p class=\"summary\">{}</p>\n", escape(&self.summary))
        };
        let title = escape(&self.title);
        let style = style();
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; \
             style-src 'unsafe-inline'; script-src 'unsafe-inline'\"/>\n\
             <meta name=\"color-scheme\" content=\"light dark\"/>\n\
             <title>{title}</title>\n<style>\n{style}</style>\n</head>\n<body>\n\
             <a class=\"skip\" href=\"#main\">Skip to the contents</a>\n\
             <header>\n<h1>{title}</h1>\n{summary}\
             <button type=\"button\" id=\"theme\" hidden=\"hidden\">Light or dark</button>\n</header>\n\
             {contents}<main id=\"main\">\n{body}</main>\n<script>\n{SCRIPT}</script>\n\
             </body>\n</html>\n"
        )
    }
}

fn write_block(out: &mut String, block: &Block, number: &mut usize) {
    match block {
        Block::Paragraph(text) => {
            let _ = writeln!(out, "<p>{}</p>", escape(text));
        }
        Block::List(items) => {
            out.push_str("<ul>\n");
            for item in items {
                let _ = writeln!(out, "<li>{}</li>", escape(item));
            }
            out.push_str("</ul>\n");
        }
        Block::Preformatted { summary, text } => {
            // Line ends are the point here, and escape() would turn them into blanks.
            let lines: Vec<String> = text.lines().map(escape).collect();
            let _ = writeln!(
                out,
                "<details><summary>{}</summary><pre tabindex=\"0\">{}</pre></details>",
                escape(summary),
                lines.join("\n")
            );
        }
        Block::Table(table) => {
            // Wide tables scroll on their own, also with the keyboard.
            let _ = writeln!(
                out,
                "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{}\">\n{}</div>",
                escape(if table.title().is_empty() { "table" } else { table.title() }),
                table.to_html()
            );
        }
        Block::Figure { figure, caption } => {
            *number += 1;
            let notes: String = figure
                .notes()
                .iter()
                .map(|note| format!("<p class=\"bad\">{}</p>", escape(note)))
                .collect();
            let svg = figure.clone().id(&format!("figure-{number}")).to_svg();
            let text = if caption.is_empty() { figure.title_text() } else { caption };
            let _ = writeln!(
                out,
                "<figure>\n<div class=\"plot\" tabindex=\"0\" role=\"group\" aria-label=\"Figure {number}\">\n\
                 {svg}</div>\n\
                 <output class=\"readout\"></output>\n\
                 <figcaption>Figure {number}. {}</figcaption>\n{notes}</figure>",
                escape(text)
            );
        }
    }
}

fn style() -> String {
    let (light, dark) = (variables(false), variables(true));
    format!(
        "{STYLE}{STYLESHEET}\
         :root[data-theme=light] .cx-plot{{{light}}}\n\
         :root[data-theme=dark] .cx-plot{{{dark}}}\n\
         @media print{{:root .cx-plot,:root[data-theme] .cx-plot{{{light}}}}}\n"
    )
}

const STYLE: &str = "\
:root{--bg:#ffffff;--fg:#1f2328;--muted:#5b636b;--line:#d5dade;--link:#0b5cad;--good:#12693f;\
--warning:#8a5300;--bad:#b3261e}
@media (prefers-color-scheme:dark){:root{--bg:#14181d;--fg:#e6e6e6;--muted:#9aa4ae;--line:#353c44;\
--link:#7fbdf5;--good:#5fd394;--warning:#f0b94b;--bad:#ff8a7d}}
:root[data-theme=light]{--bg:#ffffff;--fg:#1f2328;--muted:#5b636b;--line:#d5dade;--link:#0b5cad;\
--good:#12693f;--warning:#8a5300;--bad:#b3261e}
:root[data-theme=dark]{--bg:#14181d;--fg:#e6e6e6;--muted:#9aa4ae;--line:#353c44;--link:#7fbdf5;\
--good:#5fd394;--warning:#f0b94b;--bad:#ff8a7d}
body{margin:0 auto;max-width:60rem;padding:1.5rem 1rem 4rem;background:var(--bg);color:var(--fg);\
font:1rem/1.5 system-ui,-apple-system,'Segoe UI',Roboto,'Helvetica Neue',Arial,sans-serif}
h1{line-height:1.2;margin:0 0 .3rem}h2{margin:2.2rem 0 .6rem;border-bottom:1px solid var(--line)}
a{color:var(--link)}.summary{color:var(--muted);margin:.2rem 0 .6rem}
.skip{position:absolute;left:-99rem}.skip:focus{position:static}
nav ul{display:flex;flex-wrap:wrap;gap:.2rem 1.2rem;padding:0;list-style:none}
button{font:inherit;color:inherit;background:none;border:1px solid var(--line);border-radius:.3rem;\
padding:.15rem .7rem}
figure{margin:1.4rem 0}.plot{overflow:hidden}.plot svg{max-width:100%;height:auto;display:block;\
margin:0 auto}
:focus-visible{outline:2px solid var(--link);outline-offset:2px}
.readout{display:block;min-height:1.4em;text-align:center;color:var(--muted);font-size:.85rem;\
font-variant-numeric:tabular-nums}
figcaption{text-align:center;color:var(--muted);font-size:.92rem}
.scroll{overflow-x:auto;margin:1rem 0}table{border-collapse:collapse;font-size:.92rem}
caption{text-align:left;font-weight:600;padding-bottom:.3rem}
th,td{padding:.2rem .8rem;text-align:left;border-bottom:1px solid var(--line);white-space:nowrap}
th{vertical-align:bottom}.unit{display:block;font-weight:400;color:var(--muted)}
.number{text-align:right;font-variant-numeric:tabular-nums}
.good{color:var(--good)}.warning{color:var(--warning);font-weight:600}\
.bad{color:var(--bad);font-weight:600}
pre{overflow-x:auto;border:1px solid var(--line);padding:.7rem;font-size:.85rem}
@media print{:root,:root[data-theme]{--bg:#ffffff;--fg:#000000;--muted:#444444;--line:#bbbbbb;\
--link:#000000}body{max-width:none;padding:0;font-size:10pt}nav,button,.readout,.skip{display:none}\
figure,tr{break-inside:avoid}h2{break-after:avoid}}
";

/// Values under the cursor, and zooming and panning: wheel with Ctrl or on a
/// focused figure, drag, and the keys + - 0 and arrows.
const SCRIPT: &str = r#""use strict";
(function () {
  var root = document.documentElement;
  var button = document.getElementById("theme");
  button.hidden = false;
  button.addEventListener("click", function () {
    var dark = root.dataset.theme ? root.dataset.theme === "dark"
      : matchMedia("(prefers-color-scheme: dark)").matches;
    root.dataset.theme = dark ? "light" : "dark";
  });

  function numbers(text) { return text.split(" ").map(Number); }
  function value(range, fraction) {
    var part = range.split(" "), low = Number(part[0]), high = Number(part[1]);
    return part[2] === "log" ? low * Math.pow(high / low, fraction) : low + (high - low) * fraction;
  }
  function write(v, unit) {
    var size = Math.abs(v);
    var text = v === 0 || (size >= 1e-3 && size < 1e6) ? Number(v.toPrecision(4)).toString()
      : v.toExponential(3);
    return text.replace("-", "\u2212") + (unit ? " " + unit : "");
  }

  document.querySelectorAll(".plot").forEach(function (plot) {
    var svg = plot.querySelector("svg");
    var readout = plot.parentElement.querySelector(".readout");
    var home = numbers(svg.getAttribute("viewBox"));
    var view = home.slice();
    var panels = Array.from(svg.querySelectorAll("[data-frame]"));

    function place(event) {
      var matrix = svg.getScreenCTM();
      return matrix ? new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix.inverse())
        : null;
    }
    function show() {
      // The view stays inside the figure.
      [0, 1].forEach(function (k) {
        view[k + 2] = Math.min(view[k + 2], home[k + 2]);
        view[k] = Math.min(Math.max(view[k], home[k]), home[k] + home[k + 2] - view[k + 2]);
      });
      svg.setAttribute("viewBox", view.join(" "));
    }
    function zoom(factor, x, y) {
      factor = Math.max(factor, 0.02 * home[2] / view[2]);
      view = [x - (x - view[0]) * factor, y - (y - view[1]) * factor,
        view[2] * factor, view[3] * factor];
      show();
    }

    plot.addEventListener("pointermove", function (event) {
      var at = place(event), text = "";
      if (!at) { return; }
      panels.forEach(function (panel) {
        var f = numbers(panel.dataset.frame);
        var x = (at.x - f[0]) / f[2], y = 1 - (at.y - f[1]) / f[3];
        if (x >= 0 && x <= 1 && y >= 0 && y <= 1) {
          text = "x " + write(value(panel.dataset.x, x), panel.dataset.xUnit) +
            ",  y " + write(value(panel.dataset.y, y), panel.dataset.yUnit);
        }
      });
      readout.textContent = text;
      if (drag) {
        view[0] += drag.x - at.x;
        view[1] += drag.y - at.y;
        show();
      }
    });
    plot.addEventListener("focus", function () {
      readout.textContent = "+ and \u2212 zoom, arrows move, 0 shows all";
    });
    plot.addEventListener("blur", function () { readout.textContent = ""; });
    plot.addEventListener("pointerleave", function () { readout.textContent = ""; });

    var drag = null;
    plot.addEventListener("pointerdown", function (event) {
      if (event.button === 0 && view[2] < home[2]) {
        drag = place(event);
        plot.setPointerCapture(event.pointerId);
      }
    });
    ["pointerup", "pointercancel"].forEach(function (name) {
      plot.addEventListener(name, function () { drag = null; });
    });
    plot.addEventListener("dblclick", function () { view = home.slice(); show(); });
    plot.addEventListener("wheel", function (event) {
      var at = place(event);
      if (at && (event.ctrlKey || document.activeElement === plot)) {
        event.preventDefault();
        zoom(event.deltaY < 0 ? 0.85 : 1 / 0.85, at.x, at.y);
      }
    }, { passive: false });
    plot.addEventListener("keydown", function (event) {
      var x = view[0] + view[2] / 2, y = view[1] + view[3] / 2, step = 0.1 * view[2];
      if (event.ctrlKey || event.altKey || event.metaKey) { return; }
      if (event.key === "+" || event.key === "=") { zoom(0.8, x, y); }
      else if (event.key === "-") { zoom(1.25, x, y); }
      else if (event.key === "0") { view = home.slice(); show(); }
      else if (view[2] < home[2] && event.key === "ArrowLeft") { view[0] -= step; show(); }
      else if (view[2] < home[2] && event.key === "ArrowRight") { view[0] += step; show(); }
      else if (view[2] < home[2] && event.key === "ArrowUp") { view[1] -= step; show(); }
      else if (view[2] < home[2] && event.key === "ArrowDown") { view[1] += step; show(); }
      else { return; }
      event.preventDefault();
    });
  });
}());
"#;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::plot::{Axis, Panel, Series};
    use crate::report::table::{Cell, Column, Digits, Highlight};
    use quick_xml::events::Event;
    use std::collections::BTreeSet;

    fn sample() -> Page {
        let figure = Figure::new("A & B").panel(
            Panel::new(Axis::linear("x", "s"), Axis::linear("y", "deg"))
                .line(Series::new("a", &[0.0, 1.0], &[0.0, 1.0]))
                .line(Series::new("b", &[0.0], &[])),
        );
        let mut table = Table::new(
            "Margins",
            vec![Column::text("spec"), Column::number("margin", "%", Digits::Decimals(1))],
        );
        table.row([Cell::from("roll <phase>"), Cell::from(-3.0).highlight(Highlight::Bad)]);
        Page::new("Report on <this>")
            .summary("all & sundry")
            .section(
                Section::new("Trim")
                    .paragraph("1 < 2")
                    .figure(figure.clone(), "")
                    .figure(figure, "The same again"),
            )
            .section(
                Section::new("Tuning")
                    .list(&["one".to_string(), "two".to_string()])
                    .table(table)
                    .preformatted("log", "a < b\n  c & d"),
            )
    }

    /// The page without its style and script, which are not markup.
    fn markup(html: &str) -> String {
        let mut out = html.to_string();
        for (open, close) in [("<style>", "</style>"), ("<script>", "</script>")] {
            let from = out.find(open).unwrap() + open.len();
            let to = out.find(close).unwrap();
            out.replace_range(from..to, "");
        }
        out
    }

    #[test]
    fn the_page_is_well_formed_and_its_identifiers_are_unique() {
        let html = sample().to_html();
        let text = markup(&html);
        let mut reader = quick_xml::Reader::from_str(&text);
        let mut ids = Vec::new();
        let mut depth = 0;
        loop {
            let event = reader.read_event().expect("well-formed markup");
            match &event {
                Event::Start(_) => depth += 1,
                Event::End(_) => depth -= 1,
                Event::Eof => break,
                _ => {}
            }
            if let Event::Start(e) | Event::Empty(e) = &event {
                for a in e.attributes() {
                    let a = a.expect("well-formed attribute");
                    if a.key.as_ref() == "id" {
                        ids.push(a.value.to_string());
                    }
                }
            }
        }
        assert_eq!(depth, 0);
        let distinct: BTreeSet<&String> = ids.iter().collect();
        assert_eq!(distinct.len(), ids.len(), "{ids:?}");
    }

    #[test]
    fn the_page_asks_for_nothing_from_outside() {
        let html = sample().to_html();
        assert!(html.contains("default-src 'none'"));
        // The only address is the name of the SVG vocabulary.
        let addresses = html.matches("://").count();
        assert_eq!(addresses, html.matches("http://www.w3.org/2000/svg").count());
        assert!(!html.contains(" src=") && !html.contains("@import"));
    }

    #[test]
    fn what_a_figure_could_not_draw_is_said_under_it() {
        let html = sample().to_html();
        let said = "<p class=\"bad\">b: not drawn, 1 abscissae but 0 ordinates</p>";
        assert_eq!(html.matches(said).count(), 2);
        assert!(html.contains("Figure 1. A &amp; B"));
        assert!(html.contains("Figure 2. The same again"));
    }

    #[test]
    fn preformatted_text_keeps_its_lines_and_tables_their_highlights() {
        let html = sample().to_html();
        assert!(html.contains("a &lt; b\n  c &amp; d</pre>"));
        assert!(html.contains("<td class=\"number bad\">-3.0</td>"));
        assert!(html.contains("<td>roll &lt;phase&gt;</td>"));
    }
}
