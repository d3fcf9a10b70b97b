//! Aligned text tables, also as Markdown and CSV.
//!
//! A [`Table`] has named columns with units and rows of [`Cell`]s. Numbers are
//! aligned on the decimal point, and none is ever written as `-0.000`.

use std::io::IsTerminal as _;

use unicode_width::UnicodeWidthStr as _;

use super::plot::escape;

/// How the numbers of a column are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Digits {
    /// This many decimals.
    Decimals(usize),
    /// This many significant digits.
    Significant(usize),
}

/// How much attention a cell asks for. It is shown by colour on terminals only,
/// so the text of the cell must say it too.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Highlight {
    /// None.
    #[default]
    Plain,
    /// Met, converged.
    Good,
    /// Just met, to be looked at.
    Warning,
    /// Not met, not converged.
    Bad,
}

/// One cell.
#[derive(Debug, Clone, PartialEq)]
pub struct Cell {
    content: Content,
    highlight: Highlight,
}

#[derive(Debug, Clone, PartialEq)]
enum Content {
    Text(String),
    Number(f64),
    Empty,
}

impl Cell {
    /// A cell that says nothing.
    #[must_use]
    pub fn empty() -> Self {
        Self { content: Content::Empty, highlight: Highlight::Plain }
    }

    /// The same cell, asking for attention.
    #[must_use]
    pub fn highlight(mut self, highlight: Highlight) -> Self {
        self.highlight = highlight;
        self
    }
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::from(text.to_string())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self { content: Content::Text(text), highlight: Highlight::Plain }
    }
}

impl From<f64> for Cell {
    fn from(value: f64) -> Self {
        Self { content: Content::Number(value), highlight: Highlight::Plain }
    }
}

impl From<Option<f64>> for Cell {
    fn from(value: Option<f64>) -> Self {
        value.map_or_else(Self::empty, Self::from)
    }
}

/// What a column holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    name: String,
    unit: String,
    digits: Digits,
}

/// A Greek letter's name.
fn greek(c: char) -> Option<&'static str> {
    Some(match c {
        'α' => "alpha",
        'β' => "beta",
        'δ' | 'Δ' => "delta",
        'ζ' => "zeta",
        'η' => "eta",
        'θ' => "theta",
        'κ' => "kappa",
        'λ' => "lambda",
        'µ' | 'μ' => "mu",
        'ν' => "nu",
        'ρ' => "rho",
        'σ' | 'Σ' => "sigma",
        'τ' => "tau",
        'φ' => "phi",
        'χ' => "chi",
        'ψ' => "psi",
        'ω' | 'Ω' => "omega",
        _ => return None,
    })
}

impl Column {
    /// Name and unit in lower-case ASCII letters, digits and `_`: `speed_kt`,
    /// `turn_rate_rad_s`. A column without a name is the result.
    fn identifier(&self) -> String {
        if self.name.is_empty() && self.unit.is_empty() {
            return "result".into();
        }
        let mut text = String::new();
        let mut gap = false;
        for c in format!("{} {}", self.name, self.unit).chars() {
            let word: String = match c {
                '%' => " percent".into(),
                '₀'..='₉' => char::from(b'0' + (c as u32 - '₀' as u32) as u8).into(),
                c if c.is_ascii_alphanumeric() => c.to_ascii_lowercase().into(),
                c => greek(c).unwrap_or(" ").into(),
            };
            for c in word.chars() {
                if c == ' ' {
                    gap = true;
                    continue;
                }
                if gap && !text.is_empty() {
                    text.push('_');
                }
                gap = false;
                text.push(c);
            }
        }
        text
    }

    /// A column of text.
    #[must_use]
    pub fn text(name: &str) -> Self {
        Self::number(name, "", Digits::Significant(6))
    }

    /// A column of numbers in `unit`, which may be empty.
    #[must_use]
    pub fn number(name: &str, unit: &str, digits: Digits) -> Self {
        Self { name: name.to_string(), unit: unit.to_string(), digits }
    }
}

