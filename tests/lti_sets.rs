//! Linear models from elsewhere: reading, checking, stitching, plants.

#[path = "common/sets.rs"]
mod sets;

use coaxdesign::control::models::from_set;
use coaxdesign::control::spec;
use coaxdesign::linear::dense::eigenvalues;
use coaxdesign::linear::io::ModelRecord;
use coaxdesign::linear::io::{MatFile, set_to_json, set_to_mat, to_csv};
use coaxdesign::lti::mapping::{Mapping, MissingTrim};
use coaxdesign::lti::stitch::Stitched;
use coaxdesign::lti::{LtiSet, load};
use coaxdesign::studies::coax2d::appendix::{Condition, appendix};
use coaxdesign::units::{KNOT, System};
use sets::{OWN_LIMITS, example, own_set, uh60a};
use std::path::Path;

fn level_flight() -> Mapping {
    Mapping { missing_trim: MissingTrim::LevelFlight, ..Mapping::default() }
}

/// Eigenvalues that the source of the example gives, with their four digits:
/// the printed derivatives have as many, so that slow ones may be off by a few
/// thousandths.
#[test]
fn val_uh60a_eigenvalues_are_those_of_the_source() {
    let set = uh60a();
    assert_eq!(set.models.len(), 6);
    for (point, name) in set.models.iter().zip(["001", "020", "040", "060", "080", "120"]) {
        let text = std::fs::read_to_string(example("uh60a").join(format!("{name}kt.csv"))).unwrap();
        let line = text.lines().find_map(|l| l.strip_prefix("# eigenvalues of the source: "));
        let mut wanted = Vec::new();
        for word in line.unwrap().split(", ") {
            match word.strip_suffix('i').and_then(|w| w.split_once('±')) {
                Some((re, im)) => {
                    let (re, im): (f64, f64) = (re.parse().unwrap(), im.parse().unwrap());
                    wanted.extend([(re, im), (re, -im)]);
                }
                None => wanted.push((word.parse().unwrap(), 0.0)),
            }
        }
        let found = eigenvalues(point.model.a()).unwrap();
        assert_eq!(found.len(), wanted.len());
        for z in found {
            let nearest = wanted
                .iter()
                .map(|(re, im)| (z.re - re).hypot(z.im - im))
                .fold(f64::INFINITY, f64::min);
            assert!(nearest < 0.012, "{name} kt: {z} is {nearest:.4} from the source's");
        }
    }
}

/// The tables give back every point model and every trim.
#[test]
fn stitched_model_is_each_point_model_and_holds_each_trim() {
    let set = uh60a();
    let stitched = Stitched::new(&set, None).unwrap();
    let mut work = stitched.lookup();
    for point in &set.models {
        let back = stitched.at(point.speed).unwrap();
        assert_eq!(back.trim, point.trim, "{}", point.label);
        let scale = point.model.a().amax();
        let error = (back.model.a() - point.model.a()).amax() / scale;
        assert!(error < 1e-12, "{}: A differs by {error:.1e}", point.label);
        assert!((back.model.b() - point.model.b()).amax() < 1e-14);
        let (mut found, mut wanted) =
            (eigenvalues(back.model.a()).unwrap(), eigenvalues(point.model.a()).unwrap());
        found.sort_by(|a, b| (a.re, a.im).partial_cmp(&(b.re, b.im)).unwrap());
        wanted.sort_by(|a, b| (a.re, a.im).partial_cmp(&(b.re, b.im)).unwrap());
        for (f, w) in found.iter().zip(&wanted) {
            assert!((f - w).norm() < 1e-6, "{}: {f} beside {w}", point.label);
        }
        let t = &point.trim;
        let [u, v, w] = t.velocity_body;
        let x = [u, v, w, 0.0, 0.0, 0.0, t.roll, t.pitch];
        let mut rates = [1.0; 8];
        stitched.rates(&x, &t.sticks, [0.0; 3], [0.0; 3], &mut work, &mut rates);
        assert!(rates.iter().all(|r| r.abs() < 1e-12), "{}: {rates:?}", point.label);
    }
}

