//! A page of text, figures and tables in one file.
//!
//! The file needs nothing else: its style and script are inside, and it forbids
//! itself the network. It follows the reader's light or dark setting, prints in
//! light colours, and can be read and operated with the keyboard alone. Without
//! scripts everything is still there to read.

use std::fmt::Write as _;

use super::plot::diagram::Diagram;
use super::plot::{Figure, STYLESHEET, escape, variables};
use super::table::{Highlight, Table};

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
    Heading(String),
    Paragraph(String),
    List(Vec<String>),
    Verdict { highlight: Highlight, headline: String, text: String },
    Facts(Vec<(String, String)>),
    Preformatted { summary: String, text: String },
    Figure { figure: Box<Figure>, caption: String },
    Diagram { diagram: Box<Diagram>, caption: String },
    Table(Box<Table>),
    Folded { summary: String, table: Box<Table> },
}

impl Section {
    /// A section without contents.
    #[must_use]
    pub fn new(heading: &str) -> Self {
        Self { heading: heading.to_string(), blocks: Vec::new() }
    }

    /// Adds a heading below the section's own.
    #[must_use]
    pub fn heading(mut self, text: &str) -> Self {
        self.blocks.push(Block::Heading(text.to_string()));
        self
    }

    /// Adds a judgement that nobody should miss: a headline and a sentence.
    #[must_use]
    pub fn verdict(mut self, highlight: Highlight, headline: &str, text: &str) -> Self {
        self.blocks.push(Block::Verdict {
            highlight,
            headline: headline.to_string(),
            text: text.to_string(),
        });
        self
    }

    /// Adds names and their values, such as the weight of an aircraft.
    #[must_use]
    pub fn facts(mut self, facts: Vec<(String, String)>) -> Self {
        self.blocks.push(Block::Facts(facts));
        self
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

    /// Adds a numbered block diagram.
    #[must_use]
    pub fn diagram(mut self, diagram: Diagram, caption: &str) -> Self {
        self.blocks
            .push(Block::Diagram { diagram: Box::new(diagram), caption: caption.to_string() });
        self
    }

    /// Adds a table.
    #[must_use]
    pub fn table(mut self, table: Table) -> Self {
        self.blocks.push(Block::Table(Box::new(table)));
        self
    }

    /// Adds a long table, folded behind `summary` on the screen.
    #[must_use]
    pub fn folded(mut self, summary: &str, table: Table) -> Self {
        self.blocks.push(Block::Folded { summary: summary.to_string(), table: Box::new(table) });
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
        Block::Heading(text) => {
            let _ = writeln!(out, "<h3>{}</h3>", escape(text));
        }
        Block::Verdict { highlight, headline, text } => {
            let class = match highlight {
                Highlight::Good => "good",
                Highlight::Warning => "warning",
                Highlight::Bad => "bad",
                Highlight::Plain => "plain",
            };
            let _ = writeln!(
                out,
                "<p class=\"verdict {class}\"><strong>{}</strong> {}</p>",
                escape(headline),
                escape(text)
            );
        }
        Block::Facts(facts) => {
            out.push_str("<dl class=\"facts\">\n");
            for (name, value) in facts {
                let (name, value) = (escape(name), escape(value));
                let _ = writeln!(out, "<div><dt>{name}</dt><dd>{value}</dd></div>");
            }
            out.push_str("</dl>\n");
        }
        Block::Table(table) => write_table(out, table),
        Block::Folded { summary, table } => {
            let _ = writeln!(out, "<details><summary>{}</summary>", escape(summary));
            write_table(out, table);
            out.push_str("</details>\n");
        }
        Block::Figure { figure, caption } => {
            *number += 1;
            let notes: String = figure
                .notes()
                .iter()
                .map(|note| format!("<p class=\"bad\">{}</p>", escape(note)))
                .collect();
            let id = format!("figure-{number}");
            let wide = figure.clone().id(&id);
            // A phone gets the panels one below the other.
            let (class, drawings) = match figure.narrow() {
                Some(narrow) => (
                    "plot",
                    wide.class("wide").to_svg()
                        + &narrow.id(&format!("{id}-narrow")).class("narrow").to_svg(),
                ),
                None if figure.is_long() => ("plot long", wide.to_svg()),
                None => ("plot", wide.to_svg()),
            };
            let text = if caption.is_empty() { figure.title_text() } else { caption };
            write_figure(out, *number, class, figure.title_text(), &drawings, text);
            out.push_str(&notes);
            out.push_str("</figure>\n");
        }
        Block::Diagram { diagram, caption } => {
            *number += 1;
            let svg = diagram.to_svg(&format!("figure-{number}"));
            let text = if caption.is_empty() { diagram.title_text() } else { caption };
            write_figure(out, *number, "plot long", diagram.title_text(), &svg, text);
            out.push_str("</figure>\n");
        }
    }
}

/// A figure but for its closing tag.
fn write_figure(
    out: &mut String,
    number: usize,
    class: &str,
    title: &str,
    drawings: &str,
    caption: &str,
) {
    let _ = writeln!(
        out,
        "<figure>\n<div class=\"{class}\" role=\"group\" aria-label=\"Figure {number}. {}\">\n\
         {drawings}</div>\n<output class=\"readout\"></output>\n\
         <figcaption>Figure {number}. {}</figcaption>",
        escape(title),
        escape(caption)
    );
}

/// Wide tables scroll on their own, also with the keyboard.
fn write_table(out: &mut String, table: &Table) {
    let _ = writeln!(
        out,
        "<div class=\"scroll\" tabindex=\"0\" role=\"region\" aria-label=\"{}\">\n{}</div>",
        escape(if table.title().is_empty() { "table" } else { table.title() }),
        table.to_html()
    );
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

/// Style of everything but the figures.
const STYLE: &str = include_str!("html/style.css");

/// Values under the cursor, a cursor for the keyboard, zooming and panning.
const SCRIPT: &str = include_str!("html/script.js");

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

    #[test]
    fn judgements_facts_and_folds_say_it_in_words() {
        let mut table = Table::new("All", vec![Column::text("a")]);
        table.row([Cell::from("x")]);
        let html = Page::new("t")
            .section(
                Section::new("s")
                    .heading("Part <1>")
                    .verdict(Highlight::Bad, "Not met.", "Two & three.")
                    .facts(vec![("weight".into(), "992 lbf".into())])
                    .diagram(Diagram::new("Loop", 100.0, 50.0), "A loop")
                    .folded("Everything", table),
            )
            .to_html();
        for part in [
            "<h3>Part &lt;1&gt;</h3>",
            "<p class=\"verdict bad\"><strong>Not met.</strong> Two &amp; three.</p>",
            "<dt>weight</dt><dd>992 lbf</dd>",
            "<figcaption>Figure 1. A loop</figcaption>",
            "<details><summary>Everything</summary>",
        ] {
            assert!(html.contains(part), "{part}");
        }
        let text = markup(&html);
        let mut reader = quick_xml::Reader::from_str(&text);
        while !matches!(reader.read_event().expect("well-formed markup"), Event::Eof) {}
    }
}
