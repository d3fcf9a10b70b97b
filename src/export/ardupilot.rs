//! ArduPilot: parameters of one speed, and the tables in Lua.
//!
//! ArduPilot's helicopter runs cascades of its own, without model inversion.
//! The parameters make its roll, pitch, yaw and velocity loops answer errors
//! in their own axis as the law does at one speed: rates to attitude and PI
//! controllers from K_D, K_P, K_I and the diagonal of M, in ArduPilot's
//! normalised output, 1 for 100 %. Couplings, the F terms, the command models
//! and the trims are not in them; they are in the Lua tables, for a script.

use super::code::{self, Form, Language};
use super::text::{Flat, comment, fill, number};
use super::{ExportError, File, Input, Precision};
use crate::control::axis::{Axis, Channel};
use crate::law::diagram::Function;
use crate::law::{Kind, Wire};
use crate::units::KNOT;

const SCRIPT: &str = include_str!("templates/schedule.lua");

/// Stick travel of ArduPilot's output 1, %.
const FULL: f64 = 100.0;

/// Parameter file and script.
pub(super) fn files(input: &Input) -> Result<Vec<File>, ExportError> {
    let name = &input.options.name;
    Ok(vec![
        File::text(format!("{name}.param"), parameters(input)?),
        File::text(format!("{name}_schedule.lua"), script(input)),
    ])
}

/// Gains of a P controller on attitude in front of a PI controller on rate
/// that answer as K_D, K_P, K_I do: with D = `k_d`, a in front and P, I behind,
/// a P + I = K_P, a I = K_I, P = K_D.
///
/// The angle controller has the quicker of the two roots, so that I is the
/// smaller one. `None` where K_P² < 4 K_D K_I: no such pair exists.
pub fn cascade(k_d: f64, k_p: f64, k_i: f64) -> Option<[f64; 3]> {
    let root = k_p * k_p - 4.0 * k_d * k_i;
    if k_d <= 0.0 || k_p <= 0.0 || root < 0.0 {
        return None;
    }
    let angle = (k_p + root.sqrt()) / (2.0 * k_d);
    Some([angle, k_d, k_i / angle])
}

fn parameters(input: &Input) -> Result<String, ExportError> {
    let speed = input.options.speed;
    let p = input.law.at(speed);
    let gains = |c: Channel| p.gains[c.index()];
    let mut lines: Vec<(String, f64)> = Vec::new();
    let mut remarks = Vec::new();
    for axis in Axis::ALL {
        let g = gains(axis.into());
        let scale = p.inversion.allocation[(axis.effector().index(), axis.index())] / FULL;
        if axis != Axis::Heave && scale < 0.0 {
            remarks.push(format!(
                "{axis}: the stick acts the other way round; reverse its output in ArduPilot"
            ));
        }
        let scale = scale.abs();
        match axis {
            Axis::Roll | Axis::Pitch => {
                let key = if axis == Axis::Roll { "RLL" } else { "PIT" };
                let [angle, rate_p, rate_i] =
                    cascade(g.k_d, g.k_p, g.k_i).ok_or_else(|| ExportError::Format {
                        format: "ardupilot",
                        reason: format!(
                            "{axis} gains {:.4}, {:.4}, {:.4} at {:.1} kt have no cascade of a P \
                             and a PI controller (K_P^2 < 4 K_D K_I)",
                            g.k_d,
                            g.k_p,
                            g.k_i,
                            speed / KNOT
                        ),
                    })?;
                lines.push((format!("ATC_ANG_{key}_P"), angle));
                lines.push((format!("ATC_RAT_{key}_P"), rate_p * scale));
                lines.push((format!("ATC_RAT_{key}_I"), rate_i * scale));
                lines.push((format!("ATC_RAT_{key}_D"), 0.0));
            }
            Axis::Yaw => {
                lines.push(("ATC_RAT_YAW_P".into(), g.k_p * scale));
                lines.push(("ATC_RAT_YAW_I".into(), g.k_i * scale));
                lines.push(("ATC_RAT_YAW_D".into(), 0.0));
            }
            Axis::Heave => {
                lines.push(("PSC_VELZ_P".into(), g.k_p));
                lines.push(("PSC_VELZ_I".into(), g.k_i));
            }
        }
    }
    // ArduPilot has one controller for both directions.
    let velocity = velocity_gains(input)?;
    if let Some([k_p, k_i]) = velocity {
        lines.push(("PSC_VELXY_P".into(), k_p));
        lines.push(("PSC_VELXY_I".into(), k_i));
    }
    let mut head = input.description.banner();
    head.truncate(4 + input.description.warnings.len());
    head.push(format!(
        "One speed only: {:.1} kt true airspeed ({speed:?} m/s). Between speeds ArduPilot needs \
         the Lua tables.",
        speed / KNOT
    ));
    head.push(
        "The loops answer errors in their own axis as the law does; couplings, model inversion, \
         command models and trims are not in these parameters."
            .into(),
    );
    head.push(
        "Units: ATC_ANG 1/s; ATC_RAT P output per rad/s, I output per rad, output 1 for 100 % \
         stick; PSC_VELZ and PSC_VELXY P 1/s, I 1/s^2."
            .into(),
    );
    head.push(if velocity.is_some() {
        "PSC_VELXY is the smaller of the two directions' gains.".into()
    } else {
        "This law has no loops over velocity: PSC_VELXY is left as it is.".to_string()
    });
    head.extend(remarks);
    let mut text = comment(&head, "# ", 96);
    for (key, value) in lines {
        text += &format!("{key} {}\n", number(value, Precision::Float));
    }
    Ok(text)
}