/// Between the models, at a state off trim, in moving air: the linear model is
/// the derivative of the nonlinear one.
#[test]
fn linear_model_is_the_derivative_everywhere() {
    let set = uh60a();
    let base = Stitched::new(&set, None).unwrap();
    for stitched in [base.varied(1.0, 0.0).unwrap(), base.varied(1.15, 0.0).unwrap()] {
        let mut work = stitched.lookup();
        for u in [-4.0, 7.3, 33.0, 58.0, 75.0] {
            let x = [u, 1.5, 0.7, 0.04, -0.07, 0.11, 0.2, -0.1];
            let sticks = [48.0, 44.0, 41.0, 50.0];
            let (a, b) = stitched.linear(&x, &sticks);
            let mut at = |x: &[f64; 8], sticks: &[f64; 4]| {
                let mut rates = [0.0; 8];
                stitched.rates(x, sticks, [0.0; 3], [0.0; 3], &mut work, &mut rates);
                rates
            };
            for j in 0..8 {
                let h = 1e-5;
                let (mut up, mut down) = (x, x);
                up[j] += h;
                down[j] -= h;
                let (up, down) = (at(&up, &sticks), at(&down, &sticks));
                for i in 0..8 {
                    let slope = (up[i] - down[i]) / (2.0 * h);
                    assert!((slope - a[(i, j)]).abs() < 1e-6, "{u} ({i}, {j})");
                }
            }
            for j in 0..4 {
                let (mut up, mut down) = (sticks, sticks);
                up[j] += 1.0;
                down[j] -= 1.0;
                let (up, down) = (at(&x, &up), at(&x, &down));
                for i in 0..8 {
                    assert!((0.5 * (up[i] - down[i]) - b[(i, j)]).abs() < 1e-10);
                }
            }
        }
    }
}

/// A steady wind carries the motion along: the air's velocity and the
/// aircraft's may be shifted together.
#[test]
fn only_the_velocity_through_the_air_makes_forces() {
    let stitched = Stitched::new(&uh60a(), None).unwrap();
    let mut work = stitched.lookup();
    let (mut still, mut moving) = ([0.0; 8], [0.0; 8]);
    let x = [30.0, 1.0, 2.0, 0.0, 0.0, 0.0, 0.05, 0.04];
    let wind = [4.0, -3.0, 1.0];
    let shifted: [f64; 8] = std::array::from_fn(|k| x[k] + wind.get(k).copied().unwrap_or(0.0));
    let sticks = [50.0; 4];
    stitched.rates(&x, &sticks, [0.0; 3], [0.0; 3], &mut work, &mut still);
    stitched.rates(&shifted, &sticks, wind, [0.0; 3], &mut work, &mut moving);
    for (s, m) in still.iter().zip(moving) {
        assert!((s - m).abs() < 1e-12);
    }
}

/// A heavier aircraft needs more collective in hover, about the weight over
/// the lift of a per cent, and its trim is one.
#[test]
fn heavier_aircraft_trims_with_more_collective() {
    let set = uh60a();
    let base = Stitched::new(&set, None).unwrap();
    let heavy = base.varied(1.1, 0.0).unwrap();
    let (light, trim) = (base.trim(10.0, 0.0, 0.0).unwrap(), heavy.trim(10.0, 0.0, 0.0).unwrap());
    let z_col = -base.at(10.0).unwrap().model.derivative("w", "col").unwrap();
    let expected = 0.1 * 9.80665 / z_col;
    let more = trim.sticks[2] - light.sticks[2];
    assert!((more / expected - 1.0).abs() < 0.1, "{more} % where {expected} % lift the weight");
    let mut rates = [1.0; 8];
    heavy.rates(&trim.state, &trim.sticks, [0.0; 3], [0.0; 3], &mut heavy.lookup(), &mut rates);
    assert!(rates.iter().all(|r| r.abs() < 1e-9), "{rates:?}");
    assert!(base.varied(1.0, 0.1).is_err(), "a shift needs the mass");
}

