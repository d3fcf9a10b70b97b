//! Writes models and what this library finds of them as JSON, to be checked
//! by an independent implementation: see `tests/crosscheck/linear.py`.
//!
//! With a path as argument, also writes the hover model of the appendix there
//! as a MAT file.

use coaxdesign::linear::dense::eigenvalues;
use coaxdesign::linear::frequency::{frequency_response, log_grid};
use coaxdesign::linear::io::{ModelRecord, to_json, to_mat};
use coaxdesign::linear::reduction::{
    BalancedOptions, Method, balanced, hankel_singular_values, residualise,
};
use coaxdesign::linear::structure::zeros;
use coaxdesign::linear::{Channel, LinearError, StateSpace};
use coaxdesign::studies::coax2d::appendix::{Condition, appendix};
use coaxdesign::units::{KNOT, Kind, System};
use nalgebra::{Complex, DMatrix};
use serde_json::{Value, json};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    if let Some(path) = std::env::args_os().nth(1) {
        let record = ModelRecord {
            speed: 0.0,
            interactions: Some(true),
            model: appendix(Condition::Hover)?,
            trim: None,
        };
        std::fs::write(path, to_mat(&record, System::Us))?;
    }
    let forward = appendix(Condition::Forward)?;
    let mut cases = vec![
        case(
            "appendix, hover",
            &appendix(Condition::Hover)?,
            0.0,
            &["u", "v", "p", "q", "phi", "theta"],
        )?,
        case("appendix, forward", &forward, 70.0 * KNOT, &["u", "v", "p", "r", "phi", "theta"])?,
        case("random stable, 20 states", &random(20, 1, 3, 4)?, 0.0, &["x0", "x5", "x11"])?,
        case("random stable, 9 states", &random(9, 6, 2, 2)?, 0.0, &["x1", "x2", "x3", "x8"])?,
        case("wide scaling, 12 states", &badly_scaled(12)?, 0.0, &["x0", "x1", "x2"])?,
    ];
    cases.sort_by_key(|c| c["name"].as_str().map(str::to_owned));
    println!("{}", serde_json::to_string(&cases)?);
    Ok(())
}

fn case(
    name: &str,
    model: &StateSpace,
    speed: f64,
    keep: &[&str],
) -> Result<Value, Box<dyn std::error::Error>> {
    let record = ModelRecord { speed, interactions: Some(true), model: model.clone(), trim: None };
    let omega = log_grid(0.05, 50.0, 60)?;
    let response = frequency_response(model, &omega)?;
    let reduced = residualise(model, keep)?.model;
    let values = eigenvalues(model.a())?;
    let stable = values.iter().all(|z| z.re < 0.0);
    let options = BalancedOptions::default();
    let mut reductions = Vec::new();
    if stable {
        let n = model.states().len();
        for (method, order) in
            [(Method::BalancedTruncate, n / 2), (Method::BalancedResidualise, n / 2)]
        {
            let r = balanced(model, order, method, &options)?;
            reductions.push(json!({
                "method": method.name(),
                "order": order,
                "response": responses(&frequency_response(&r.model, &omega)?.values),
            }));
        }
    }
    // A square corner of the model, whose zeros are finite in number.
    let size = model.inputs().len().min(model.outputs().len());
    let outputs: Vec<&str> = model.outputs()[..size].iter().map(|c| c.name.as_str()).collect();
    let inputs: Vec<&str> = model.inputs()[..size].iter().map(|c| c.name.as_str()).collect();
    let square = model.select_outputs(&outputs)?.select_inputs(&inputs)?;
    Ok(json!({
        "name": name,
        // SI, so that no conversion comes between the two programs.
        "model": serde_json::from_str::<Value>(&to_json(&record, System::Si))?,
        "eigenvalues": complex(&values),
        "omega": omega,
        "response": responses(&response.values),
        "keep": keep,
        "residualised": {
            "a": rows(reduced.a()), "b": rows(reduced.b()),
            "c": rows(reduced.c()), "d": rows(reduced.d()),
        },
        "stable": stable,
        "hankel": if stable { hankel_singular_values(model, &options)? } else { Vec::new() },
        "balanced": reductions,
        "zeros_size": size,
        "zeros": complex(&zeros(&square)?),
    }))
}

fn complex(values: &[Complex<f64>]) -> Vec<[f64; 2]> {
    values.iter().map(|z| [z.re, z.im]).collect()
}

fn rows(m: &DMatrix<f64>) -> Vec<Vec<f64>> {
    m.row_iter().map(|r| r.iter().copied().collect()).collect()
}

/// frequency, output, input, (re, im)
fn responses(values: &[DMatrix<Complex<f64>>]) -> Vec<Vec<Vec<[f64; 2]>>> {
    values
        .iter()
        .map(|g| g.row_iter().map(|r| r.iter().map(|z| [z.re, z.im]).collect()).collect())
        .collect()
}

fn channels(prefix: &str, n: usize) -> Vec<Channel> {
    (0..n).map(|i| Channel::new(format!("{prefix}{i}"), Kind::Dimensionless)).collect()
}

fn random(n: usize, seed: u64, m: usize, p: usize) -> Result<StateSpace, LinearError> {
    let mut state = seed;
    // Weyl sequence through a 64-bit mixer: reproducible everywhere.
    let mut next = || {
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64 * 2.0 - 1.0
    };
    let mut matrix = |r: usize, c: usize| DMatrix::from_fn(r, c, |_, _| next());
    let a = matrix(n, n) * 3.0;
    let worst = eigenvalues(&a)?.iter().map(|z| z.re).fold(f64::MIN, f64::max);
    StateSpace::new(
        channels("x", n),
        channels("u", m),
        channels("y", p),
        a - DMatrix::identity(n, n) * (worst + 0.3),
        matrix(n, m),
        matrix(p, n),
        matrix(p, m),
    )
}

/// A random model in units that spread over six decades.
fn badly_scaled(n: usize) -> Result<StateSpace, LinearError> {
    let model = random(n, 42, 2, 2)?;
    let scale = |i: usize| 10f64.powf(6.0 * i as f64 / (n - 1) as f64 - 3.0);
    let t = DMatrix::from_fn(n, n, |i, j| if i == j { scale(i) } else { 0.0 });
    model.transform(&t, model.states().to_vec())
}
