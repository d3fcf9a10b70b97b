//! Runs the exported law over the test vectors: `lookup` or `steps` on the
//! command line, lines of comma-separated numbers on standard input, answers on
//! standard output.

mod law_law;

use law_law::{Demand, Horizontal, Law, Measurement, Real, Trigonometry};
use std::io::BufRead;

struct Std;

impl Trigonometry for Std {
    fn sin_cos(angle: Real) -> (Real, Real) {
        angle.sin_cos()
    }

    fn atan(x: Real) -> Real {
        x.atan()
    }
}

fn show(numbers: &[Real]) {
    let texts: Vec<String> = numbers.iter().map(|x| format!("{x:?}")).collect();
    println!("{}", texts.join(","));
}

fn main() {
    let mode = std::env::args().nth(1).unwrap();
    let mut law = Law::new();
    for line in std::io::stdin().lock().lines().skip(1) {
        let x: Vec<Real> = line.unwrap().split(',').map(|t| t.parse().unwrap()).collect();
        if mode == "lookup" {
            let mut values = law_law::at(x[0]).to_vec();
            values.push(law_law::turn_blend(x[0]));
            show(&values);
            continue;
        }
        let m = Measurement {
            velocity_body: [x[1], x[2], x[3]],
            rates: [x[4], x[5], x[6]],
            roll: x[7],
            pitch: x[8],
            airspeed: x[9],
        };
        let demand = Demand {
            horizontal: if x[10] > 0.5 {
                Horizontal::Velocity { forward: x[11], right: x[12] }
            } else {
                Horizontal::Attitude { roll: x[11], pitch: x[12] }
            },
            heading_rate: x[13],
            vertical_velocity: x[14],
        };
        if mode == "engage" {
            // Switched on at what is flown, the law starts with these sticks.
            let given = [5.0, 4.0, 45.0, 3.0];
            let horizontal = Horizontal::Attitude { roll: m.roll, pitch: m.pitch };
            let stay = Demand { horizontal, heading_rate: 0.0, vertical_velocity: 0.0 };
            law.engage::<Std>(&m, &stay, given).unwrap();
            let sticks = law.step::<Std>(&m, &stay).unwrap();
            let off: Vec<Real> = (0..4).map(|j| sticks[j] - given[j]).collect();
            show(&off);
            continue;
        }
        show(&law.step::<Std>(&m, &demand).unwrap());
        let bad = Measurement { roll: Real::NAN, ..m };
        assert!(law.step::<Std>(&bad, &demand).is_err());
    }
}