/// A coordinated turn is a trim: bank and rates belong together.
#[test]
fn turns_and_climbs_are_trims() {
    let stitched = Stitched::new(&uh60a(), None).unwrap();
    let speed = 80.0 * KNOT;
    let turn = 0.1;
    let t = stitched.trim(speed, 3.0, turn).unwrap();
    let mut rates = [1.0; 8];
    stitched.rates(&t.state, &t.sticks, [0.0; 3], [0.0; 3], &mut stitched.lookup(), &mut rates);
    assert!(rates.iter().all(|r| r.abs() < 1e-9), "{rates:?}");
    // tan φ = V ψ'/g, and what the side force of the sideslip takes.
    let expected = (speed * turn / 9.80665).atan();
    assert!((t.state[6] - expected).abs() < 0.1, "{} beside {expected}", t.state[6]);
}

/// The printed matrices as CSV are those of the library.
#[test]
fn val_printed_models_come_from_csv() {
    let mapping = level_flight();
    let set = load(&example("coax2d-paper"), &mapping).unwrap_or_else(|r| panic!("{r}"));
    for (point, condition) in set.models.iter().zip([Condition::Hover, Condition::Forward]) {
        let wanted = appendix(condition).unwrap();
        assert!((point.model.a() - wanted.a()).amax() < 1e-12);
        assert!((point.model.b() - wanted.b()).amax() < 1e-12);
    }
    // θ₀ = −3.74° of the forward model, from its gravity terms.
    assert!((set.models[1].trim.pitch.to_degrees() + 3.74).abs() < 0.01);
    assert!(set.notes.iter().any(|n| n.contains("gravity terms")), "{:?}", set.notes);
    let refused = load(&example("coax2d-paper"), &Mapping::default()).unwrap_err().to_string();
    assert!(refused.contains("missing_trim = \"level_flight\""), "{refused}");
    assert!(refused.contains("070kt.csv") && refused.contains("model 1 (70 kt), row trim"));
}

/// Plants at the models and between them.
#[test]
fn plants_of_a_set() {
    let set = uh60a();
    let spec = spec::builtin().unwrap();
    let speeds = [0.0, 10.0 * KNOT, 20.0 * KNOT, 100.0 * KNOT];
    let nominal = &spec.models[..1];
    let built = from_set(&set, None, nominal, &speeds).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(built.set.speeds(), speeds);
    let at_20 = &built.set.plants[2][0];
    assert_eq!(at_20.reduced_a[(4, 4)], set.models[1].model.a()[(4, 4)]);
    // Between: derivatives are means, kinematics are those of the speed.
    let q = |k: usize| built.set.plants[k][0].reduced_a[(2, 4)];
    assert!(q(0) < q(1) && q(1) < q(2), "{} {} {}", q(0), q(1), q(2));
    let beyond = from_set(&set, None, nominal, &[130.0 * KNOT]).unwrap_err().to_string();
    assert!(beyond.contains("130 kt") && beyond.contains("120 kt ("), "{beyond}");
    let other = from_set(&set, None, &spec.models, &speeds).unwrap_err().to_string();
    assert!(other.contains("no_interactions") && other.contains("wake interaction"), "{other}");
}