/// Gains K_P and K_I of one controller for both horizontal velocities. `None`
/// where the law closes neither loop at any speed.
///
/// # Errors
/// A loop that the law has faded out at this speed: zero would not be its gain.
fn velocity_gains(input: &Input) -> Result<Option<[f64; 2]>, ExportError> {
    let at = |speed: f64| {
        let p = input.law.at(speed);
        let [x, y] = [Channel::Vx, Channel::Vy].map(|c| p.gains[c.index()]);
        [x.k_p.min(y.k_p), x.k_i.min(y.k_i)]
    };
    let found = at(input.options.speed);
    if found[0] > 0.0 {
        return Ok(Some(found));
    }
    let works: Vec<f64> =
        input.law.points().iter().map(|p| p.speed).filter(|v| at(*v)[0] > 0.0).collect();
    let (Some(first), Some(last)) = (works.first(), works.last()) else {
        return Ok(None);
    };
    Err(ExportError::Format {
        format: "ardupilot",
        reason: format!(
            "at {:.1} kt the law has faded out a loop over velocity, and PSC_VELXY_P would be 0; \
             speeds from {:.1} kt to {:.1} kt work",
            input.options.speed / KNOT,
            first / KNOT,
            last / KNOT
        ),
    })
}

struct Lua;

impl Language for Lua {
    fn number(&self, value: f64) -> String {
        number(value, Precision::Double)
    }
    fn constant(&self, name: &str) -> String {
        name.into()
    }
    fn entry(&self, place: usize) -> String {
        let (table, row, column, _) = code::cell(place);
        format!("v.{table}[{row}][{column}]")
    }
    fn input(&self, name: &str) -> String {
        name.into()
    }
    fn function(&self, f: Function, x: &str) -> String {
        match f {
            Function::Sine => format!("math.sin({x})"),
            Function::Cosine => format!("math.cos({x})"),
            Function::ArcTangent => format!("math.atan({x})"),
            Function::Absolute => format!("math.abs({x})"),
        }
    }
    fn select(&self, condition: &str, yes: &str, no: &str) -> String {
        format!("{condition} and {yes} or {no}")
    }
    fn limit(&self, x: &str, low: &str, high: &str) -> String {
        format!("math.min(math.max({x}, {low}), {high})")
    }
    fn above(&self, a: &str, b: &str) -> String {
        format!("{a} > {b}")
    }
    fn join(&self, all: bool, list: &[String]) -> String {
        list.join(if all { " and " } else { " or " })
    }
    fn not(&self, x: &str) -> String {
        format!("not {x}")
    }
    // A part without memory is all that the script runs.
    fn stored(&self, name: &str) -> String {
        format!("memory.{name}")
    }
    fn delayed(&self, name: &str) -> String {
        format!("lines.{name}[1]")
    }
    fn part(&self, name: &str, index: usize) -> String {
        format!("{name}[{}]", index + 1)
    }
}

