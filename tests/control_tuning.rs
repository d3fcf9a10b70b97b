//! The tuning as a whole, on the test bed.

use coaxdesign::control::axis::{Axis, Channel, ChannelGains};
use coaxdesign::control::design::{design, lag_laws};
use coaxdesign::control::plant::{ModelClass, ModelSet};
use coaxdesign::control::spec::{self, Specification};
use coaxdesign::control::tuning::TuningError;
use coaxdesign::control::verify::verify;
use coaxdesign::control::{design::DesignError, testbed};

fn with(f: impl Fn(&mut Specification)) -> Specification {
    let mut s = spec::builtin().unwrap_or_else(|r| panic!("{r}"));
    s.models.truncate(1);
    // The built-in target is one of the CoAX 2D. The test bed is another
    // aircraft: for it Level 1, 0.7 of 0.9 rad/s.
    for channel in s.channels.iter_mut().filter(|c| c.channel == Channel::Yaw) {
        for targets in [&mut channel.spec.nominal, &mut channel.spec.off_nominal] {
            targets.drb = targets.drb.map(|drb| drb * 7.0 / 9.0);
        }
    }
    f(&mut s);
    s
}

fn inner_only(s: &mut Specification) {
    s.channels.retain(|c| !c.channel.is_outer());
}

/// A set at these speeds and, for the verification, with the middles.
fn sets(speeds: &[f64]) -> (ModelSet, ModelSet) {
    let mut all = speeds.to_vec();
    all.extend(speeds.windows(2).map(|w| 0.5 * (w[0] + w[1])));
    all.sort_by(f64::total_cmp);
    (testbed::model_set(speeds, false), testbed::model_set(&all, false))
}

fn between(nodes: &ModelSet, all: &ModelSet) -> Vec<coaxdesign::control::plant::Plant> {
    let known = nodes.speeds();
    all.plants
        .iter()
        .map(|p| p[0].clone())
        .filter(|p| known.iter().all(|v| (v - p.speed).abs() > 1e-9))
        .collect()
}

/// Low speed, full law with outer loops: every nominal requirement is met at
/// nodes and between them, and the full-order loop is stable.
#[test]
fn nominal_requirements_are_met_at_nodes_and_between() {
    // The outer loops take a little more on the test bed than on the aircraft.
    let spec = with(|s| {
        for c in s.channels.iter_mut().filter(|c| !c.channel.is_outer()) {
            c.spec.phase_reserve = 1.5f64.to_radians();
        }
    });
    let (nodes, all) = sets(&[0.0, 10.0, 20.0]);
    let d = design(&spec, &nodes, &between(&nodes, &all), &[]).unwrap();
    let v = verify(&d.table, &all, &spec.hardware, &spec).unwrap();
    for r in &v.rows {
        assert!(r.passed, "{} at {:.1} m/s: {:?}", r.axis, r.speed_m_s, r.missed);
    }
    assert!(v.stability.iter().all(|s| s.passed));
    assert!(v.passed && v.nominal_passed);
}

/// An impossible DRB ends in a design that is stable, and missed rows that say
/// what is missed; nothing fails.
#[test]
fn impossible_requirement_gives_the_least_violating_design() {
    let spec = with(|s| {
        inner_only(s);
        s.channels.retain(|c| c.channel == Channel::Roll);
        s.channels[0].spec.nominal.drb = Some(3.0);
    });
    let (nodes, _) = sets(&[0.0]);
    let d = design(&spec, &nodes, &[], &[]).unwrap();
    let v = verify(&d.table, &nodes, &spec.hardware, &spec).unwrap();
    assert!(!v.passed);
    assert!(!v.rows[0].missed.is_empty());
    // Single axis and one speed: the pitch loop is open, so only the roll
    // loop's own requirement is judged, and D has not changed its winding.
    assert_eq!(v.rows.len(), 1);
}

/// Contradictory bounds are weighed, not refused: crossover above 4 rad/s and a
/// phase margin of 80 deg cannot both be had with this delay.
#[test]
fn contradictory_requirements_are_both_reported() {
    let spec = with(|s| {
        inner_only(s);
        let roll = &mut s.channels[0].spec.nominal;
        roll.crossover_min = Some(4.0);
        roll.phase = 80f64.to_radians();
    });
    let (nodes, _) = sets(&[0.0]);
    let d = design(&spec, &nodes, &[], &[]).unwrap();
    let v = verify(&d.table, &nodes, &spec.hardware, &spec).unwrap();
    let roll = v.rows.iter().find(|r| r.axis == "roll").unwrap();
    assert!(!roll.passed);
}