/// What is wrong is said by file, model and row, with the line that helps.
#[test]
fn wrong_sets_are_refused_in_the_users_terms() {
    let good = std::fs::read_to_string(example("uh60a/060kt.csv")).unwrap();
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("wrong.csv");
    let refused = |text: &str| {
        assert_ne!(text, good);
        std::fs::write(&path, text).unwrap();
        let report = load(&path, &Mapping::default()).expect_err(text);
        assert!(!report.unreadable);
        let text = report.to_string();
        assert!(text.contains("wrong.csv"), "{text}");
        text
    };
    for (from, to, messages) in [
        // Unit of another dimension, of no dimension, and none.
        ("unit,ft/s", "unit,ft", &["row u", "a velocity", "[models_from.units]"][..]),
        ("unit,ft/s", "unit,furlong/s", &["row u", "furlong"]),
        ("unit,ft/s", "unit,", &["u has no unit", "u = \"ft/s\" under [models_from.units]"]),
        // A wrong unit of the right dimension: gravity knows.
        ("ft/s,ft/s,ft/s", "m/s,m/s,m/s", &["A(u, theta)", "ft and m are mixed up"]),
        ("rad,rad", "deg,deg", &["A(u, theta)", "deg and rad are mixed up"]),
        // A sign.
        ("-32.2152", "32.2152", &["row u", "the other way round", "theta = \"-theta\""]),
        // Missing and ambiguous names.
        ("p,q,r,phi", "p,q,nu,phi", &["row r", "direct path"]),
        ("lat,lon", "lat,elevator", &["no input is known to be lon", "elevator"]),
        ("lat,lon,col,ped", "lat,lat_2,col,ped", &["no input is known to be lon"]),
        // Numbers.
        ("-0.0144", "nan", &["row u", "not a finite number", "column u"]),
        ("-0.0144", "-O.0144", &["is not a number", "column u"]),
        ("60 kt", "60 ft", &["the speed", "a length"]),
        ("trim,100.80727", "trim,30.7", &["row trim", "but the model is for 60.0 kt"]),
        ("46.87,45.27", "146.87,45.27", &["lat is at 146.9 %"]),
        ("\nr,-0.0029", "\nr,-0.0029,0", &["row r has 14 cells"]),
        ("\nq,", "\nx,", &["row q", "its row is missing"]),
    ] {
        let text = refused(&good.replacen(from, to, 1));
        for message in messages {
            assert!(text.contains(message), "{from} -> {to}: {text}");
        }
    }
    // A state of another name.
    let other = good.replacen("q,r,phi", "q,nu,phi", 1).replacen("\nr,", "\nnu,", 1);
    let text = refused(&other);
    assert!(text.contains("no state or output is known to be r"), "{text}");
    assert!(text.contains("r = \"NAME\" under [models_from.states]"), "{text}");
    // Two names for one thing.
    let twice = good.replacen("lat,lon", "Lateral,d_lat", 1);
    let text = refused(&twice);
    assert!(text.contains("\"Lateral\" and \"d_lat\" could be lat"), "{text}");
    assert!(text.contains("lat = \"Lateral\" under [models_from.inputs]"), "{text}");
    // Nothing there.
    let report = load(Path::new("no-such-set"), &Mapping::default()).unwrap_err();
    assert!(report.unreadable);
}

fn near(found: &LtiSet, wanted: &LtiSet) {
    assert_eq!(found.models.len(), wanted.models.len());
    for (f, w) in found.models.iter().zip(&wanted.models) {
        assert!((f.speed - w.speed).abs() < 1e-9);
        assert!((f.model.a() - w.model.a()).amax() < 1e-12, "{}", f.label);
        assert!((f.model.b() - w.model.b()).amax() < 1e-13);
        assert!((f.trim.pitch - w.trim.pitch).abs() < 1e-14);
        let pairs = f.trim.velocity_body.iter().zip(w.trim.velocity_body);
        assert!(pairs.into_iter().all(|(f, w)| (f - w).abs() < 1e-11));
        assert_eq!(f.trim.sticks, w.trim.sticks);
    }
}

