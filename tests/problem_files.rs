//! The problem files of the repository, the reference page, and every way a
//! file can be wrong.
//!
//! `tests/data/bad` holds files with one fault each, and beside each what the
//! program says about it. `COAXDESIGN_BLESS=1` rewrites the expected texts;
//! read the difference before committing it.

use std::path::{Path, PathBuf};

use assert_cmd::Command;
use coaxdesign::problem::{self, Loaded};
use coaxdesign::units::{FOOT, SLUG};

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Whether expected texts are written rather than compared.
fn blessing() -> bool {
    std::env::var_os("COAXDESIGN_BLESS").is_some()
}

/// Compares a text with a file of the repository, or writes the file.
fn assert_file(path: &Path, text: &str) {
    if blessing() {
        std::fs::write(path, text).unwrap();
        return;
    }
    let expected = std::fs::read_to_string(path).unwrap_or_default();
    let differs = expected
        .lines()
        .zip(text.lines())
        .position(|(old, new)| old != new)
        .unwrap_or_else(|| expected.lines().count().min(text.lines().count()));
    assert!(
        expected == text,
        "{}:{}: not what the program writes, which is\n{}\nIf the change is meant, run with \
         COAXDESIGN_BLESS=1",
        path.display(),
        differs + 1,
        text.lines().nth(differs).unwrap_or("(the end)")
    );
}

fn load(path: &str) -> Loaded {
    problem::load(root().join(path)).unwrap_or_else(|report| panic!("{report}"))
}

/// The program, run in the directory of the bad files so that paths in its
/// messages are short and the same everywhere.
fn check(file: &str) -> (i32, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_coaxdesign"))
        .current_dir(root().join("tests/data/bad"))
        .args(["check", file])
        .output()
        .unwrap();
    let text = String::from_utf8(output.stderr).unwrap();
    (output.status.code().unwrap(), text)
}

fn bad_files() -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(root().join("tests/data/bad"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.ends_with(".toml"))
        .collect();
    names.sort();
    names
}

#[test]
fn reference_page_is_that_of_the_format() {
    assert_file(&root().join("docs/problem-format.md"), &problem::page::markdown());
}

#[test]
fn built_in_problems_are_the_files() {
    for name in problem::BUILTIN {
        let built_in = problem::builtin_named(name).unwrap_or_else(|report| panic!("{report}"));
        let file = load(&format!("problems/{name}.toml"));
        assert_eq!(format!("{:?}", built_in.problem), format!("{:?}", file.problem));
        assert_eq!(built_in.problem.name, name);
    }
    let report = problem::builtin_named("coax2d-fysics").unwrap_err();
    assert!(report.to_string().contains("`coax2d-physics`"));
}

#[test]
fn overrides_change_what_they_name_and_nothing_else() {
    let base = load("problems/coax2d.toml").problem;
    let mut appendix = load("problems/coax2d-appendix.toml").problem;
    assert_eq!(appendix.rotors[0].hub.fuselage_station, 0.0);
    let published = problem::Formulation {
        teeter_torque_tilt: false,
        teeter_equation: problem::TeeterEquation::SmallAngles,
        interference_rule: problem::InterferenceRule::Trapezoid { radii: 11, skews: 10 },
        mirrored_interference: false,
    };
    assert_eq!(appendix.formulation, published);
    assert_eq!(base.formulation, problem::Formulation::EXACT);
    appendix.formulation = base.formulation;
    appendix.name = base.name.clone();
    appendix.description = base.description.clone();
    // Inertia without the blades' own about their shafts, to a hundredth.
    let own: f64 = base.rotors.iter().map(|r| r.blades as f64 * r.blade_second_moment).sum();
    let (s, c) = base.rotors[0].tilt.sin_cos();
    let hundredth = 0.01 * SLUG * FOOT * FOOT;
    for (ours, printed, part) in [
        (&mut appendix.mass.i_xx, base.mass.i_xx, s * s),
        (&mut appendix.mass.i_zz, base.mass.i_zz, c * c),
        (&mut appendix.mass.i_xz, base.mass.i_xz, (s * c).abs()),
    ] {
        assert!((*ours + part * own - printed).abs() < hundredth, "{ours} {printed}");
        *ours = printed;
    }
    assert_eq!(appendix.inflow.wash_edge, 0.0);
    appendix.inflow.wash_edge = base.inflow.wash_edge;
    appendix.fuselages = base.fuselages.clone();
    assert_ne!(format!("{:?}", appendix.wings), format!("{:?}", base.wings));
    appendix.wings = base.wings.clone();
    for (rotor, original) in appendix.rotors.iter_mut().zip(&base.rotors) {
        assert_eq!(rotor.hub.water_line, original.hub.water_line);
        rotor.hub = original.hub;
        rotor.root_cutout = original.root_cutout;
    }
    assert_eq!(format!("{appendix:?}"), format!("{base:?}"));
}

