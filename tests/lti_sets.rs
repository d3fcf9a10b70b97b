//! Linear models from elsewhere: reading, checking, stitching, plants.

use coaxdesign::control::models::from_set;
use coaxdesign::control::spec;
use coaxdesign::linear::dense::eigenvalues;
use coaxdesign::linear::reference::{Condition, appendix};
use coaxdesign::lti::mapping::{Mapping, MissingTrim};
use coaxdesign::lti::stitch::Stitched;
use coaxdesign::lti::{LtiSet, load};
use coaxdesign::units::KNOT;
use std::path::{Path, PathBuf};

fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/models").join(name)
}

fn uh60a() -> LtiSet {
    load(&example("uh60a"), &Mapping::default()).unwrap_or_else(|r| panic!("{r}"))
}

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
    assert!(beyond.contains("130") && beyond.contains("1 to 120 kt"), "{beyond}");
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
