//! Trim beside print: Table 2, and what Figs. 13 and 14 say in words.

use super::{claim_table, verdict};
use crate::cli::CliError;
use crate::cli::trim::trim_all;
use coaxdesign::problem::Problem;
use coaxdesign::report::table::{Cell, Column, Digits, Table};
use coaxdesign::studies::coax2d::claims;
use coaxdesign::studies::coax2d::table2::{HOVER_OFF, HOVER_ON};
use coaxdesign::trim::{FlightCondition, TrimPoint};
use coaxdesign::units::{HORSEPOWER, KNOT, POUND_FORCE};

/// Table 2 beside ours.
pub(super) fn hover(problem: &Problem) -> Result<String, CliError> {
    let sweeps = trim_all(problem, &[FlightCondition::level(0.0)], &[true, false], true)?;
    let mut table = Table::new(
        "",
        vec![
            Column::text("interactions"),
            Column::text("rotor"),
            Column::text("quantity"),
            Column::number("paper", "", Digits::Significant(4)),
            Column::number("ours", "", Digits::Significant(4)),
            Column::number("ratio", "", Digits::Decimals(3)),
            Column::number("tolerance", "%", Digits::Decimals(1)),
            Column::text("within"),
        ],
    );
    for point in sweeps.iter().flatten() {
        let reference = if point.interactions { HOVER_ON } else { HOVER_OFF };
        // What is asked of the closest reproduction, %: thrust, power, inflow.
        let (thrust, power) = if point.interactions { (2.0, 2.5) } else { (0.5, 3.0) };
        for ((rotor, mean), theirs) in problem.rotors.iter().zip(&point.rotors).zip(&reference) {
            let blown = point.interactions && rotor.name == "lower";
            for (quantity, printed, ours, rounding, tolerance) in [
                ("T, lbf", theirs.thrust / POUND_FORCE, mean.thrust / POUND_FORCE, 0.05, thrust),
                ("P, hp", theirs.power / HORSEPOWER, mean.power / HORSEPOWER, 0.005, power),
                ("λ0", theirs.inflow, mean.inflow[0], 5e-4, if blown { 4.0 } else { 2.0 }),
                ("λs0", theirs.self_inflow, mean.self_inflow[0], 5e-4, 2.0),
                ("C_T", theirs.thrust_coefficient, mean.thrust_coefficient, 5e-6, thrust),
                ("C_P", theirs.power_coefficient, mean.power_coefficient, 5e-6, power),
            ] {
                // Coefficients are printed with two or three digits.
                let coefficient = quantity.starts_with("C_");
                let rounded = if coefficient { 100.0 * rounding / printed } else { 0.0 };
                let tolerance = tolerance + rounded;
                table.row([
                    Cell::from(if point.interactions { "on" } else { "off" }),
                    Cell::from(rotor.name.as_str()),
                    Cell::from(quantity),
                    Cell::from(printed),
                    Cell::from(ours),
                    Cell::from(ours / printed),
                    Cell::from(tolerance),
                    Cell::from(verdict((100.0 * (ours / printed - 1.0)).abs() <= tolerance)),
                ]);
            }
        }
    }
    Ok(format!("### Hover, Table 2\n\n{}\n", table.to_markdown()))
}

/// Trim over speed: what the figures of the paper say in words.
pub(super) fn trends(problem: &Problem) -> Result<String, CliError> {
    let conditions: Vec<FlightCondition> =
        (0..19).map(|k| FlightCondition::level(5.0 * f64::from(k) * KNOT)).collect();
    let sweeps = trim_all(problem, &conditions, &[true, false], true)?;
    let mut table = Table::new(
        "",
        vec![
            Column::number("speed", "kt", Digits::Decimals(0)),
            Column::number("roll on", "deg", Digits::Decimals(3)),
            Column::number("roll off", "deg", Digits::Decimals(3)),
            Column::number("pitch on", "deg", Digits::Decimals(2)),
            Column::number("pitch off", "deg", Digits::Decimals(2)),
            Column::number("collective on/off", "", Digits::Decimals(3)),
            Column::number("pedal on", "%", Digits::Decimals(2)),
            Column::number("pedal off", "%", Digits::Decimals(2)),
            Column::number("power on/off", "", Digits::Decimals(3)),
            Column::number("energy imbalance on", "", Digits::Significant(2)),
            Column::text("status"),
        ],
    );
    let degrees = |point: &TrimPoint, k: usize| point.mean_state[k].to_degrees();
    for (on, off) in sweeps[0].iter().zip(&sweeps[1]) {
        table.row([
            Cell::from(on.condition.airspeed / KNOT),
            Cell::from(degrees(on, 6)),
            Cell::from(degrees(off, 6)),
            Cell::from(degrees(on, 7)),
            Cell::from(degrees(off, 7)),
            Cell::from(on.sticks[2] / off.sticks[2]),
            Cell::from(on.sticks[3]),
            Cell::from(off.sticks[3]),
            Cell::from(on.power.shaft / off.power.shaft),
            Cell::from(on.power.imbalance()),
            Cell::from(format!("{}, {}", on.status.word(), off.status.word())),
        ]);
    }
    let claims = claims::trim_claims(&sweeps[0], &sweeps[1]);
    Ok(format!(
        "### Trim over speed\n\n{}\nWhat the paper says of it in words:\n\n{}\n",
        table.to_markdown(),
        claim_table(&claims)
    ))
}