/// The paper's mixing matrix in its own units, rad for 100 % of each stick.
#[test]
fn val_mix_of_the_coax2d_is_the_published_matrix() {
    let controls = load("problems/coax2d.toml").problem.controls;
    let published = [
        [[0.0, 0.0, 0.5, -2.0 / 9.0], [5.0, 0.0, 0.0, 0.0], [0.0, 2.0, 0.0, 0.0]],
        [[0.0, 0.0, 0.5, 0.0], [5.0, 0.0, 0.0, 0.0], [0.0, 2.0, 0.0, 0.0]],
    ];
    for (mix, expected) in controls.mix.iter().zip(published) {
        for (row, expected) in [mix.theta_0, mix.theta_1c, mix.theta_1s].iter().zip(expected) {
            for (value, expected) in row.iter().zip(expected) {
                assert!((value * 100.0 - expected).abs() < 1e-15);
            }
        }
    }
}

/// In `coax2d-physics.toml` full stick travel is full blade-pitch travel.
#[test]
fn full_stick_is_full_pitch_in_the_physics_variant() {
    let controls = load("problems/coax2d-physics.toml").problem.controls;
    for (index, mix) in controls.mix.iter().enumerate() {
        let at = |gearing: &[f64; 4], stick: usize, end: usize| {
            gearing[stick] * controls.stick_limits[stick][end]
        };
        for end in 0..2 {
            let collective = controls.collective_limits[index][end];
            assert!((at(&mix.theta_0, 2, end) - collective).abs() < 1e-12);
            let cyclic = controls.cyclic_limits[index][end].abs();
            assert!((at(&mix.theta_1c, 0, end).abs() - cyclic).abs() < 1e-12);
            assert!((at(&mix.theta_1s, 1, end).abs() - cyclic).abs() < 1e-12);
        }
    }
    // Mirrored frames: tilting both disks the same way takes opposite signs.
    assert_eq!(controls.mix[0].theta_1c[0], -controls.mix[1].theta_1c[0]);
}

#[test]
fn impossible_blade_of_the_paper_is_a_warning() {
    let loaded = load("problems/coax2d.toml");
    let keys: Vec<&str> = loaded.warnings.iter().map(|warning| warning.key.as_str()).collect();
    assert_eq!(keys, ["rotors.upper.blade_first_moment", "rotors.lower.blade_first_moment"]);
}

#[test]
fn sources_hold_every_file_that_was_read() {
    let sources = load("problems/coax2d-physics.toml").sources;
    let names: Vec<_> = sources
        .files()
        .iter()
        .map(|file| Path::new(&file.name).file_name().unwrap().to_str().unwrap())
        .collect();
    assert_eq!(names, ["coax2d-physics.toml", "coax2d.toml", "naca23012.c81"]);
}

#[test]
fn choosing_an_alternative_drops_that_of_the_base() {
    let text = "extends = \"coax2d.toml\"\n[rotors.upper.airfoil]\nlift_slope = \"6 1/rad\"\n\
                drag = 0.01\n[wings.vertical_stabilizer.finite]\nlift_slope = \"6 1/rad\"\n\
                parasite_drag = 0.01\n";
    let loaded = problem::parse_str("text", text, &root().join("problems"));
    let problem = loaded.unwrap_or_else(|report| panic!("{report}")).problem;
    assert!(matches!(problem.rotors[0].airfoil, problem::Airfoil::Analytic { .. }));
    assert!(matches!(problem.rotors[1].airfoil, problem::Airfoil::Table(_)));
    assert!(matches!(problem.wings[1].model, problem::WingModel::Finite { .. }));
}

#[test]
fn every_bad_file_has_its_message() {
    let files = bad_files();
    assert!(files.len() >= 40);
    for file in files {
        let (code, text) = check(&file);
        assert_eq!(code, 2, "{file}\n{text}");
        let expected = root().join("tests/data/bad").join(file.replace(".toml", ".expected"));
        assert_file(&expected, &text);
    }
}