/// JSON, MAT and CSV that we write are read back, in both systems of units.
#[test]
fn every_form_holds_the_same_set() {
    let (wanted, own) = (uh60a(), own_set());
    let directory = tempfile::tempdir().unwrap();
    for (name, system) in [("us", System::Us), ("si", System::Si)] {
        let read = |extension: &str, bytes: &[u8]| {
            let path = directory.path().join(format!("{name}.{extension}"));
            std::fs::write(&path, bytes).unwrap();
            let set = load(&path, &Mapping::default()).unwrap_or_else(|r| panic!("{r}"));
            assert_eq!(set.stick_limits, OWN_LIMITS, "{extension}");
            set
        };
        near(&read("json", set_to_json(&own, system).as_bytes()), &wanted);
        near(&read("mat", &set_to_mat(&own, system)), &wanted);
        let mut text = String::new();
        for (k, (speed, model)) in own.speeds().iter().zip(own.models()).enumerate() {
            let record = ModelRecord {
                speed: *speed,
                interactions: None,
                model: model.clone(),
                trim: own.trims().map(|t| t[k].clone()),
            };
            let one = to_csv(&record, system).unwrap();
            text += if k == 0 { &one } else { one.split_once('\n').unwrap().1 };
        }
        near(&read("csv", text.as_bytes()), &wanted);
    }
}

/// Speeds of a file must grow, and each but once.
#[test]
fn speeds_out_of_order_are_refused() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("set.json");
    let text = set_to_json(&own_set(), System::Us);
    for (to, message) in [("130.0", "is below that of model 3"), ("60.0", "equals that of")] {
        std::fs::write(
            &path,
            text.replacen("\"speed_kt\": 40.0", &format!("\"speed_kt\": {to}"), 1),
        )
        .unwrap();
        let error = load(&path, &Mapping::default()).unwrap_err().to_string();
        assert!(error.contains("model 4 (60 kt)") && error.contains(message), "{error}");
    }
}

/// Faults of JSON and MAT files.
#[test]
fn damaged_files_are_refused() {
    let directory = tempfile::tempdir().unwrap();
    let error = |name: &str, bytes: &[u8]| {
        let path = directory.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        load(&path, &Mapping::default()).unwrap_err().to_string()
    };
    let text = set_to_json(&own_set(), System::Us);
    let of = |from: &str, to: &str| {
        let changed = text.replacen(from, to, 1);
        assert_ne!(changed, text, "{from}");
        error("set.json", changed.as_bytes())
    };
    assert!(of("lti-set/1", "lti-set/9").contains("coaxdesign.lti-set/1"));
    assert!(of("\"a\"", "\"A\"").contains("unknown field `A`"));
    assert!(of("-0.0124, ", "").contains("\"a\" has 7 entries in row 1"));
    assert!(of("\"x0\": [", "\"x0\": [0.0, ").contains("9 trim values stand beside 8 states"));
    assert!(error("set.json", b"{").contains("set.json:1:"));
    assert!(error("set.txt", b"x").contains("no form of a set"));
    assert!(error("set.mat", b"x").contains("level 5"));
    let mut empty = MatFile::new();
    empty.text("sys", "an ss object");
    assert!(error("set.mat", &empty.into_bytes()).contains("ssdata"));
    let mut nameless = MatFile::new();
    nameless.array("A", &[1, 1], &[-1.0]);
    nameless.array("B", &[1, 1], &[1.0]);
    nameless.array("speed_kt", &[1, 1], &[0.0]);
    assert!(error("set.mat", &nameless.into_bytes()).contains("save state_names"));
}

