use coaxdesign::control::{design, models, spec, verify};
fn main() {
    let name = std::env::args().nth(1).unwrap_or("coax2d".into());
    let loaded = coaxdesign::problem::builtin_named(&name).unwrap();
    let mut s = spec::builtin().unwrap();
    if std::env::args().nth(2).as_deref() != Some("robust") {
        s.models.truncate(1);
    }
    let t = std::time::Instant::now();
    let set = models::build(&loaded.problem, &s.models, &s.speeds, &|| ()).unwrap();
    println!("left out {:?}", set.left_out);
    let set = set.set;
    println!("models {:.2} s", t.elapsed().as_secs_f64());
    for p in &set.plants {
        let q = &p[0];
        println!(
            "{:.1} theta {:.3} phi {:.4} sticks {:.2?} n {} B_lat p {:.4} B_lon q {:.4} col w {:.4} ped r {:.4}",
            q.speed,
            q.trim.pitch,
            q.trim.roll,
            q.trim.sticks,
            q.a.nrows(),
            q.reduced_b[(3, 0)],
            q.reduced_b[(4, 1)],
            q.reduced_b[(2, 2)],
            q.reduced_b[(5, 3)]
        );
    }
    let lags = design::lag_laws(&s, &set).unwrap();
    for l in &lags {
        println!("{} {:.1} {:?}", l.0, l.1, l.2);
    }
    let t = std::time::Instant::now();
    let d = match design::design(&s, &set, &[]) {
        Ok(d) => d,
        Err(e) => {
            println!("{e}");
            return;
        }
    };
    println!("tuning {:.2} s {:?}", t.elapsed().as_secs_f64(), d.tuning.stats);
    for (c, m) in &d.tuning.merits {
        println!("{c} total {:.4} activity {:.4} worst {:.4}", m.total, m.activity, m.worst());
    }
    let t = std::time::Instant::now();
    let v = verify::verify(&d.table, &set, &s.hardware, &s).unwrap();
    println!(
        "verify {:.2} s passed {} nominal {}",
        t.elapsed().as_secs_f64(),
        v.passed,
        v.nominal_passed
    );
    for r in &v.rows {
        if r.model == s.models[0].info.name || !r.passed {
            println!(
                "{:5.1} {:10} {:6} wc {:.2} pm {:.1} gu {:.1} gd {:.1} drb {:.3} drp {:.2} J {:.2} dm {:.0} {} {} {:?}",
                r.speed_m_s,
                r.model,
                r.axis,
                r.crossover_rad_s.unwrap_or(0.0),
                r.pm_deg.unwrap_or(180.0),
                r.gm_up_db.unwrap_or(99.),
                r.gm_down_db.unwrap_or(99.),
                r.drb_rad_s.unwrap_or(99.),
                r.drp_db,
                r.activity,
                r.design_margin_percent.unwrap_or(0.0),
                r.binding.clone().unwrap_or_default(),
                r.passed,
                d.table.at(r.speed_m_s).gains[coaxdesign::control::axis::Channel::ALL
                    .iter()
                    .position(|c| c.name() == r.axis)
                    .unwrap()]
            );
        }
    }
    for s in &v.stability {
        if !s.passed || s.model == "nominal" {
            println!(
                "{:.1} {} {} {:.2e} damping {:?} {:.1e} {}",
                s.speed_m_s,
                s.model,
                s.outer_loops,
                s.growth_per_s,
                s.least_damping,
                s.pade_change_per_s,
                s.passed
            );
        }
    }
}
