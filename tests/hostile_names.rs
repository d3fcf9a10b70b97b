//! Names and texts are never code: hostile ones are exported to every form, and
//! what comes out is compiled, parsed or loaded.

use std::path::Path;
use std::process::Command;

use coaxdesign::export::{self, Format, Options, Precision};
use coaxdesign::problem::{check_line, check_name};
use coaxdesign::schedule::Schedule;
use coaxdesign::schedule::sample;

/// What must never be met outside of a comment or a text.
const MARK: &str = "evil";

/// Texts that end, begin or hide comments and texts of one language or another,
/// or fill a template again; each tries to leave the mark behind.
fn hostile() -> Vec<String> {
    let ends = [
        "*/",
        "/*",
        "//",
        "///",
        "/**",
        "--",
        "-->",
        "<!--",
        "]]>",
        "<![CDATA[",
        "]]",
        "--[[",
        "]=]",
        "\"",
        "'",
        "\"\"\"",
        "'''",
        "`",
        "\\",
        "\\\"",
        "\\\\",
        "\\*/",
        "??/",
        "??'",
        "%{",
        "%}",
        "...",
        "#",
        "#{",
        "{{",
        "}}",
        "<?",
        "?>",
        "&",
        "&amp;",
        "&#0;",
        "&lt;",
        "<a>",
        "</a>",
        "@P@",
        "@U@",
        "@PLACES@",
        "@CONSTANTS@",
        "@TABLE@",
        "@BANNER@",
        "@HYBRID@",
        "@GUID@",
        "@NB@",
        "@",
        "@@",
        "%s%n",
        "$(x)",
        "`x`",
        ";",
        "|",
        "../..",
        "CON",
        "nul",
        "-rf",
        "\u{202e}",
        "\u{2028}",
        "\u{feff}",
        "\u{0}",
        "\u{1b}[2J",
        "\r",
        "\n",
        "\r\n",
        "\t",
        "\u{7f}",
        "\u{9b}31m",
        "ü",
        "中",
        "🚁",
    ];
    let mut out = Vec::new();
    for end in ends {
        out.push(format!("{end} int {MARK}(void); {end}"));
        out.push(format!("a{end}{MARK}"));
        out.push(format!("{end}{end} {MARK} = 1 {end}{end}"));
        out.push(format!("x\\{end} __import__('os').system('{MARK}') #{end}"));
    }
    out.push(format!("{}{MARK}", "x".repeat(70_000)));
    out
}

fn options(name: &str) -> Options {
    Options {
        name: name.into(),
        step: 0.01,
        precision: Precision::Double,
        speed: 0.0,
        binaries: Vec::new(),
    }
}

/// Every hostile text as the aircraft's name is refused or harmless: what is
/// let through holds nothing but letters, digits, blanks and `-_.`.
#[test]
fn hostile_names_are_refused_where_they_are_read() {
    let sample = sample::schedule();
    let json = sample.to_json().unwrap();
    for text in hostile() {
        let named = Schedule { name: text.clone(), ..sample.clone() };
        if check_name(&text).is_ok() {
            assert!(text.chars().all(|c| c.is_ascii_alphanumeric() || " -_.".contains(c)));
            continue;
        }
        assert!(named.to_json().is_err(), "{text:?}");
        for about in Format::ALL {
            let made = export::export(&named, Vec::new(), about.format, &options("law"));
            assert!(made.is_err(), "{}: {text:?}", about.name);
        }
        // As a file, and as the name of files.
        let quoted = serde_json::to_string(&text).unwrap();
        let file = json.replacen("\"name\": \"sample\"", &format!("\"name\": {quoted}"), 1);
        assert_ne!(file, json);
        let error = Schedule::from_json(&file).unwrap_err().to_string();
        assert!(error.contains("/name") && error.contains("line "), "{error}");
        assert!(!error.contains(|c: char| c.is_control()), "{error:?}");
        let made = export::export(&sample, Vec::new(), Format::C, &options(&text));
        assert!(made.is_err(), "{text:?}");
        // A problem file.
        let problem = include_str!("../problems/coax2d.toml").replacen(
            "name = \"coax2d\"",
            &format!("name = {}", toml_text(&text)),
            1,
        );
        let report =
            coaxdesign::problem::parse_beside_builtin("hostile.toml", &problem).unwrap_err();
        assert!(report.errors[0].key == "name" && report.errors[0].column >= 8, "{report}");
        assert!(!report.to_string().contains(|c: char| c.is_control() && c != '\n'), "{report:?}");
    }
}

