//! One way of asking: forms by the ending of a name, standard output by `-`,
//! inputs that no result replaces, and one system of units throughout.

#[path = "common/program.rs"]
mod program;

use std::path::Path;

use program::{code, command, err, out, program as run};

const TRIM: &str = "trim --speeds 0kt --interactions on --quiet";

#[test]
fn the_ending_chooses_the_form() {
    let home = tempfile::tempdir().unwrap();
    let here = home.path();
    let read = |name: &str| std::fs::read_to_string(here.join(name)).unwrap();
    for (name, begins) in [("x.txt", "coax2d: periodic trim"), ("x.json", "{"), ("X.CSV", "")] {
        let done = command(here, &format!("{TRIM} -o {name}"));
        assert_eq!(code(&done), 0, "{}", err(&done));
        assert!(read(name).starts_with(begins), "{name}: {}", read(name));
    }
    assert!(read("X.CSV").lines().next().unwrap().split(',').count() > 5);
    assert!(serde_json::from_str::<serde_json::Value>(&read("x.json")).is_ok());
    let modes = "linearize --speed 0kt --reduce residualize --quiet";
    assert_eq!(code(&command(here, &format!("{modes} -o m.mat"))), 0);
    assert!(std::fs::read(here.join("m.mat")).unwrap().starts_with(b"MATLAB 5.0"));

    // Another ending, and an ending against --format, before any work.
    for (more, told) in [
        ("-o x.mat", "no form that ends in .mat"),
        ("-o x.json --format csv --force", "the ending says json, but --format says csv"),
        ("--plot x.pdf", "plots are not written as .pdf"),
        #[cfg(not(feature = "png"))]
        ("--plot x.png", "--features png"),
        ("--plot p.svg -o p.svg --format csv", "two results cannot go to one file"),
    ] {
        let refused = command(here, &format!("{TRIM} {more}"));
        assert_eq!(code(&refused), 2, "{more}: {}", err(&refused));
        assert!(err(&refused).contains(told), "{more}: {}", err(&refused));
    }
    assert!(!here.join("p.svg").exists() && !here.join("x.png").exists());
    // An ending that says nothing is no contradiction.
    assert_eq!(code(&command(here, &format!("{TRIM} -o y.dat --format csv"))), 0);
    assert_eq!(read("y.dat"), read("X.CSV"));
    let shown = command(here, &format!("{TRIM} --format csv -o -"));
    assert_eq!(out(&shown), read("X.CSV"));
    assert!(!here.join("-").exists());
}

/// The ending of a plot's name chooses its form too.
#[cfg(feature = "png")]
#[test]
fn plots_are_written_as_png() {
    let home = tempfile::tempdir().unwrap();
    let here = home.path();
    let done = command(here, &format!("{TRIM} --plot trim.png"));
    assert_eq!(code(&done), 0, "{}", err(&done));
    let bytes = std::fs::read(here.join("trim.png")).unwrap();
    assert!(bytes.starts_with(b"\x89PNG\r\n"), "no PNG");
    assert!(bytes.len() > 20_000, "{} bytes: an empty picture?", bytes.len());
}

