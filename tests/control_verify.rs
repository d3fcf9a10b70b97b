//! Verification: design margins, stability, authority, and the model set.

mod common;

use coaxdesign::control::axis::{Axis, Channel, ChannelGains, Effector};
use coaxdesign::control::design::{Design, design};
use coaxdesign::control::law::{LawPoint, LawTable};
use coaxdesign::control::models::{build, varied};
use coaxdesign::control::plant::{
    CONTROL_POWER_FREQUENCY, Inversion, ModelSet, SLOWEST_REFERENCE, rigid,
};
use coaxdesign::control::spec::{self, Specification};
use coaxdesign::control::testbed;
use coaxdesign::control::verify::{BladeControl, authority, verify};
use common::{KNOT, coarsened, problem};
use nalgebra::Matrix3;
use num_complex::Complex64;

/// Inner axes of the built-in targets at one speed of the test bed, tuned.
fn tuned() -> (Specification, ModelSet, Design) {
    let mut spec = spec::builtin().unwrap_or_else(|r| panic!("{r}"));
    spec.models.truncate(1);
    spec.channels.retain(|c| !c.channel.is_outer());
    let set = testbed::model_set(&[10.0], false);
    let made = design(&spec, &set, &[], &[]).unwrap();
    (spec, set, made)
}

fn with_gains(table: &LawTable, f: impl Fn(ChannelGains) -> ChannelGains) -> LawTable {
    let points: Vec<LawPoint> =
        table.points().iter().map(|p| LawPoint { gains: p.gains.map(&f), ..p.clone() }).collect();
    LawTable::new(points, table.settings, table.turn).unwrap()
}

/// 0 % on the bound, 100 % a comfortable amount beyond it, and linear between;
/// the requirement with the least margin is named, and it alone decides.
#[test]
fn design_margin_is_zero_on_the_bound_and_a_hundred_at_comfort() {
    let (mut spec, set, d) = tuned();
    let rows = verify(&d.table, &set, &spec.hardware, &spec).unwrap().rows;
    let roll = rows.iter().find(|r| r.axis == "roll").unwrap().clone();
    let place = spec.channels.iter().position(|c| c.channel == Channel::Roll).unwrap();
    for (fraction, expected) in [(0.0, 0.0), (0.5, 50.0), (1.0, 100.0), (-0.5, -50.0)] {
        // Everything but the phase margin far away.
        let t = &mut spec.channels[place].spec.nominal;
        (t.drb, t.drp, t.crossover_min, t.crossover_max) = (None, None, None, None);
        (t.gain_up, t.gain_down) = (1.0, 1.0);
        t.phase = roll.pm_deg.unwrap().to_radians() - fraction * spec.comfort.phase_margin;
        let again = verify(&d.table, &set, &spec.hardware, &spec).unwrap();
        let row = again.rows.iter().find(|r| r.axis == "roll").unwrap();
        let margin = row.design_margin_percent.unwrap();
        assert!((margin - expected).abs() < 1e-6, "{margin} {expected}");
        assert_eq!(row.binding.as_deref(), Some("pm_deg"));
        assert_eq!(row.passed, fraction >= 0.0);
        assert_eq!(row.missed.len(), usize::from(fraction < 0.0));
    }
}

/// Ten times the gains with this delay: the eigenvalues grow, and the margins
/// and the verification as a whole say so. A tenth of a degree is not asked of
/// the growth rate, only its sign: both ways of looking must agree.
#[test]
fn eigenvalues_and_margins_agree_on_instability() {
    let (spec, set, d) = tuned();
    let good = verify(&d.table, &set, &spec.hardware, &spec).unwrap();
    assert!(good.stability.iter().all(|s| s.passed && s.growth_per_s < 0.0));
    assert!(good.stability.iter().all(|s| s.pade_change_per_s < 1e-3));
    let least = good.rows.iter().find(|r| r.axis == "roll").unwrap().gm_up_db.unwrap();
    let only_roll = |factor: f64| {
        let mut points = d.table.points().to_vec();
        let k = &mut points[0].gains[Channel::Roll.index()];
        *k = ChannelGains::new(k.k_d * factor, k.k_p * factor, k.k_i * factor);
        LawTable::new(points, d.table.settings, d.table.turn).unwrap()
    };
    // The loop at the effector also holds the inversion's own feedback, which
    // is not scaled: so the critical factor is near the gain margin, not on it.
    let at = |db: f64| {
        let table = only_roll(10f64.powf(db / 20.0));
        verify(&table, &set, &spec.hardware, &spec).unwrap().stability[0].growth_per_s
    };
    assert!(at(least - 1.5) < 0.0, "{}", at(least - 1.5));
    assert!(at(least + 1.5) > 0.0, "{}", at(least + 1.5));
    let wild =
        with_gains(&d.table, |k| ChannelGains::new(10.0 * k.k_d, 10.0 * k.k_p, 10.0 * k.k_i));
    let v = verify(&wild, &set, &spec.hardware, &spec).unwrap();
    assert!(!v.passed && !v.stability[0].passed && v.stability[0].growth_per_s > 0.0);
}