/// Each message names line and column and marks the place, names the key
/// (syntax errors have none), and shows what to write.
#[test]
fn every_message_names_place_key_and_right_form() {
    for file in bad_files() {
        let report = problem::load(root().join("tests/data/bad").join(&file)).unwrap_err();
        assert_eq!(report.errors.len() > 1, file.starts_with("several"), "{file}\n{report}");
        for error in &report.errors {
            let shown = error.render(false);
            assert!(!error.help.is_empty(), "{shown}");
            if file.starts_with("file_") {
                continue;
            }
            assert!(error.line > 0 && error.column > 0, "{shown}");
            assert!(shown.contains('^'), "{shown}");
            if !file.starts_with("syntax_") {
                assert!(!error.key.is_empty(), "{shown}");
            }
            // An example in code, or a bound with its number.
            let form = ['`', '"', '=', '['].iter().any(|c| error.help.contains(*c));
            let bound = error.help.contains(|c: char| c.is_ascii_digit());
            assert!(form || bound, "{shown}");
        }
    }
}

#[test]
fn what_is_no_file_is_said_so() {
    for (path, words) in
        [("no-such-file.toml", "no such file"), (".", "directory"), ("..", "directory")]
    {
        let (code, text) = check(path);
        assert_eq!(code, 3, "{path}");
        assert!(text.contains(words), "{text}");
    }
    // A file that is there but holds no problem is bad input instead.
    for (path, words) in [("file_empty.toml", "empty"), ("file_not_utf8.toml", "UTF-8")] {
        let (code, text) = check(path);
        assert_eq!(code, 2, "{path}");
        assert!(text.contains(words), "{text}");
    }
}

proptest::proptest! {
    /// A file damaged anywhere is refused or read, never a crash.
    #[test]
    fn damage_is_answered_without_panic(at in 0usize..6000, with in "\\PC{0,6}", cut in 0usize..40) {
        let good = include_str!("../problems/coax2d.toml");
        let boundary = |mut index: usize| {
            index = index.min(good.len());
            while !good.is_char_boundary(index) { index -= 1; }
            index
        };
        let (from, to) = (boundary(at), boundary(at + cut));
        let text = format!("{}{with}{}", &good[..from], &good[to..]);
        match problem::parse_str("damaged", &text, &root().join("problems")) {
            Ok(loaded) => assert!(loaded.warnings.iter().all(|w| !w.render(true).is_empty())),
            Err(report) => assert!(!report.errors.is_empty() && report.to_string().ends_with('\n')),
        }
    }
}

/// A problem read again from its own texts is the same problem, without a file
/// on the disk; a text that is missing is named.
#[test]
fn a_problem_is_read_again_from_its_texts() {
    let held = |loaded: &problem::Loaded| -> Vec<(String, String)> {
        loaded.sources.files().iter().map(|s| (s.name.clone(), s.text.clone())).collect()
    };
    let base = problem::builtin_named("coax2d-physics").unwrap();
    let files = held(&base);
    assert!(files.len() >= 3, "a base and a table take part");
    let again = problem::reload(&files).unwrap();
    let told = |loaded: &problem::Loaded| format!("{:?}", loaded.problem);
    assert_eq!(told(&again), told(&base));
    assert_eq!(held(&again), files);

    let directory = tempfile::tempdir().unwrap();
    let mine = directory.path().join("mine.toml");
    std::fs::copy("problems/coax2d.toml", directory.path().join("base.toml")).unwrap();
    std::fs::create_dir(directory.path().join("airfoils")).unwrap();
    std::fs::copy(
        "problems/airfoils/naca23012.c81",
        directory.path().join("airfoils/naca23012.c81"),
    )
    .unwrap();
    std::fs::write(&mine, "extends = \"base.toml\"\nname = \"Mine\"\n").unwrap();
    let loaded = problem::load(&mine).unwrap();
    let files = held(&loaded);
    drop(directory);
    assert_eq!(told(&problem::reload(&files).unwrap()), told(&loaded));
    let report = problem::reload(&files[..1]).unwrap_err();
    assert!(report.to_string().contains("base.toml"), "{report}");
    assert!(problem::reload(&[]).is_err());
}