/// Every quantity of an argument has bounds, which are said; nothing is computed
/// with one beyond them.
#[test]
fn absurd_quantities_are_refused_with_their_bounds() {
    let home = tempfile::tempdir().unwrap();
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("designs/coax2d");
    let kept = kept.to_str().unwrap();
    let flight = ["simulate", kept, "-m", "hover-turn", "--quiet", "--model"];
    let study = ["montecarlo", kept, "-m", "hover-turn", "--runs", "2", "--quiet"];
    for (command, more) in [
        (&["trim", "--quiet"][..], "--climb=1e9 ft/min"),
        (&["trim", "--quiet"], "--climb=-1e300 m/s"),
        (&["trim", "--quiet"], "--turn-rate=1e9 deg/s"),
        (&["trim", "--quiet"], "--power=1e300 hp"),
        (&["trim", "--quiet"], "--sideslip=89.999 deg"),
        (&["trim", "--quiet"], "--wind-azimuth=400 deg"),
        (&["trim", "--quiet"], "--altitude=1e9 ft"),
        (&["bode", "--quiet", "--speeds", "0kt"], "--omega=1:1e300 rad/s"),
        (&["rotor", "--quiet"], "--ct=1e9"),
        (&["rotor", "--quiet", "--ct", "0.005"], "--edgewise=1e9 kt"),
        (&flight, "cg=1e9 ft"),
        (&flight, "turbulence=1e300 kt"),
        (&flight, "gust-up=1e9 kt"),
        (&flight, "governor=-1 s"),
        (&study, "--cg=1e9 ft"),
        (&study, "--delay=-1 s"),
        (&study, "--gust=1e300 kt"),
        (&study, "--saturated=1e300 s"),
    ] {
        let mut arguments = command.to_vec();
        arguments.push(more);
        let refused = run(home.path(), &arguments);
        assert_eq!(code(&refused), 2, "{more}: {}", err(&refused));
        assert!(err(&refused).contains("write a value from"), "{more}: {}", err(&refused));
        assert!(err(&refused).len() < 600 && refused.stdout.is_empty(), "{more}");
    }
}

/// Every subcommand on models takes one speed, a list or a range in the same
/// way, and a list holds what its speeds give alone.
#[test]
fn speeds_are_asked_for_in_one_way() {
    let home = tempfile::tempdir().unwrap();
    let here = home.path();
    let json = |line: &str| -> serde_json::Value {
        let done = command(here, &format!("{line} --interactions off --format json --quiet"));
        assert_eq!(code(&done), 0, "{line}: {}", err(&done));
        serde_json::from_str(out(&done)).unwrap()
    };
    let list = json("modes --speeds 20:40:20kt");
    let points = list["points"].as_array().unwrap();
    assert_eq!(points.len(), 2);
    for (point, speed) in points.iter().zip(["20 kt", "40kt"]) {
        let alone = command(
            here,
            &format!(
                "modes --speeds {} --interactions off --format json --quiet",
                speed.replace(' ', "")
            ),
        );
        let alone: serde_json::Value = serde_json::from_str(out(&alone)).unwrap();
        assert_eq!(alone["points"][0]["speed_kt"], point["speed_kt"]);
        let real = |p: &serde_json::Value| -> Vec<f64> {
            let modes = p["models"][0]["modes"].as_array().unwrap();
            modes.iter().map(|m| m["real_rad_per_s"].as_f64().unwrap()).collect()
        };
        for (a, b) in real(point).iter().zip(real(&alone["points"][0])) {
            assert!((a - b).abs() < 1e-7 * (1.0 + b.abs()), "{a} {b}");
        }
    }
    let list = json("bode --speeds 20,40kt --input lat --response p --points 5");
    let responses = list["responses"].as_array().unwrap();
    let speeds: Vec<f64> =
        responses.iter().map(|r| (r["speed_kt"].as_f64().unwrap() * 1e6).round() / 1e6).collect();
    assert_eq!(speeds, [20.0, 40.0]);
    assert_ne!(responses[0]["magnitude"], responses[1]["magnitude"]);
    // The loci of the modes say where they begin and end.
    let done = command(here, "modes --speeds 0:40:20kt --interactions off --quiet --plot loci.svg");
    assert_eq!(code(&done), 0, "{}", err(&done));
    let svg = std::fs::read_to_string(here.join("loci.svg")).unwrap();
    assert!(svg.contains(">0 kt</text>") && svg.contains(">40 kt</text>"));
}