/// Rows of cells under named columns.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    title: String,
    columns: Vec<Column>,
    rows: Vec<Vec<Cell>>,
}

/// Whether text may be coloured with terminal escapes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coloring {
    /// Never.
    Off,
    /// Always.
    On,
}

impl Coloring {
    /// On if standard output is a terminal that wants colour: `NO_COLOR` is not
    /// set to anything (<https://no-color.org>) and `TERM` is not `dumb`.
    #[must_use]
    pub fn for_stdout() -> Self {
        Self::decide(
            std::io::stdout().is_terminal(),
            std::env::var_os("NO_COLOR").is_some_and(|v| !v.is_empty()),
            std::env::var_os("TERM").is_some_and(|v| v == "dumb"),
        )
    }

    fn decide(terminal: bool, no_color: bool, dumb: bool) -> Self {
        if terminal && !no_color && !dumb { Self::On } else { Self::Off }
    }
}

/// `value` with `count` significant digits (at least one).
///
/// Between 1e-4 and 1e6 in plain notation, otherwise with an exponent. Zero,
/// and only zero, is written `0`; values that are not finite as `nan`, `inf`, `-inf`.
#[must_use]
pub fn significant(value: f64, count: usize) -> String {
    let count = count.clamp(1, 17);
    if value.is_nan() {
        return "nan".to_string();
    }
    if value.is_infinite() {
        return if value > 0.0 { "inf" } else { "-inf" }.to_string();
    }
    if value == 0.0 {
        return "0".to_string();
    }
    // The exponent after rounding: 9.996 with three digits is 10.0, not 9.996.
    let scientific = format!("{value:.*e}", count - 1);
    let Some((mantissa, exponent)) = scientific.split_once('e') else {
        return scientific;
    };
    let Ok(exponent) = exponent.parse::<i32>() else {
        return scientific;
    };
    if !(-4..6).contains(&exponent) {
        return format!("{mantissa}e{exponent}");
    }
    let decimals = usize::try_from(count as i32 - 1 - exponent).unwrap_or(0);
    if decimals == 0 {
        // Digits beyond those asked for are zeros, not noise.
        let rounded: f64 = scientific.parse().unwrap_or(value);
        return format!("{rounded:.0}");
    }
    format!("{value:.decimals$}")
}

/// `value` with `count` decimals and no negative zero; values that are not
/// finite as in [`significant`].
#[must_use]
pub fn decimals(value: f64, count: usize) -> String {
    if !value.is_finite() {
        return significant(value, 1);
    }
    let text = format!("{value:.count$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.bytes().all(|b| b == b'0' || b == b'.') => rest.to_string(),
        _ => text,
    }
}

fn write_number(value: f64, digits: Digits) -> String {
    match digits {
        Digits::Decimals(count) => decimals(value, count),
        Digits::Significant(count) => significant(value, count),
    }
}

