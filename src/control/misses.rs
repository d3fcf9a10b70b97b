//! What a design misses, row by row of its verification: how far, where worst,
//! and the key of the specification that asks for it.

use super::axis::Channel;
use super::plant::ModelClass;
use super::verify::Verification;

/// A requirement that an axis misses in some rows of one class of models.
#[derive(Debug, Clone, PartialEq)]
pub struct Miss {
    /// The axis or outer loop.
    pub axis: String,
    /// The requirement, as in the rows.
    pub requirement: String,
    /// Nominal or off-nominal models.
    pub class: ModelClass,
    /// Rows that miss it, and rows of this axis and class.
    pub rows: [usize; 2],
    /// Airspeed of the worst row, m/s.
    pub speed: f64,
    /// Model of the worst row.
    pub model: String,
    /// Whether the worst row stands at a breakpoint of the schedule.
    pub breakpoint: bool,
    /// What these gains reach there, in the unit of the row: what the key may
    /// ask for so that they meet it everywhere.
    pub reached: f64,
    /// What is asked.
    pub asked: f64,
    /// Key of the specification that asks.
    pub key: String,
    /// For a key that is a factor on another: by how much to multiply it.
    pub factor: Option<f64>,
}

/// Everything that a verification found missed: worst first, each requirement
/// of an axis once a class.
#[must_use]
pub fn misses(verification: &Verification) -> Vec<Miss> {
    let mut out: Vec<(f64, Miss)> = Vec::new();
    for row in &verification.rows {
        for missed in &row.missed {
            let short = (missed.value - missed.bound).abs() / missed.bound.abs().max(1e-9);
            let known = out.iter_mut().find(|(_, m)| {
                m.axis == row.axis && m.class == row.class && m.requirement == missed.requirement
            });
            let (key, factor) = key(&row.axis, &missed.requirement, row.class);
            let miss = |rows| Miss {
                axis: row.axis.clone(),
                requirement: missed.requirement.clone(),
                class: row.class,
                rows,
                speed: row.speed_m_s,
                model: row.model.clone(),
                breakpoint: row.breakpoint,
                reached: missed.value,
                asked: missed.bound,
                key: key.clone(),
                factor: factor.then(|| {
                    let ratio = missed.value / missed.bound;
                    if missed.requirement == "crossover_max_rad_s" { 1.0 / ratio } else { ratio }
                }),
            };
            match known {
                Some((worst, entry)) => {
                    entry.rows[0] += 1;
                    if short > *worst {
                        *worst = short;
                        *entry = miss(entry.rows);
                    }
                }
                None => {
                    let of = verification
                        .rows
                        .iter()
                        .filter(|r| r.axis == row.axis && r.class == row.class)
                        .count();
                    out.push((short, miss([1, of])));
                }
            }
        }
    }
    out.sort_by(|a, b| b.0.total_cmp(&a.0));
    out.into_iter().map(|(_, miss)| miss).collect()
}

/// The key that asks for a requirement of an axis, and whether it is a factor.
pub(super) fn key(axis: &str, requirement: &str, class: ModelClass) -> (String, bool) {
    let outer = Channel::ALL.iter().any(|c| c.name() == axis && c.is_outer());
    let own = if outer { "outer" } else { "axis" };
    let set = if class == ModelClass::Nominal { "nominal" } else { "off_nominal" };
    let nominal = class == ModelClass::Nominal;
    match requirement {
        "gm_up_db" | "gm_down_db" => (format!("margins.{set}.gain_margin_db"), false),
        "pm_deg" => (format!("margins.{set}.phase_margin"), false),
        "drb_rad_s" if nominal => (format!("{own}.{axis}.drb"), false),
        "drb_rad_s" => (format!("margins.{set}.drb_scale"), true),
        "drp_db" if nominal => (format!("{own}.{axis}.drp_db"), false),
        "drp_db" => (format!("margins.{set}.drp_extra_db"), false),
        "crossover_min_rad_s" if nominal => (format!("{own}.{axis}.crossover_min"), false),
        "crossover_max_rad_s" if nominal => (format!("{own}.{axis}.crossover_max"), false),
        "crossover_min_rad_s" | "crossover_max_rad_s" => {
            (format!("margins.{set}.crossover_scale"), true)
        }
        _ => (format!("{own}.{axis}"), false),
    }
}

#[cfg(test)]
mod tests {
    use super::super::verify::{Missed, Row, SCHEMA};
    use super::*;

    fn row(axis: &str, speed: f64, class: ModelClass, missed: &[(&str, f64, f64)]) -> Row {
        Row {
            axis: axis.into(),
            speed_m_s: speed,
            breakpoint: true,
            model: format!("{class:?}"),
            class,
            drb_rad_s: None,
            drp_db: 0.0,
            crossover_rad_s: None,
            gm_up_db: None,
            gm_down_db: None,
            pm_deg: None,
            disk_margin: 1.0,
            activity: 1.0,
            bandwidth_rad_s: None,
            phase_delay_s: None,
            design_margin_percent: None,
            binding: None,
            passed: missed.is_empty(),
            missed: missed
                .iter()
                .map(|(requirement, value, bound)| Missed {
                    requirement: (*requirement).into(),
                    value: *value,
                    bound: *bound,
                })
                .collect(),
        }
    }

    /// Every missed row is in exactly one entry, the worst stands for it, and
    /// the key exists in the format.
    #[test]
    fn every_missed_row_is_counted_once() {
        use ModelClass::{Nominal, OffNominal};
        let rows = vec![
            row("roll", 0.0, Nominal, &[("pm_deg", 44.0, 45.0)]),
            row("roll", 10.0, Nominal, &[("pm_deg", 40.0, 45.0), ("drb_rad_s", 0.8, 0.9)]),
            row("roll", 20.0, Nominal, &[]),
            row("roll", 0.0, OffNominal, &[("pm_deg", 29.0, 30.0)]),
            row("vx", 0.0, OffNominal, &[("drb_rad_s", 0.05, 0.1)]),
        ];
        let verification = Verification {
            schema: SCHEMA.into(),
            passed: false,
            nominal_passed: false,
            columns: Vec::new(),
            rows,
            stability: Vec::new(),
            not_required: Vec::new(),
        };
        let found = misses(&verification);
        let counted: usize = found.iter().map(|m| m.rows[0]).sum();
        assert_eq!(counted, 5);
        assert_eq!(found[0].axis, "vx");
        assert_eq!(found[0].key, "margins.off_nominal.drb_scale");
        assert!((found[0].factor.unwrap() - 0.5).abs() < 1e-12);
        let phase = found.iter().find(|m| m.requirement == "pm_deg" && m.class == Nominal).unwrap();
        assert_eq!(phase.rows, [2, 3]);
        assert_eq!((phase.speed, phase.reached, phase.asked), (10.0, 40.0, 45.0));
        assert_eq!(phase.key, "margins.nominal.phase_margin");
        for miss in &found {
            let mut table = &super::super::spec::ROOT;
            let parts: Vec<&str> = miss.key.split('.').collect();
            for (depth, part) in parts.iter().enumerate() {
                let key = table.key(part).unwrap_or_else(|| panic!("no key {}", miss.key));
                if depth + 1 < parts.len() {
                    let crate::problem::keys::Value::Table(below) = &key.value else {
                        panic!("{} is no table", miss.key)
                    };
                    table = below;
                }
            }
        }
    }
}