/// A problem file may state its units; `--units` goes before.
#[test]
fn results_follow_the_units_of_the_problem_file() {
    let home = tempfile::tempdir().unwrap();
    let here = home.path();
    let base = concat!(env!("CARGO_MANIFEST_DIR"), "/problems/coax2d.toml");
    let write = |file: &str, units: &str| {
        let text = format!("extends = {base:?}\nname = \"mine\"\nunits = {units:?}\n");
        std::fs::write(here.join(file), text).unwrap();
    };
    write("mine.toml", "si");
    let trim = "trim mine.toml --speeds 10kt --interactions off --quiet";
    let done = command(here, trim);
    assert_eq!(code(&done), 0, "{}", err(&done));
    assert!(out(&done).contains("m/s") && us_units(out(&done)).is_empty(), "{}", out(&done));
    let asked = command(here, &format!("{trim} --units us"));
    let asked = out(&asked);
    assert!(asked.contains("kt") && asked.contains("hp"), "{asked}");
    // Messages follow too.
    let line = "trim mine.toml --speeds 10kt --altitude 60000ft --interactions off --quiet";
    let missed = command(here, line);
    assert_eq!(code(&missed), 1);
    assert!(err(&missed).contains("no trim") && err(&missed).contains("m/s"), "{}", err(&missed));
    assert!(us_units(&err(&missed)).is_empty(), "{}", err(&missed));
    write("bad.toml", "metric");
    let refused = command(here, "trim bad.toml");
    assert_eq!(code(&refused), 2);
    assert!(
        err(&refused).contains("bad.toml:3") && err(&refused).contains("si"),
        "{}",
        err(&refused)
    );
}

#[test]
fn a_result_never_replaces_what_it_was_made_from() {
    let home = tempfile::tempdir().unwrap();
    let here = home.path();
    assert_eq!(code(&command(here, "new mine.toml")), 0);
    let before = std::fs::read(here.join("mine.toml")).unwrap();
    for line in [
        "trim mine.toml --speeds 0kt --quiet --format csv --force -o ./mine.toml",
        "linearize mine.toml --quiet --format json --force -o mine.toml",
    ] {
        let refused = command(here, line);
        assert_eq!(code(&refused), 2, "{line}: {}", err(&refused));
        assert!(err(&refused).contains("this command reads the file"), "{}", err(&refused));
    }
    assert_eq!(std::fs::read(here.join("mine.toml")).unwrap(), before);
}

#[test]
fn every_kind_of_file_can_be_begun_and_has_a_schema() {
    let home = tempfile::tempdir().unwrap();
    let here = home.path();
    for kind in ["coaxial", "helicopter", "multicopter", "specification", "maneuver"] {
        let done = command(here, &format!("new {kind}.toml --kind {kind}"));
        assert_eq!(code(&done), 0, "{}", err(&done));
    }
    for kind in ["coaxial", "helicopter", "multicopter"] {
        let checked = command(here, &format!("check {kind}.toml"));
        assert_eq!(code(&checked), 0, "{}", err(&checked));
    }
    for kind in ["problem", "specification", "maneuver", "schedule", "law"] {
        let schema = command(here, &format!("schema --of {kind}"));
        let value: serde_json::Value = serde_json::from_str(out(&schema)).unwrap();
        assert!(value["$schema"].is_string(), "{kind}");
    }
}

/// Words that are units of the other system.
fn us_units(text: &str) -> Vec<&str> {
    const US: [&str; 9] = ["kt", "ft", "hp", "lbf", "lb", "slug", "ft/min", "knots", "feet"];
    text.split(|c: char| !(c.is_alphanumeric() || c == '/'))
        .flat_map(|word| std::iter::once(word).chain(word.split('/')))
        .filter(|word| US.contains(word))
        .collect()
}