/// Half a second of delay on an unstable vehicle: no start stabilises it, and
/// the error says where.
#[test]
fn unstabilisable_model_is_named() {
    let spec = with(|s| {
        inner_only(s);
        s.hardware.delay = 0.9;
    });
    let mut set = testbed::model_set(&[0.0], false);
    // A pitch divergence of 3 rad/s.
    let p = &mut set.plants[0][0];
    p.a[(4, 4)] += 3.0;
    p.reduced_a[(4, 4)] += 3.0;
    match design(&spec, &set, &[], &[]) {
        Err(DesignError::Tuning(TuningError::Unstabilisable { model, growth, .. })) => {
            assert_eq!(model, "nominal");
            assert!(growth > 0.0);
        }
        other => panic!("{:?}", other.map(|d| d.tuning.stats)),
    }
}

/// Same input, same result to the last bit, whatever the number of threads.
#[test]
fn result_does_not_depend_on_threads() {
    let spec = with(inner_only);
    let (nodes, _) = sets(&[0.0, 15.0]);
    let run = |threads: usize| {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap()
            .install(|| design(&spec, &nodes, &[], &[]).unwrap().tuning.gains)
    };
    assert_eq!(run(1), run(3));
}

/// The lag law sees hardware and rotor: more delay, less bandwidth, by as much.
#[test]
fn lag_law_follows_the_delay() {
    let (nodes, _) = sets(&[0.0]);
    let fast = with(|_| {});
    let slow = with(|s| s.hardware.delay += 0.050);
    let delay = |s: &Specification| {
        let laws = lag_laws(s, &nodes).unwrap();
        laws.iter().find(|l| l.0 == Axis::Roll).unwrap().2
    };
    let (a, b) = (delay(&fast), delay(&slow));
    let added = b.equivalent_delay_s - a.equivalent_delay_s;
    assert!((added - 0.050).abs() < 0.008, "{added}");
    // Test bed: actuator 53 ms, delay 35, sensor 17, flapping 47.
    assert!((a.equivalent_delay_s - 0.152).abs() < 0.012, "{}", a.equivalent_delay_s);
    assert!(b.largest_drb_rad_s < a.largest_drb_rad_s);
}

/// Off-nominal models are held to their own margins.
#[test]
fn robust_tuning_meets_off_nominal_margins() {
    let spec = with(|s| {
        inner_only(s);
        s.models.push(s.models[0].clone());
        s.models[1].info.class = ModelClass::OffNominal;
    });
    let set = testbed::model_set(&[0.0, 10.0], true);
    let d = design(&spec, &set, &[], &[]).unwrap();
    let v = verify(&d.table, &set, &spec.hardware, &spec).unwrap();
    for r in &v.rows {
        assert!(r.passed, "{} {} at {:.1} m/s: {:?}", r.axis, r.model, r.speed_m_s, r.missed);
    }
}

/// A loop whose speed range holds none of the speeds is left open, and that is
/// all: it used to make an empty conic program.
#[test]
fn regress_loop_outside_its_speed_range_is_left_open() {
    let spec = with(|s| s.channels.retain(|c| c.channel != Channel::Vx));
    let (nodes, _) = sets(&[70.0]);
    let d = design(&spec, &nodes, &[], &[]).unwrap();
    let gains = d.table.points()[0].gains;
    assert_eq!(gains[Channel::Vy.index()], Default::default());
    assert_ne!(gains[Channel::Roll.index()], Default::default());
}

/// Outer loops to 50 kt over breakpoints that have none there, in knots and in
/// metres a second: they end at the last breakpoint within their range. Between
/// it and the next they fade, are held to nothing, and the verification says so.
#[test]
fn outer_loops_end_at_a_breakpoint_and_the_verification_says_so() {
    use coaxdesign::control::verify::Fading;
    use coaxdesign::units::KNOT;
    let spec = with(|s| {
        for c in s.channels.iter_mut().filter(|c| !c.channel.is_outer()) {
            c.spec.phase_reserve = 1.5f64.to_radians();
        }
        for c in s.channels.iter_mut().filter(|c| c.channel.is_outer()) {
            c.spec.speeds = [0.0, 50.0 * KNOT];
        }
    });
    // In knots.
    for speeds in [[20.0, 40.0, 60.0], [10.0, 20.0, 30.0].map(|v| v / KNOT)] {
        let (nodes, all) = sets(&speeds);
        let d = design(&spec, &nodes, &between(&nodes, &all), &[]).unwrap();
        let v = verify(&d.table, &all, &spec.hardware, &spec).unwrap();
        let outer: Vec<_> = v.rows.iter().filter(|r| r.axis == "vx").collect();
        assert_eq!(outer.len(), 3, "two breakpoints and the middle");
        for row in &outer {
            assert!(row.speed_m_s <= speeds[1] * KNOT + 1e-9);
            assert!(row.drb_rad_s.unwrap() > 0.0999, "{row:?}");
        }
        let fading: Vec<_> = v.not_required.iter().filter(|n| n.axis == "vx").collect();
        assert_eq!(fading.len(), 1, "{fading:?}");
        assert_eq!(fading[0].reason, Fading::Gains);
        assert!((fading[0].speed_m_s / KNOT - 0.5 * (speeds[1] + speeds[2])).abs() < 1e-9);
    }
}