/// Characters before the decimal point, or before the exponent, of a number.
fn whole_part(number: &str) -> usize {
    number.find(['.', 'e']).unwrap_or(number.len())
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Side {
    Left,
    Right,
}

/// A column laid out: header, unit, cell texts of equal width, and their side.
struct Laid {
    name: String,
    unit: String,
    cells: Vec<String>,
    width: usize,
    side: Side,
}

fn pad(text: &str, width: usize, side: Side) -> String {
    let room = " ".repeat(width.saturating_sub(text.width()));
    match side {
        Side::Left => format!("{text}{room}"),
        Side::Right => format!("{room}{text}"),
    }
}

impl Table {
    /// A table without rows.
    #[must_use]
    pub fn new(title: &str, columns: Vec<Column>) -> Self {
        Self { title: title.to_string(), columns, rows: Vec::new() }
    }

    /// Adds a row. Missing cells at its end are empty.
    ///
    /// # Panics
    /// If the row has more cells than the table has columns, which is a mistake
    /// in the calling code.
    pub fn row<C: Into<Cell>>(&mut self, cells: impl IntoIterator<Item = C>) -> &mut Self {
        let mut cells: Vec<Cell> = cells.into_iter().map(Into::into).collect();
        assert!(
            cells.len() <= self.columns.len(),
            "a row of {} cells in a table of {} columns",
            cells.len(),
            self.columns.len()
        );
        cells.resize(self.columns.len(), Cell::empty());
        self.rows.push(cells);
        self
    }

    /// Number of rows.
    #[must_use]
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there are no rows.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Title, without formatting.
    #[must_use]
    pub fn title(&self) -> &str {
        &self.title
    }

    fn laid(&self) -> Vec<Laid> {
        self.columns
            .iter()
            .enumerate()
            .map(|(index, column)| {
                let contents: Vec<&Content> =
                    self.rows.iter().map(|row| &row[index].content).collect();
                let texts: Vec<String> = contents
                    .iter()
                    .map(|content| match content {
                        Content::Text(text) => text.clone(),
                        Content::Number(value) => write_number(*value, column.digits),
                        Content::Empty => String::new(),
                    })
                    .collect();
                let finite =
                    |content: &Content| matches!(content, Content::Number(v) if v.is_finite());
                let numeric = contents.iter().any(|c| matches!(c, Content::Number(_)));
                // Room on both sides of the point, over the finite numbers.
                let (mut before, mut after) = (0, 0);
                for (content, text) in contents.iter().zip(&texts) {
                    if finite(content) {
                        before = before.max(whole_part(text));
                        after = after.max(text.len() - whole_part(text));
                    }
                }
                let cells: Vec<String> = contents
                    .iter()
                    .zip(&texts)
                    .map(|(content, text)| {
                        if finite(content) {
                            let lead = before - whole_part(text);
                            let trail = after - (text.len() - whole_part(text));
                            format!("{}{text}{}", " ".repeat(lead), " ".repeat(trail))
                        } else {
                            text.clone()
                        }
                    })
                    .collect();
                let width = cells
                    .iter()
                    .map(|c| c.width())
                    .chain([column.name.width(), column.unit.width()])
                    .max()
                    .unwrap_or(0);
                let side = if numeric { Side::Right } else { Side::Left };
                Laid { name: column.name.clone(), unit: column.unit.clone(), cells, width, side }
            })
            .collect()
    }

    /// The table for a terminal or a text file: title, names, units (if any
    /// column has one), a rule, rows. Lines have no blanks at their end.
    #[must_use]
    pub fn to_text(&self, coloring: Coloring) -> String {
        let laid = self.laid();
        let line = |parts: Vec<String>| parts.join("  ").trim_end().to_string() + "\n";
        let mut out = String::new();
        if !self.title.is_empty() {
            out.push_str(&self.title);
            out.push('\n');
        }
        out.push_str(&line(laid.iter().map(|c| pad(&c.name, c.width, c.side)).collect()));
        if laid.iter().any(|c| !c.unit.is_empty()) {
            out.push_str(&line(laid.iter().map(|c| pad(&c.unit, c.width, c.side)).collect()));
        }
        out.push_str(&line(laid.iter().map(|c| "─".repeat(c.width)).collect()));
        for (index, row) in self.rows.iter().enumerate() {
            let parts = laid
                .iter()
                .zip(row)
                .map(|(c, cell)| {
                    let text = pad(&c.cells[index], c.width, c.side);
                    match (coloring, cell.highlight) {
                        (Coloring::Off, _) | (_, Highlight::Plain) => text,
                        (_, Highlight::Good) => format!("\u{1b}[32m{text}\u{1b}[0m"),
                        (_, Highlight::Warning) => format!("\u{1b}[33m{text}\u{1b}[0m"),
                        (_, Highlight::Bad) => format!("\u{1b}[31m{text}\u{1b}[0m"),
                    }
                })
                .collect();
            out.push_str(&line(parts));
        }
        out
    }

    /// The table as Markdown, units in brackets after the names.
    #[must_use]
    pub fn to_markdown(&self) -> String {
        let laid = self.laid();
        let escape = |text: &str| text.replace('|', "\\|").replace('\n', " ");
        let headers: Vec<String> = laid
            .iter()
            .map(|c| {
                if c.unit.is_empty() {
                    escape(&c.name)
                } else {
                    format!("{} ({})", escape(&c.name), escape(&c.unit))
                }
            })
            .collect();
        let columns: Vec<Vec<String>> =
            laid.iter().map(|c| c.cells.iter().map(|t| escape(t)).collect()).collect();
        let widths: Vec<usize> = headers
            .iter()
            .zip(&columns)
            .map(|(h, cells)| {
                cells.iter().map(|c| c.width()).chain([h.width(), 3]).max().unwrap_or(3)
            })
            .collect();
        let mut out = String::new();
        if !self.title.is_empty() {
            out.push_str(&format!("**{}**\n\n", self.title));
        }
        let row = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
        out.push_str(&row(headers
            .iter()
            .zip(laid.iter().zip(&widths))
            .map(|(h, (c, &w))| pad(h, w, c.side))
            .collect()));
        let rules: Vec<String> = laid
            .iter()
            .zip(&widths)
            .map(|(c, &w)| match c.side {
                Side::Left => "-".repeat(w),
                Side::Right => "-".repeat(w - 1) + ":",
            })
            .collect();
        out.push_str(&row(rules));
        for index in 0..self.rows.len() {
            out.push_str(&row(columns
                .iter()
                .zip(laid.iter().zip(&widths))
                .map(|(cells, (c, &w))| pad(&cells[index], w, c.side))
                .collect()));
        }
        out
    }

    /// The table as an HTML `<table>`: units under the names, numbers to the
    /// right, highlights as the classes `good`, `warning` and `bad`.
    #[must_use]
    pub fn to_html(&self) -> String {
        let laid = self.laid();
        let mut out = String::from("<table>\n");
        if !self.title.is_empty() {
            out.push_str(&format!("<caption>{}</caption>\n", escape(&self.title)));
        }
        let side = |c: &Laid| match c.side {
            Side::Left => "",
            Side::Right => " class=\"number\"",
        };
        out.push_str("<thead><tr>");
        for c in &laid {
            let unit = if c.unit.is_empty() {
                String::new()
            } else {
                format!(" <span class=\"unit\">{}</span>", escape(&c.unit))
            };
            out.push_str(&format!("<th scope=\"col\"{}>{}{unit}</th>", side(c), escape(&c.name)));
        }
        out.push_str("</tr></thead>\n<tbody>\n");
        for (index, row) in self.rows.iter().enumerate() {
            out.push_str("<tr>");
            for (c, cell) in laid.iter().zip(row) {
                let class = match cell.highlight {
                    Highlight::Plain => "",
                    Highlight::Good => "good",
                    Highlight::Warning => "warning",
                    Highlight::Bad => "bad",
                };
                let number = if c.side == Side::Right { "number" } else { "" };
                let class = format!("{number} {class}");
                let class = match class.trim() {
                    "" => String::new(),
                    class => format!(" class=\"{class}\""),
                };
                // Blanks after the number keep the points in line.
                let text = c.cells[index].trim_start().replace(' ', "\u{2007}");
                let text = match cell.content {
                    Content::Number(_) => text,
                    _ => c.cells[index].clone(),
                };
                out.push_str(&format!("<td{class}>{}</td>", escape(&text)));
            }
            out.push_str("</tr>\n");
        }
        out.push_str("</tbody>\n</table>\n");
        out
    }

    /// The table with columns before its own that hold one text in every row,
    /// such as the design that the rows are of.
    #[must_use]
    pub fn with_texts_before(mut self, texts: &[(&str, &str)]) -> Self {
        self.columns.splice(0..0, texts.iter().map(|(name, _)| Column::text(name)));
        for row in &mut self.rows {
            row.splice(0..0, texts.iter().map(|(_, text)| Cell::from(*text)));
        }
        self
    }

    /// The table as CSV (RFC 4180): one header line of identifiers that end in
    /// the unit, such as `speed_kt`, and numbers in full precision, whatever the
    /// digits of the columns.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let quote = |text: &str| {
            if text.contains([',', '"', '\n', '\r']) {
                format!("\"{}\"", text.replace('"', "\"\""))
            } else {
                text.to_string()
            }
        };
        let mut out = String::new();
        let mut headers: Vec<String> = Vec::with_capacity(self.columns.len());
        for column in &self.columns {
            let name = column.identifier();
            let same = |h: &String| *h == name || h.starts_with(&format!("{name}_of_"));
            match headers.iter().filter(|h| same(h)).count() {
                0 => headers.push(name),
                before => headers.push(format!("{name}_of_{}", before + 1)),
            }
        }
        out.push_str(&headers.join(","));
        out.push_str("\r\n");
        for row in &self.rows {
            let cells: Vec<String> = row
                .iter()
                .map(|cell| match &cell.content {
                    Content::Text(text) => quote(text),
                    // Adding zero turns -0.0 into 0.0.
                    Content::Number(value) if value.is_finite() => format!("{}", value + 0.0),
                    Content::Number(value) => significant(*value, 1),
                    Content::Empty => String::new(),
                })
                .collect();
            out.push_str(&cells.join(","));
            out.push_str("\r\n");
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sample() -> Table {
        let mut table = Table::new(
            "Trim",
            vec![
                Column::text("quantity"),
                Column::number("θ", "deg", Digits::Decimals(2)),
                Column::number("power", "hp", Digits::Significant(4)),
                Column::text("status"),
            ],
        );
        table.row([
            Cell::from("hover"),
            Cell::from(3.407),
            Cell::from(74.88),
            Cell::from("converged").highlight(Highlight::Good),
        ]);
        table.row([
            Cell::from("40 kt → 50 kt"),
            Cell::from(-0.001),
            Cell::from(8.125),
            Cell::from("stalled").highlight(Highlight::Bad),
        ]);
        table.row([Cell::from("60 kt"), Cell::from(f64::NAN), Cell::from(124.9)]);
        table
    }

    #[test]
    fn text_is_aligned_on_the_point() {
        let expected = "\
Trim
quantity          θ    power  status
                deg       hp
─────────────  ────  ───────  ─────────
hover          3.41   74.88   converged
40 kt → 50 kt  0.00    8.125  stalled
60 kt           nan  124.9
";
        assert_eq!(sample().to_text(Coloring::Off), expected);
    }

    #[test]
    fn wide_characters_keep_the_columns_straight() {
        let mut table = Table::new(
            "",
            vec![Column::text("name"), Column::number("x", "m²", Digits::Decimals(1))],
        );
        table.row([Cell::from("双旋翼"), Cell::from(1.0)]);
        table.row([Cell::from("e\u{301}"), Cell::from(-10.0)]);
        let text = table.to_text(Coloring::Off);
        let ends: Vec<usize> = text
            .lines()
            .filter(|l| !l.contains('─'))
            .map(unicode_width::UnicodeWidthStr::width)
            .collect();
        assert!(ends.windows(2).all(|w| w[0] == w[1]), "{text}{ends:?}");
    }

    #[test]
    fn colour_is_an_extra_only() {
        let plain = sample().to_text(Coloring::Off);
        let colored = sample().to_text(Coloring::On);
        assert!(!plain.contains('\u{1b}'));
        assert!(colored.contains("\u{1b}[31mstalled"));
        let mut stripped = colored;
        for code in ["\u{1b}[31m", "\u{1b}[32m", "\u{1b}[33m", "\u{1b}[0m"] {
            stripped = stripped.replace(code, "");
        }
        let trimmed: String = stripped.lines().map(|l| l.trim_end().to_string() + "\n").collect();
        assert_eq!(trimmed, plain);
        assert_eq!(Coloring::decide(true, false, false), Coloring::On);
        assert_eq!(Coloring::decide(true, true, false), Coloring::Off);
        assert_eq!(Coloring::decide(false, false, false), Coloring::Off);
        assert_eq!(Coloring::decide(true, false, true), Coloring::Off);
    }

    #[test]
    fn markdown_and_csv() {
        let mut table = Table::new(
            "",
            vec![Column::text("spec"), Column::number("margin", "%", Digits::Decimals(1))],
        );
        table.row([Cell::from("a|b"), Cell::from(12.345678901)]);
        table.row([Cell::from("say \"x, y\""), Cell::from(-0.0)]);
        assert_eq!(
            table.to_markdown(),
            "| spec       | margin (%) |\n\
             | ---------- | ---------: |\n\
             | a\\|b       |       12.3 |\n\
             | say \"x, y\" |        0.0 |\n"
        );
        assert_eq!(
            table.to_csv(),
            "spec,margin_percent\r\na|b,12.345678901\r\n\"say \"\"x, y\"\"\",0\r\n"
        );
    }

    #[test]
    fn heads_of_csv_are_identifiers_that_name_the_unit_and_differ() {
        let column = |name: &str, unit: &str| Column::number(name, unit, Digits::Decimals(1));
        let mut table = Table::new(
            "",
            vec![
                column("speed", "kt"),
                column("θ₀", "deg"),
                column("C_T/σ upper", ""),
                column("turn rate", "rad/s"),
                column("GM up", "dB"),
                column("torque", "lbf ft"),
                column("activity", "%"),
                column("phase", "deg"),
                column("phase", "deg"),
                column("", ""),
            ],
        );
        table.row([1.0]);
        let csv = table.with_texts_before(&[("design", "a,b")]).to_csv();
        let heads = "design,speed_kt,theta0_deg,c_t_sigma_upper,turn_rate_rad_s,gm_up_db,\
                     torque_lbf_ft,activity_percent,phase_deg,phase_deg_of_2,result";
        assert_eq!(csv, format!("{heads}\r\n\"a,b\",1,,,,,,,,,\r\n"));
    }

    #[test]
    fn csv_reads_back_by_an_independent_reader() {
        let csv = sample().to_csv();
        let mut reader = csv::Reader::from_reader(csv.as_bytes());
        assert_eq!(reader.headers().unwrap().get(1), Some("theta_deg"));
        let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
        assert_eq!(rows.len(), 3);
        assert_eq!(rows[1][2].parse::<f64>().unwrap(), 8.125);
    }

    #[test]
    fn significant_digits_after_rounding() {
        assert_eq!(significant(9.996, 3), "10.0");
        assert_eq!(significant(0.00123456, 3), "0.00123");
        assert_eq!(significant(123_456.0, 3), "123000");
        assert_eq!(significant(1.5e-7, 2), "1.5e-7");
        assert_eq!(significant(-0.0, 3), "0");
        assert_eq!(significant(f64::NEG_INFINITY, 3), "-inf");
    }

    #[test]
    #[should_panic(expected = "a row of 3 cells in a table of 1 columns")]
    fn a_row_too_long_is_a_mistake() {
        Table::new("", vec![Column::text("a")]).row([1.0, 2.0, 3.0]);
    }

    proptest! {
        #[test]
        fn no_number_reads_as_minus_zero(value in -1.0..1.0f64, count in 0usize..6) {
            for text in [decimals(value, count), significant(value, count)] {
                let all_zero = text.chars().all(|c| "-0.".contains(c));
                prop_assert!(!(text.starts_with('-') && all_zero), "{text}");
            }
        }

        #[test]
        fn significant_digits_bound_the_error(
            mantissa in 1.0..10.0f64, exponent in -12..12i32, negative: bool, count in 1usize..12,
        ) {
            let value = mantissa * 10f64.powi(exponent) * if negative { -1.0 } else { 1.0 };
            let read: f64 = significant(value, count).parse().unwrap();
            // Half a unit in the last digit, and the rounding of the mantissa above.
            let bound = 0.5 * 10f64.powi(1 - count as i32) * (1.0 + 1e-9) + 1e-12;
            prop_assert!((read - value).abs() <= bound * value.abs());
        }
    }
}