/// What a step asks of a blade is proportional to the step; a limit or a rate
/// limit below it fails, one above it passes.
#[test]
fn authority_is_linear_in_the_step_and_judged_against_limits() {
    let (mut spec, _, d) = tuned();
    let trim = d.table.points()[0].inversion.trim.sticks;
    let blade = |limit: f64| BladeControl {
        name: "blade".into(),
        gain: [0.01, 0.0, 0.0, 0.0],
        offset: -0.01 * trim[0],
        limits: [-limit, limit],
        pitch: true,
    };
    let far = [[-1e6, 1e6]; 4];
    let roll = |spec: &Specification, limit: f64| {
        let checks = authority(&d.table, &spec.hardware, spec, &[blade(limit)], &far);
        checks.into_iter().find(|c| c.axis == "roll").unwrap()
    };
    spec.pitch_rate_limit = 1e6;
    let one = roll(&spec, 1.0);
    spec.steps.roll *= 2.0;
    let two = roll(&spec, 1.0);
    assert!(one.used_percent > 0.0);
    assert!((two.used_percent / one.used_percent - 2.0).abs() < 1e-9);
    assert!((two.rate_deg_s / one.rate_deg_s - 2.0).abs() < 1e-9);
    // The room that it needs, and a little less or more.
    let need = two.used_percent / 100.0;
    assert!(roll(&spec, 1.01 * need).passed);
    let short = roll(&spec, 0.99 * need);
    assert!(!short.passed && short.control == "blade");
    spec.pitch_rate_limit = 0.99 * two.rate_deg_s.to_radians();
    assert!(!roll(&spec, 1.01 * need).passed);
}

/// What a model of the specification changes, and what the aircraft makes of
/// it: more mass needs more collective, thin air too, and a centre of gravity
/// further aft makes pitch less stable against w.
#[test]
fn models_vary_mass_altitude_and_centre_of_gravity() {
    let base = coarsened(problem("coax2d"));
    let text = "[schedule]\nspeeds = [\"40 kt\"]\n[margins.nominal]\ngain_margin_db = 6.0\n\
                phase_margin = \"45 deg\"\n[axis.roll]\ndrb = \"0.6 rad/s\"\n\
                [models.base]\nclass = \"nominal\"\n\
                [models.heavy]\nclass = \"off_nominal\"\nmass_scale = 1.1\n\
                [models.high]\nclass = \"off_nominal\"\naltitude = \"6000 ft\"\n\
                [models.aft]\nclass = \"off_nominal\"\ncenter_of_gravity_shift = \"0.3 ft\"\n\
                [models.alone]\nclass = \"off_nominal\"\ninteractions = false\n";
    let spec = spec::parse("t.toml", text).unwrap_or_else(|r| panic!("{r}"));
    let aft = varied(&base, &spec.models[3]);
    let station = |p: &coaxdesign::problem::Problem| p.mass.center_of_gravity.fuselage_station;
    assert!((station(&aft) - station(&base) - 0.3 * 0.3048).abs() < 1e-12);
    assert_eq!(aft.mass.mass, base.mass.mass);
    let heavy = varied(&base, &spec.models[1]);
    assert!((heavy.mass.mass / base.mass.mass - 1.1).abs() < 1e-12);
    assert!((heavy.mass.i_yy / base.mass.i_yy - 1.1).abs() < 1e-12);

    let built =
        build(&base, &spec.models, &[40.0 * KNOT], &|| ()).unwrap_or_else(|e| panic!("{e}"));
    let at = |name: &str| {
        let k = built.set.models.iter().position(|m| m.name == name).unwrap();
        &built.set.plants[0][k]
    };
    let collective = |name: &str| at(name).trim.sticks[2];
    assert!(collective("heavy") > collective("base") + 0.5);
    assert!(collective("high") > collective("base") + 0.5);
    assert!(collective("alone") < collective("base") - 0.5);
    let m_w = |name: &str| at(name).reduced_a[(rigid::Q, rigid::W)];
    assert!(m_w("aft") > m_w("base") + 1e-4, "{} {}", m_w("aft"), m_w("base"));
    // All of them can be inverted.
    for p in &built.set.plants[0] {
        Inversion::new(p).unwrap();
    }
}

/// Slowest mode of the reference model's own velocities, 1/s.
fn slowest(i: &Inversion) -> f64 {
    let free = i.reference.dynamics * i.reference.state;
    free.complex_eigenvalues().iter().map(|e| e.re).fold(f64::NEG_INFINITY, f64::max)
}