/// A loop that a schedule leaves open within its range, or whose range holds no
/// speed that is looked at, is named: nothing passes for met that was not there.
#[test]
fn open_outer_loops_are_named() {
    use coaxdesign::control::verify::Fading;
    let mut spec = with(|s| s.channels.retain(|c| c.channel != Channel::Vy));
    let (nodes, _) = sets(&[10.0]);
    let d = design(&spec, &nodes, &[], &[]).unwrap();
    let open = d.table.with_gains(|k| {
        let mut gains = d.table.points()[k].gains;
        gains[Channel::Vx.index()] = Default::default();
        gains
    });
    let found = |spec: &Specification, table| {
        let v = verify(table, &nodes, &spec.hardware, spec).unwrap();
        assert!(v.rows.iter().all(|r| r.axis != "vx"));
        let named = v.not_required.iter().map(|n| (n.axis.clone(), n.reason, n.share));
        named.collect::<Vec<_>>()
    };
    assert_eq!(found(&spec, &open), [("vx".into(), Fading::Open, 0.0)]);
    for c in spec.channels.iter_mut().filter(|c| c.channel == Channel::Vx) {
        c.spec.speeds = [40.0, 45.0];
    }
    assert_eq!(found(&spec, &d.table), [("vx".into(), Fading::NoSpeed, 0.0)]);
}

/// Prices come from the duals; solving again with the target moved gives the
/// same change of activity, to first order, for every target that binds.
#[test]
fn prices_from_the_duals_agree_with_solving_again() {
    use coaxdesign::control::law::{LawPoint, LawTable};
    use coaxdesign::control::loops::Cut;
    use coaxdesign::control::loops::{GainGrid, LoopModel};
    use coaxdesign::control::metrics::{self, Sampled, from_decibels};
    use coaxdesign::control::tuning::{Price, Target, Targets, TuningProblem, default_grid};
    let base = with(|s| {
        inner_only(s);
        s.solver.grid = default_grid(0.002, 60.0, 900);
        s.channels.retain(|c| c.channel == Channel::Roll || c.channel == Channel::Pitch);
    });
    let (nodes, _) = sets(&[0.0]);
    let lag = lag_laws(&base, &nodes).unwrap();
    let settings = coaxdesign::control::design::settings(&base, &lag);
    // Roll alone is tuned again, so that its own price is what changes.
    let activity = |targets: Targets| -> (f64, Vec<Price>) {
        let mut spec = base.channels[0].tuned();
        spec.nominal = targets;
        let problem = TuningProblem {
            set: &nodes,
            between: Vec::new(),
            hardware: base.hardware,
            settings,
            turn: base.turn,
            channels: vec![(Channel::Roll, spec)],
            options: base.solver.clone(),
        };
        let t = problem.tune(None).unwrap();
        let worst = t.merits[0].1.worst();
        assert!(worst < 1e-3, "the targets must be met for a price: {worst}");
        let grid = default_grid(0.002, 60.0, 900).into();
        let plant = &nodes.plants[0][0];
        let point =
            LawPoint { speed: plant.speed, gains: t.gains[0], inversion: t.inversions[0].clone() };
        let table = LawTable::new(vec![point], settings, base.turn).unwrap();
        let law = GainGrid::new(&table, plant.speed, grid);
        let model = LoopModel::new(plant, &law, base.hardware, 0.0).unwrap();
        let l = model.channel(&t.gains[0], Channel::Roll, &[Cut::Effector]);
        let u = l.activity_curve(&t.gains[0][0].values(Channel::Roll));
        (metrics::activity(Sampled::new(&l.omega, &u), metrics::ACTIVITY_BAND), t.prices)
    };
    let margins = |phase: f64| Targets {
        phase: phase.to_radians(),
        drb: None,
        drp: None,
        crossover_min: None,
        crossover_max: None,
        ..base.channels[0].spec.nominal
    };
    // A target moved by a share of the tightening that its price is of.
    let moved = |t: &Targets, target: Target, share: f64| {
        let by = share * target.unit_tightening().0;
        let mut t = *t;
        match target {
            Target::PhaseMargin => t.phase += by,
            Target::GainMargin => {
                (t.gain_up, t.gain_down) = (t.gain_up * by.exp(), t.gain_up * by.exp())
            }
            Target::Drb => t.drb = t.drb.map(|v| v * by.exp()),
            Target::Drp => t.drp = t.drp.map(|v| v / by.exp()),
            Target::CrossoverMin => t.crossover_min = t.crossover_min.map(|v| v * by.exp()),
            Target::CrossoverMax => t.crossover_max = t.crossover_max.map(|v| v / by.exp()),
        }
        t
    };
    let rejection = Targets { drb: Some(0.68), ..margins(44.0) };
    let peak = Targets { drb: Some(0.5), drp: Some(from_decibels(3.0)), ..margins(44.0) };
    let (gain_up, gain_down) = (from_decibels(10.0), from_decibels(10.0));
    let gain = Targets { gain_up, gain_down, drb: Some(0.6), ..margins(30.0) };
    let crossover = Targets { crossover_min: Some(2.2), ..margins(44.0) };
    for (targets, target) in [
        (rejection, Target::PhaseMargin),
        (rejection, Target::Drb),
        (peak, Target::Drp),
        (gain, Target::GainMargin),
        (crossover, Target::CrossoverMin),
    ] {
        let (here, prices) = activity(targets);
        assert!(prices.iter().all(|p| p.percent >= 0.0), "{prices:?}");
        let dual = prices.iter().find(|p| p.target == target).unwrap().percent;
        let ends = [-0.5, 0.5].map(|share| activity(moved(&targets, target, share)).0);
        let solved = 100.0 * (ends[1] - ends[0]) / here;
        println!("{target:?}: {dual:.3} % from the duals, {solved:.3} % by solving again");
        assert!((dual - solved).abs() < 0.15 + 0.15 * solved.abs(), "{target:?}: {dual} {solved}");
        assert!(solved > 0.2, "{target:?} must bind for this to say anything: {solved}");
    }
}