/// A model in other coordinates, its motion in the outputs, with a delayed
/// stick and one in inches: the same responses.
#[test]
fn outputs_delays_and_inches() {
    use nalgebra::DMatrix;
    use num_complex::Complex64 as C;
    let set = uh60a();
    let wanted = &set.models[3].model;
    let names = ["u", "v", "w", "p", "q", "r", "phi", "theta"];
    // x = T z with a well-conditioned T.
    let t = DMatrix::from_fn(
        8,
        8,
        |i, j| {
            if i == j { 2.0 } else { 0.3 * ((3 * i + 5 * j) as f64).sin() }
        },
    );
    let inverse = t.clone().try_inverse().unwrap();
    let (a, b) = (&inverse * wanted.a() * &t, &inverse * wanted.b());
    let rows = |m: &DMatrix<f64>| -> String {
        let lines: Vec<String> = m
            .row_iter()
            .map(|r| format!("[{}]", r.iter().map(f64::to_string).collect::<Vec<_>>().join(", ")))
            .collect();
        format!("[{}]", lines.join(", "))
    };
    let mut b_inches = b.clone();
    // Ten inches of travel: an inch moves ten times as much as a per cent.
    b_inches.column_mut(1).scale_mut(10.0);
    let units = ["m/s", "m/s", "m/s", "rad/s", "rad/s", "rad/s", "rad", "rad"];
    let outputs: Vec<String> = names
        .iter()
        .zip(units)
        .map(|(n, u)| format!("{{\"name\": \"{n}\", \"unit\": \"{u}\"}}"))
        .collect();
    let states: Vec<String> = (1..=8).map(|k| format!("{{\"name\": \"x{k}\"}}")).collect();
    let text = format!(
        r#"{{"schema": "coaxdesign.lti-set/1", "name": "abstract",
        "states": [{}],
        "inputs": [{{"name": "lat", "unit": "%", "delay_s": 0.03}}, {{"name": "lon", "unit": "in"}},
                   {{"name": "col", "unit": "%"}}, {{"name": "ped", "unit": "%"}}],
        "outputs": [{}],
        "models": [{{"speed": "60 kt", "a": {}, "b": {}, "c": {}}}]}}"#,
        states.join(", "),
        outputs.join(", "),
        rows(&a),
        rows(&b_inches),
        rows(&t),
    );
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("abstract.json");
    std::fs::write(&path, &text).unwrap();
    let error = load(&path, &level_flight()).unwrap_err().to_string();
    assert!(error.contains("lon = \"10 in\" under [models_from.travel]"), "{error}");
    let mut mapping = level_flight();
    mapping.travel[1] = Some("10 in".into());
    let found = load(&path, &mapping).unwrap_or_else(|r| panic!("{r}"));
    let found = &found.models[0];
    let response = |m: &coaxdesign::linear::StateSpace, omega: f64| -> DMatrix<C> {
        let n = m.states().len();
        let s =
            DMatrix::from_fn(n, n, |i, j| C::new(-m.a()[(i, j)], if i == j { omega } else { 0.0 }));
        let x = s.lu().solve(&m.b().map(|v| C::new(v, 0.0))).unwrap();
        x.rows(0, 8).into_owned()
    };
    for omega in [0.3, 2.0, 15.0] {
        let (f, w) = (response(&found.model, omega), response(wanted, omega));
        let late = C::from_polar(1.0, -omega * 0.03);
        for i in 0..8 {
            for j in 0..4 {
                let w = w[(i, j)] * if j == 0 { late } else { C::new(1.0, 0.0) };
                assert!((f[(i, j)] - w).norm() < 1e-6 * w.norm().max(1e-6), "{omega} {i} {j}");
            }
        }
    }
}

/// An unstable mode that no stick reaches is no model to fly.
#[test]
fn hidden_unstable_modes_are_refused() {
    let good = std::fs::read_to_string(example("uh60a/060kt.csv")).unwrap();
    let mut lines: Vec<String> = good.lines().map(str::to_owned).collect();
    for line in &mut lines {
        let cell = |value: &str| line.replacen(",p,", &format!(",{value},p,"), 1);
        *line = match line.split(',').next() {
            Some("row") => cell("x"),
            Some("unit") => line.replacen("ft/s,rad/s", "ft/s,-,rad/s", 1),
            Some("trim") => line.replacen(",0,0,0,", ",0,0,0,0,", 1),
            Some("u" | "v" | "w" | "p" | "q" | "r") => {
                let mut cells: Vec<&str> = line.split(',').collect();
                cells.insert(4, "0.01");
                cells.join(",")
            }
            _ => line.clone(),
        };
    }
    lines.push("x,0,0,0,0.7,0,0,0,0,0,0,0,0,0".into());
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("hidden.csv");
    std::fs::write(&path, lines.join("\n")).unwrap();
    let error = load(&path, &Mapping::default()).unwrap_err().to_string();
    assert!(error.contains("the sticks cannot move the unstable mode at 0.7000"), "{error}");
    // A stable one is only a state more.
    lines.pop();
    lines.push("x,0,0,0,-0.7,0,0,0,0,0,0,0,0,0".into());
    std::fs::write(&path, lines.join("\n")).unwrap();
    let set = load(&path, &Mapping::default()).unwrap_or_else(|r| panic!("{r}"));
    assert_eq!(set.models[0].model.states().len(), 9);
}