/// The weight of turn coordination, from the law's own blocks.
fn turn_blend(input: &Input) -> String {
    let blend = super::diagram(input, false).only(&["turn_blend"]);
    let define = |name: &str, _: bool| format!("local {name} = ");
    let form = Form { indent: "    ", comment: ["-- ", ""], define: &define, end: "" };
    code::lines(&blend, &Lua, &form, &|w: Wire| !matches!(blend.block(w).kind, Kind::Input))
}

/// Numbers as a Lua string that `string.unpack("<f", ...)` reads.
fn packed(values: &[f64]) -> String {
    let mut text = String::new();
    for byte in values.iter().flat_map(|x| (*x as f32 + 0.0).to_le_bytes()) {
        text += &format!("\\x{byte:02x}");
    }
    text
}

fn script(input: &Input) -> String {
    let d = input.description;
    let flat = Flat::new(input);
    let names: Vec<(String, String)> = d
        .law_tables()
        .flat_map(|t| {
            t.rows.iter().enumerate().flat_map(move |(i, row)| {
                t.columns.iter().enumerate().map(move |(j, column)| {
                    (super::entry_name(&t.name, row, column), t.units[i][j].clone())
                })
            })
        })
        .collect();
    let forms: String = d
        .law_tables()
        .map(|t| format!("    \"{}:{}:{}\",\n", t.name, t.rows.join(" "), t.columns.join(" ")))
        .collect();
    let varies: Vec<bool> = (0..names.len())
        .map(|k| flat.values.iter().any(|v| v[k] as f32 != flat.values[0][k] as f32))
        .collect();
    let chosen = |values: &[f64], varying: bool| -> Vec<f64> {
        values.iter().zip(&varies).filter(|(_, v)| **v == varying).map(|(x, _)| *x).collect()
    };
    let kinds: String = varies.iter().map(|v| if *v { 'v' } else { 'c' }).collect();
    let fixed: String = chosen(&flat.values[0], false)
        .chunks(8)
        .map(|numbers| format!("    {}\\z\n", packed(numbers)))
        .collect();
    let mut listing = String::new();
    for (k, (name, unit)) in names.iter().enumerate() {
        let series: Vec<String> =
            flat.values.iter().map(|v| number(v[k], Precision::Float)).collect();
        let entry = format!("{name}, {unit}: {}", series.join(" "));
        listing += &comment(&[entry], "-- ", 96);
    }
    let data: String =
        flat.values.iter().map(|v| format!("    \"{}\",\n", packed(&chosen(v, true)))).collect();
    let blend = super::diagram(input, false).only(&["turn_blend"]);
    let mut constants = String::new();
    for (name, unit, meaning, value) in code::constants(&blend) {
        let value = number(value, Precision::Double);
        constants += &comment(&[format!("{meaning}, {unit}")], "    -- ", 96);
        constants += &format!("    local {name} = {value}\n");
    }
    fill(
        SCRIPT,
        &[
            ("BANNER", &comment(&d.banner(), "", 96).replace(']', ")")),
            ("MET", if d.requirements_met { "true" } else { "false" }),
            ("NAMES", &forms),
            ("KINDS", &kinds),
            ("FIXED", &fixed),
            ("POINTS", &flat.values.len().to_string()),
            ("SPEEDS", &packed(&d.speed.values)),
            ("LISTING", &listing),
            ("DATA", &data),
            ("CONSTANTS", &constants),
            ("TURN_BLEND", &turn_blend(input)),
            ("P", &input.options.name),
        ],
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The cascade's gains on error, its integral and the rate are the law's.
    #[test]
    fn cascade_is_equivalent() {
        let (k_d, k_p, k_i) = (2.1, 2.4, 0.5);
        let [a, p, i] = cascade(k_d, k_p, k_i).unwrap();
        assert!((p - k_d).abs() < 1e-15);
        assert!((a * p + i - k_p).abs() < 1e-14);
        assert!((a * i - k_i).abs() < 1e-14);
        assert!(i < a * p);
        assert_eq!(cascade(1.0, 1.0, 1.0), None);
        assert_eq!(cascade(0.0, 1.0, 0.0), None);
    }
}