/// The explanation of an axis at a speed of a design.
fn explained(
    spec: &Specification,
    set: &ModelSet,
    d: &coaxdesign::control::design::Design,
    channel: Channel,
) -> coaxdesign::control::explain::Explanation {
    use coaxdesign::control::explain::Site;
    let v = verify(&d.table, set, &spec.hardware, spec).unwrap();
    let rows: Vec<_> = v.rows.iter().filter(|r| r.axis == channel.name()).collect();
    let site = Site {
        spec,
        table: &d.table,
        infos: &set.models,
        plants: &set.plants[0],
        speed: set.plants[0][0].speed,
        requirement: spec.channels.iter().find(|c| c.channel == channel).unwrap(),
        rows: &rows,
        prices: &d.tuning.prices,
    };
    site.explain().unwrap()
}

/// A bandwidth beyond the hardware, of nominal and off-nominal models: both
/// misses are explained. What is said to be attainable is: a design to it is
/// met, and one to a little more is not. So is what is said of the requirement
/// that stands against it.
#[test]
fn what_is_said_to_be_attainable_is_met_by_a_design_to_it() {
    use coaxdesign::control::tuning::{ChannelSpec, Target};
    let base = with(|s| {
        inner_only(s);
        s.models.push(s.models[0].clone());
        s.models[1].info.class = ModelClass::OffNominal;
        for c in &mut s.channels {
            c.spec.phase_reserve = 0.0;
        }
    });
    let mut set = testbed::model_set(&[10.0], true);
    set.models.truncate(2);
    set.plants.iter_mut().for_each(|p| p.truncate(2));
    let changed = |f: &dyn Fn(&mut ChannelSpec)| {
        let mut spec = base.clone();
        spec.channels
            .iter_mut()
            .filter(|c| c.channel == Channel::Roll)
            .for_each(|c| f(&mut c.spec));
        spec
    };
    let bandwidth = |spec: &mut ChannelSpec, drb: f64| {
        let scale = spec.off_nominal.drb.unwrap() / spec.nominal.drb.unwrap();
        (spec.nominal.drb, spec.off_nominal.drb) = (Some(drb), Some(scale * drb));
    };
    let met = |spec: &Specification| {
        let d = design(spec, &set, &[], &[]).unwrap();
        verify(&d.table, &set, &spec.hardware, spec).unwrap().rows.iter().all(|r| r.passed)
    };
    let spec = changed(&|s| bandwidth(s, 1.3));
    let d = design(&spec, &set, &[], &[]).unwrap();
    let e = explained(&spec, &set, &d, Channel::Roll);
    assert!(!e.met && !e.attainable && e.remedy.is_none());
    // Every requirement that a row misses is among those explained, and no other.
    let v = verify(&d.table, &set, &spec.hardware, &spec).unwrap();
    for row in v.rows.iter().filter(|r| r.axis == "roll") {
        for missed in &row.missed {
            let named = missed.requirement.split('_').next().unwrap();
            let short = |t: Target| format!("{t:?}").to_lowercase();
            let entry = e.targets.iter().find(|t| t.class == row.class && short(t.target) == named);
            assert!(entry.unwrap().missed, "{row:?}");
        }
    }
    for t in e.targets.iter().filter(|t| t.missed) {
        assert!(t.attainable.is_some() && t.set_to.is_some() && !t.key.is_empty(), "{t:?}");
        assert!(!t.bound_by.is_empty(), "{t:?}");
        assert_eq!(t.price_percent, None);
    }
    let nominal = |target| {
        let own = |t: &&coaxdesign::control::explain::TargetReport| {
            t.target == target && t.class == ModelClass::Nominal
        };
        e.targets.iter().find(own).unwrap()
    };
    let drb = nominal(Target::Drb);
    assert_eq!((drb.asked, drb.key.as_str()), (1.3, "axis.roll.drb"));
    let best = drb.attainable.unwrap();
    assert!(best < 1.2, "{best}");
    // The off-nominal models were held at what they reach: they stay there.
    assert!(met(&changed(&|s| bandwidth(s, 0.99 * best))), "{best}");
    assert!(!met(&changed(&|s| bandwidth(s, 1.06 * best))), "{best}");
    // The phase margin stands against it.
    let phase = nominal(Target::PhaseMargin);
    if let Some(value) = phase.attainable {
        assert!(!phase.missed && value < 45.0);
        assert!(e.conflicting().contains(&Target::PhaseMargin));
        assert!(met(&changed(&|s| {
            bandwidth(s, 1.3);
            s.nominal.phase = (value - 0.2).to_radians();
        })));
    }
}