#[test]
fn under_si_no_foot_knot_or_horsepower_appears() {
    let home = tempfile::tempdir().unwrap();
    let here = home.path();
    let design = concat!(env!("CARGO_MANIFEST_DIR"), "/designs/coax2d");
    let problem = Path::new(env!("CARGO_MANIFEST_DIR")).join("problems/coax2d-physics.toml");
    let hold = "title = \"Hold\"\nduration = \"2 s\"\nmode = \"velocity\"\n";
    std::fs::write(here.join("hold.toml"), hold).unwrap();
    let problem = problem.to_str().unwrap();
    let cases: [&[&str]; 9] = [
        &["trim", problem, "--speeds", "0,10 m/s", "--plot", "plot.svg"],
        &[
            "linearize",
            problem,
            "--speed",
            "10 m/s",
            "--reduce",
            "residualize",
            "--plot",
            "plot.svg",
        ],
        &["linearize", problem, "--speeds", "0,5,10,15 m/s", "--reduce", "residualize"],
        &["modes", problem, "--speed", "10 m/s", "--plot", "plot.svg"],
        &["bode", problem, "--speed", "10 m/s", "--input", "lat", "--response", "p,v"],
        &["check", problem],
        &["compare", problem, "coax2d", "--speeds", "0,10 m/s", "--plot", "plot.svg"],
        &["simulate", design, "-m", "hold.toml", "--plot", "plot.svg"],
        &["montecarlo", design, "-m", "hold.toml", "--runs", "1"],
    ];
    for case in cases {
        let quiet = if case[0] == "check" { &[][..] } else { &["--quiet"][..] };
        let all = [case, &["--units", "si"], quiet].concat();
        let shown = run(here, &all);
        assert!(code(&shown) <= 1, "{all:?}: {}", err(&shown));
        // The replay line of montecarlo names no quantity in other units either.
        let found = us_units(out(&shown));
        assert!(found.is_empty(), "{all:?}: {found:?}\n{}", out(&shown));
        let plot = here.join("plot.svg");
        if let Ok(svg) = std::fs::read_to_string(&plot) {
            let found = us_units(&svg);
            assert!(found.is_empty(), "{all:?}, plot: {found:?}");
            std::fs::remove_file(plot).unwrap();
        }
    }
}

/// The line that montecarlo prints to fly a run again is a command, and gives
/// the flight that it says.
#[test]
fn a_replay_line_can_be_pasted() {
    let home = tempfile::tempdir().unwrap();
    let here = home.path();
    let design = concat!(env!("CARGO_MANIFEST_DIR"), "/designs/coax2d");
    let hold = "title = \"Hold\"\nduration = \"2 s\"\nmode = \"velocity\"\n";
    std::fs::write(here.join("my hold.toml"), hold).unwrap();
    let study = run(
        here,
        &["montecarlo", design, "-m", "my hold.toml", "--runs", "1", "--quiet", "-o", "r"],
    );
    let line = out(&study).lines().find_map(|l| l.trim().strip_prefix("replay: ")).unwrap();
    let path = std::env::join_paths(
        std::iter::once(Path::new(env!("CARGO_BIN_EXE_coaxdesign")).parent().unwrap().to_owned())
            .chain(std::env::split_paths(&std::env::var_os("PATH").unwrap())),
    )
    .unwrap();
    let flown = std::process::Command::new("sh")
        .current_dir(here)
        .env("PATH", path)
        .args(["-c", &format!("{line} --quiet --format json")])
        .output()
        .unwrap();
    assert!(flown.status.code().unwrap() <= 1, "{line}\n{}", err(&flown));
    let metrics: serde_json::Value = serde_json::from_str(out(&flown)).unwrap();
    let runs = std::fs::read_to_string(here.join("r")).unwrap();
    let recorded: serde_json::Value = serde_json::from_str(runs.lines().next().unwrap()).unwrap();
    let peak = metrics["metrics"]["tracking"]
        .as_array()
        .unwrap()
        .iter()
        .find(|t| t["channel"] == "forward_velocity")
        .unwrap()["peak"]
        .as_f64()
        .unwrap();
    let known = recorded["forward_velocity_peak_m_s"].as_f64().unwrap();
    assert!((peak - known).abs() <= 1e-12 * known.abs(), "{peak} {known}");
}