/// A model of rates alone: attitudes are their integrals, and its trim is said.
#[test]
fn attitudes_are_integrated_from_rates() {
    let good = std::fs::read_to_string(example("uh60a/060kt.csv")).unwrap();
    let kept: Vec<String> = good
        .lines()
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            if cells.len() < 13 {
                return line.to_owned();
            }
            [&cells[..7], &cells[9..]].concat().join(",")
        })
        .collect();
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("rates.csv");
    std::fs::write(&path, kept.join("\n")).unwrap();
    let set = load(&path, &level_flight()).unwrap_or_else(|r| panic!("{r}"));
    let model = &set.models[0].model;
    assert_eq!(model.state_names()[6..], ["phi", "theta"]);
    assert_eq!(model.derivative("phi", "p").unwrap(), 1.0);
    assert_eq!(model.derivative("theta", "q").unwrap(), 1.0);
    assert!(model.a().column(7).iter().all(|x| *x == 0.0));
    assert!(set.notes.iter().any(|n| n.contains("theta is not in the models")), "{:?}", set.notes);
}

/// The UH-60A as SciPy 1.17.1 saved it is the one of the CSV tables.
#[test]
fn a_mat_file_of_scipy_is_the_same_set() {
    let tables = uh60a();
    let saved = load(&example("uh60a").join("uh60a.mat"), &Mapping::default())
        .unwrap_or_else(|r| panic!("{r}"));
    assert_eq!(saved.name, tables.name);
    assert_eq!(saved.speeds().len(), 6);
    for (a, b) in saved.models.iter().zip(&tables.models) {
        assert!((a.speed - b.speed).abs() < 1e-12);
        assert_eq!(a.trim, b.trim, "{}", a.label);
        assert_eq!(a.model.states(), b.model.states());
        // The rows of the attitudes are left out of the tables, and written in
        // the file.
        assert!((a.model.a() - b.model.a()).amax() < 1e-12, "{}", a.label);
        assert!((a.model.b() - b.model.b()).amax() < 1e-15, "{}", a.label);
    }
}

/// A model that grows by itself while the law holds bank, pitch, yaw rate and
/// vertical velocity exactly cannot be inverted: here forward velocity, by
/// 1.5 1/s. The message names the file and the growth.
#[test]
fn models_that_cannot_be_inverted_are_refused() {
    let directory = tempfile::tempdir().unwrap();
    for entry in std::fs::read_dir(example("uh60a")).unwrap() {
        let path = entry.unwrap().path();
        let Ok(text) = std::fs::read_to_string(&path) else { continue };
        let name = path.file_name().unwrap().to_owned();
        let changed = text.replacen("\nu,-0.0144,", "\nu,1.5,", 1);
        assert_eq!(changed != text, name == "060kt.csv");
        std::fs::write(directory.path().join(name), changed).unwrap();
    }
    let set = load(directory.path(), &Mapping::default()).unwrap_or_else(|r| panic!("{r}"));
    let spec = spec::builtin().unwrap();
    let refused = |speed: f64| from_set(&set, None, &spec.models[..1], &[speed * KNOT]);
    let message = refused(60.0).unwrap_err().to_string();
    assert!(message.contains("060kt.csv") && message.contains("grow"), "{message}");
    assert!(refused(40.0).is_ok());
}