/// Gains that miss where others would do: the speed alone could meet everything,
/// and the key is what ties it to its neighbours, at a breakpoint the smoothing,
/// between two the breakpoints.
#[test]
fn a_miss_that_neighbours_cause_names_what_ties_them() {
    let spec = with(inner_only);
    let (nodes, all) = sets(&[0.0, 10.0]);
    let mut d = design(&spec, &nodes, &between(&nodes, &all), &[]).unwrap();
    let half = |k: usize| {
        let mut gains = d.table.points()[k].gains;
        let roll = &mut gains[Channel::Roll.index()];
        *roll = ChannelGains::new(roll.k_d, 0.5 * roll.k_p, 0.5 * roll.k_i);
        gains
    };
    d.table = d.table.with_gains(half);
    let at = |k: usize| {
        let set = ModelSet { models: all.models.clone(), plants: vec![all.plants[k].clone()] };
        explained(&spec, &set, &d, Channel::Roll)
    };
    for (k, remedy) in [
        (0, ["schedule.smoothing", "0.002"]),
        (1, ["schedule.speeds", "also \"5 kt\""]),
        (2, ["schedule.smoothing", "0.002"]),
    ] {
        let e = at(k);
        assert!(!e.met && e.attainable && e.breakpoint == (k != 1), "{e:?}");
        assert_eq!(e.remedy.unwrap(), remedy);
        let missed: Vec<_> = e.targets.iter().filter(|t| t.missed).collect();
        assert!(!missed.is_empty() && missed.iter().all(|t| t.attainable == Some(t.asked)));
    }
}

/// A design that is met is explained by the prices of its tuning, none of them
/// negative: there is no second set of prices.
#[test]
fn met_targets_have_the_prices_of_the_tuning() {
    let spec = with(inner_only);
    let (nodes, _) = sets(&[10.0]);
    let d = design(&spec, &nodes, &[], &[]).unwrap();
    assert!(d.tuning.prices.iter().all(|p| p.percent >= 0.0));
    for c in &spec.channels {
        let e = explained(&spec, &nodes, &d, c.channel);
        assert!(e.met && e.attainable, "{}", e.axis);
        for t in &e.targets {
            let own =
                d.tuning.prices.iter().find(|p| p.channel == c.channel && p.target == t.target);
            assert_eq!(t.price_percent, own.map(|p| p.percent), "{} {:?}", e.axis, t.target);
            assert_eq!(t.attainable, None);
        }
    }
}