/// A text as TOML writes it.
fn toml_text(text: &str) -> String {
    let escaped: String = text
        .chars()
        .map(|c| match c {
            '"' | '\\' => format!("\\{c}"),
            c if c.is_control() => format!("\\u{:04x}", u32::from(c)),
            c => c.to_string(),
        })
        .collect();
    format!("\"{escaped}\"")
}

/// Runs a program where there is one; its answer, or `None`.
fn run(program: &str, directory: &Path, arguments: &[&str]) -> Option<std::process::Output> {
    Command::new(program).current_dir(directory).args(arguments).output().ok()
}

fn assert_runs(program: &str, directory: &Path, arguments: &[&str]) -> Option<String> {
    let output = run(program, directory, arguments)?;
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{program} {arguments:?}: {error}");
    Some(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Hostile lines as provenance and as warnings, all in every form at once: what
/// comes out compiles, parses and loads, and holds no mark outside of comments
/// and texts.
#[test]
fn hostile_lines_stay_comments_and_texts_in_every_form() {
    let all = hostile();
    let lines: Vec<String> = all.iter().filter(|t| check_line(t).is_ok()).cloned().collect();
    assert!(lines.len() > 200, "{}", lines.len());
    // Warnings are of our own making, but nothing keeps them from holding what
    // a file said: they take even what no file may hold.
    let warnings: Vec<String> = all.iter().map(|text| text.chars().take(300).collect()).collect();
    let home = tempfile::tempdir().unwrap();
    let at = home.path();
    let mut sample = sample::schedule();
    sample.provenance.generator =
        lines.iter().filter(|l| l.len() < 40).take(20).cloned().collect::<Vec<_>>().join(" ");
    sample.check().unwrap();
    for about in Format::ALL {
        let files = export::export(&sample, warnings.clone(), about.format, &options("law"));
        for file in files.unwrap_or_else(|error| panic!("{}: {error}", about.name)) {
            std::fs::write(at.join(&file.name), &file.bytes).unwrap();
            if let Ok(text) = String::from_utf8(file.bytes) {
                let bad = text.chars().find(|c| c.is_control() && !"\n\t\r".contains(*c));
                assert_eq!(bad, None, "{}", file.name);
            }
        }
    }
    // C: compiles without a warning, and no mark is left behind the comments.
    if let Some(text) = assert_runs("gcc", at, &["-E", "-P", "-std=c99", "law_law.c"]) {
        assert!(text.contains("law_step") && !text.contains(MARK));
        assert_runs("gcc", at, &["-std=c99", "-Wall", "-Werror", "-fsyntax-only", "law_law.c"]);
    }
    // Rust.
    let compiled = assert_runs("rustc", at, &["--emit=metadata", "--crate-type=lib", "law_law.rs"]);
    let rust = std::fs::read_to_string(at.join("law_law.rs")).unwrap();
    let code: Vec<&str> =
        rust.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
    assert!(compiled.is_none() || code.len() > 50);
    assert!(code.iter().all(|line| !line.contains(MARK)));
    // Python: parses, and no name or call in it is the mark.
    let script = "import ast, sys\ntree = ast.parse(open(sys.argv[1], encoding='utf-8').read())\n\
                  names = {getattr(n, 'id', None) or getattr(n, 'attr', None) for n in ast.walk(tree)}\n\
                  assert 'evil' not in names\nassert 'system' not in names\n";
    assert_runs("python3", at, &["-c", script, "law_law.py"]);
    assert_runs(
        "python3",
        at,
        &["-c", "import json; json.load(open('law.json', encoding='utf-8'))"],
    );
    assert_runs(
        "python3",
        at,
        &["-c", "import csv; list(csv.reader(open('law.csv', encoding='utf-8'), strict=True))"],
    );
    // XML: every element closes, and no element, attribute or text is a mark.
    let mut unit = zip::ZipArchive::new(std::fs::File::open(at.join("law.fmu")).unwrap()).unwrap();
    let mut description = String::new();
    let mut member = unit.by_name("modelDescription.xml").unwrap();
    std::io::Read::read_to_string(&mut member, &mut description).unwrap();
    drop(member);
    let system = std::fs::read_to_string(at.join("law_law.xml")).unwrap();
    for document in [description, system] {
        let mut reader = quick_xml::Reader::from_str(&document);
        reader.config_mut().check_comments = true;
        loop {
            match reader.read_event().unwrap() {
                quick_xml::events::Event::Eof => break,
                quick_xml::events::Event::Start(element)
                | quick_xml::events::Event::Empty(element) => {
                    for attribute in element.attributes() {
                        attribute.unwrap();
                    }
                    let name = format!("{:?}", element.name());
                    assert!(!name.contains(MARK), "{name}");
                }
                _ => {}
            }
        }
    }
    // The sources inside the unit.
    for name in ["sources/law_fmu.c", "sources/law_law.c", "sources/law_law.h"] {
        let mut text = String::new();
        std::io::Read::read_to_string(&mut unit.by_name(name).unwrap(), &mut text).unwrap();
        std::fs::write(at.join(name.trim_start_matches("sources/")), text).unwrap();
    }
    if let Some(text) = assert_runs("gcc", at, &["-E", "-P", "-std=c99", "law_fmu.c"]) {
        assert!(!text.contains(MARK));
    }
    // Lua.
    let lua = std::fs::read_to_string(at.join("law_schedule.lua")).unwrap();
    if run("luac", at, &["-v"]).is_some() {
        assert_runs("luac", at, &["-p", "law_schedule.lua"]);
    }
    assert!(lua_code(&lua).contains("look_up") && !lua_code(&lua).contains(MARK));
    // Parameters: every line is a remark, or a key and a number.
    let parameters = std::fs::read_to_string(at.join("law.param")).unwrap();
    for line in parameters.lines().filter(|line| !line.starts_with('#')) {
        let (key, value) = line.split_once(' ').unwrap();
        assert!(key.bytes().all(|b| b.is_ascii_uppercase() || b == b'_'), "{line}");
        value.parse::<f64>().unwrap();
    }
    // MATLAB: every line with a mark is a remark.
    let loader = std::fs::read_to_string(at.join("law_load.m")).unwrap();
    for line in loader.lines().filter(|line| line.contains(MARK)) {
        assert!(line.trim_start().starts_with('%'), "{line}");
    }
    // What can come back does, with its texts.
    for (file, source) in [
        ("law.json", export::import::Source::Json),
        ("law.toml", export::import::Source::Toml),
        ("law.csv", export::import::Source::Csv),
        ("law.mat", export::import::Source::Mat),
    ] {
        let bytes = std::fs::read(at.join(file)).unwrap();
        let back = export::import::import(&bytes, source, file, None, Default::default()).unwrap();
        assert_eq!(back.schedule.law().unwrap(), sample.law().unwrap(), "{file}");
    }
}

/// A Lua text without its comments and what stands in quotes.
fn lua_code(text: &str) -> String {
    let mut code = String::new();
    let mut rest = text;
    while !rest.is_empty() {
        let skipped = if let Some(inside) = rest.strip_prefix("--[[") {
            inside.find("]]").map_or(rest.len(), |end| end + 6)
        } else if rest.starts_with("--") {
            rest.find('\n').unwrap_or(rest.len())
        } else if let Some(inside) = rest.strip_prefix('"') {
            inside.find('"').map_or(rest.len(), |end| end + 2)
        } else {
            let length = rest.chars().next().map_or(1, char::len_utf8);
            code += &rest[..length];
            length
        };
        rest = &rest[skipped..];
    }
    code
}