/// Where the left-over velocities drift apart the reference model does not;
/// where they settle by themselves it is the exact inversion.
#[test]
fn reference_model_settles() {
    let mut plant = testbed::plant(10.0, &testbed::NOMINAL);
    let i = Inversion::new(&plant).unwrap();
    let exact = plant.reduced_a - plant.reduced_b * i.decoupling * i.feedback;
    assert!(slowest(&i) < -SLOWEST_REFERENCE, "{}", slowest(&i));
    let difference = i.reference.dynamics - exact.fixed_rows::<2>(0);
    assert!(difference.amax() < 1e-12);
    plant.reduced_a[(rigid::U, rigid::U)] += 0.3;
    let i = Inversion::new(&plant).unwrap();
    assert!((slowest(&i) + SLOWEST_REFERENCE).abs() < 1e-9, "{}", slowest(&i));
}

/// Attitude errors move no collective, heave errors leave attitudes alone at
/// the frequency of the allocation, and attitudes have the size asked for.
#[test]
fn allocation_is_triangular_and_meets_the_power_it_assumes() {
    for speed in [0.0, 20.0, 40.0] {
        let plant = testbed::plant(speed, &testbed::NOMINAL);
        let i = Inversion::new(&plant).unwrap();
        let (heave, collective) = (Axis::Heave.index(), Effector::Collective.index());
        for axis in [Axis::Roll, Axis::Pitch, Axis::Yaw] {
            let scale = i.allocation.column(axis.index()).amax();
            assert!(i.allocation[(collective, axis.index())].abs() < 1e-9 * scale);
        }
        // B_d + Re F_uvw (jω − A)⁻¹ B by complex arithmetic.
        let a = plant.reduced_a.fixed_view::<3, 3>(0, 0).map(|v| Complex64::new(v, 0.0));
        let s = Matrix3::identity() * Complex64::new(0.0, CONTROL_POWER_FREQUENCY);
        let follow = (s - a).try_inverse().unwrap().map(|v| v.re);
        let power = i.decoupling.try_inverse().unwrap()
            + i.feedback.fixed_columns::<3>(0) * follow * plant.reduced_b.fixed_rows::<3>(0);
        let reached = power * i.allocation;
        for r in (0..4).filter(|&r| r != heave) {
            for c in 0..4 {
                let unit = if r == c { 1.0 } else { 0.0 };
                assert!((reached[(r, c)] - unit).abs() < 1e-6, "{speed}: {reached}");
            }
        }
    }
}

/// With the outer loops closed D is still affine in an inner axis's gains: what
/// the lemma gives at other gains is the determinant there.
#[test]
fn inner_gains_stay_affine_with_the_outer_loops_closed() {
    use coaxdesign::control::axis::{Channel, GainSet};
    use coaxdesign::control::law::{LawSettings, TurnCoordination};
    use coaxdesign::control::loops::{Cut, GainGrid, LoopModel, affine_value, with_channel};
    use coaxdesign::control::tuning::start_gains;
    let settings = LawSettings {
        kappa: 0.4,
        hybrid_feedforward: true,
        reference_delay: 0.12,
        roll_frequency: 2.0,
        pitch_frequency: 1.7,
        attitude_damping: 0.8,
        yaw_time_constant: 0.5,
        heave_time_constant: 2.0,
        notch: Default::default(),
    };
    let plant = testbed::plant(12.0, &testbed::NOMINAL);
    let inversion = Inversion::new(&plant).unwrap();
    let mut gains = GainSet::default();
    for c in Channel::ALL {
        gains[c.index()] = start_gains(c, 0.15, [0.0, 10.0]);
    }
    let omega: Vec<f64> = vec![0.1, 0.7, 2.0, 5.0];
    let point = LawPoint { speed: 12.0, gains, inversion };
    // In the blend, where each outer loop moves more than its own axis.
    let turn = TurnCoordination { speed: 12.0, width: 5.0 };
    let table = LawTable::new(vec![point], settings, turn).unwrap();
    let grid = GainGrid::new(&table, 12.0, omega.into());
    let model = LoopModel::new(&plant, &grid, testbed::HARDWARE, 0.0).unwrap();
    for channel in Channel::ALL {
        let loops = model.channel(&gains, channel, &[Cut::Effector]);
        let x: Vec<f64> =
            gains[channel.index()].values(channel).iter().map(|g| 1.7 * g + 0.1).collect();
        let moved = with_channel(&gains, channel, &x);
        for (f, d) in loops.full.iter().zip(model.determinant(&moved)) {
            let lemma = affine_value(f, &x);
            assert!((lemma - d).norm() < 1e-9 * d.norm(), "{channel}: {lemma} and {d}");
        }
        // The loop cut at the effector does not depend on how it is written.
        let cut = model.channel(&moved, channel, &[Cut::Effector]);
        let (a, b) = (loops.loop_curve(0, &x), cut.loop_curve(0, &x));
        for (a, b) in a.iter().zip(b) {
            assert!((a - b).norm() < 1e-9 * (1.0 + b.norm()), "{channel}: {a} and {b}");
        }
    }
}
