//! The whole law as a JSBSim system.
//!
//! One `fcs_function` a quantity, in the order of the law: JSBSim runs them one
//! after the other once a frame, and a function that names its own property
//! reads the last frame's value. Numbers that are the same at every breakpoint
//! are written where they are used, the others are tables over airspeed.
//! SI units and radians, as everywhere in the law; the properties' names say so.

use std::fmt::Write as _;

use super::description::Table;
use super::text::{comment, number};
use super::{File, Input, Precision, delay_steps};

/// Inputs: name, initial value, meaning.
const INPUTS: [(&str, f64, &str); 15] = [
    ("u-m_sec", 0.0, "velocity over the ground, body axes, forward"),
    ("v-m_sec", 0.0, "to the right"),
    ("w-m_sec", 0.0, "down"),
    ("p-rad_sec", 0.0, "roll rate"),
    ("q-rad_sec", 0.0, "pitch rate"),
    ("r-rad_sec", 0.0, "yaw rate"),
    ("phi-rad", 0.0, "bank angle"),
    ("theta-rad", 0.0, "pitch angle"),
    ("airspeed-m_sec", 0.0, "forward component of the true airspeed in heading axes"),
    ("velocity-mode", 0.0, "1: commands are velocities; 0: attitudes"),
    ("command-1", 0.0, "bank, rad; or velocity forward, m/s"),
    ("command-2", 0.0, "pitch, rad; or velocity to the right, m/s"),
    ("heading-rate-rad_sec", 0.0, "demanded"),
    ("v-z-m_sec", 0.0, "demanded vertical velocity, down positive"),
    ("reset", 0.0, "while 1, the law starts anew in every frame"),
];

/// An expression: text of a function's operand.
type X = String;

fn op(name: &str, operands: &[X]) -> X {
    format!("<{name}>{}</{name}>", operands.concat())
}

fn v(value: f64) -> X {
    format!("<v>{}</v>", number(value, Precision::Double))
}

fn sum(operands: &[X]) -> X {
    match operands {
        [] => v(0.0),
        [one] => one.clone(),
        many => op("sum", many),
    }
}

fn product(operands: &[X]) -> X {
    op("product", operands)
}

fn minus(a: X, b: X) -> X {
    op("difference", &[a, b])
}

fn over(a: X, b: X) -> X {
    op("quotient", &[a, b])
}

fn pick(condition: X, yes: X, no: X) -> X {
    op("ifthen", &[condition, yes, no])
}

fn above(a: X, b: X) -> X {
    op("gt", &[a, b])
}

fn below(a: X, b: X) -> X {
    op("lt", &[a, b])
}

fn both(a: X, b: X) -> X {
    op("and", &[a, b])
}

fn held(x: X, low: f64, high: f64) -> X {
    op("min", &[op("max", &[x, v(low)]), v(high)])
}

/// The system as it is written.
struct Writer<'a> {
    input: &'a Input<'a>,
    declared: String,
    channel: String,
}

impl Writer<'_> {
    fn name(&self, property: &str) -> String {
        format!("{}/{property}", self.input.options.name)
    }

    /// A property as an operand.
    fn p(&self, property: &str) -> X {
        format!("<p>{}</p>", self.name(property))
    }

    fn declare(&mut self, property: &str, value: f64, meaning: &str) {
        let name = self.name(property);
        let value = number(value, Precision::Double);
        let meaning =
            if meaning.is_empty() { String::new() } else { format!(" <!-- {meaning} -->") };
        // Writing to a String cannot fail.
        let _ = writeln!(self.declared, "  <property value=\"{value}\">{name}</property>{meaning}");
    }

    /// A quantity, and itself as an operand for what follows.
    fn set(&mut self, property: &str, expression: &X) -> X {
        self.declare(property, 0.0, "");
        let _ = writeln!(
            self.channel,
            "    <fcs_function name=\"{}\">\n      <function>{expression}</function>\n    \
             </fcs_function>",
            self.name(property)
        );
        self.p(property)
    }

    fn section(&mut self, text: &str) {
        let _ = writeln!(self.channel, "\n    <!-- {text} -->");
    }

    /// An entry of a table as an operand; `None` if it is zero at every
    /// breakpoint.
    fn entry(&self, table: &str, row: usize, column: usize) -> Option<X> {
        let t = self.input.description.tables.iter().find(|t| t.name == table)?;
        let first = t.values[0][row][column];
        if t.values.iter().any(|m| m[row][column] != first) {
            return Some(self.p(&entry_property(t, row, column)));
        }
        (first != 0.0).then(|| v(first))
    }

    fn value(&self, table: &str, row: usize, column: usize) -> X {
        self.entry(table, row, column).unwrap_or_else(|| v(0.0))
    }

    /// Products of a row of a table with operands.
    fn terms(&self, table: &str, row: usize, x: &[X]) -> Vec<X> {
        x.iter()
            .enumerate()
            .filter_map(|(j, x)| Some(product(&[self.entry(table, row, j)?, x.clone()])))
            .collect()
    }
}

fn entry_property(t: &Table, row: usize, column: usize) -> String {
    if t.columns[column] == "value" {
        format!("at/{}/{}", t.name, t.rows[row])
    } else {
        format!("at/{}/{}/{}", t.name, t.rows[row], t.columns[column])
    }
}

/// The system.
pub(super) fn files(input: &Input) -> Vec<File> {
    let mut w = Writer { input, declared: String::new(), channel: String::new() };
    for (name, value, meaning) in INPUTS {
        w.declare(&format!("in/{name}"), value, meaning);
    }
    law(&mut w);
    let o = input.options;
    let text = format!(
        "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<!--\n{}\nThe frame time of the simulation \
         must be {} s. Inputs are {}/in/..., outputs {}/sticks/..., percent.\n-->\n\
         <system name=\"{}_law\">\n{}\n  <channel name=\"{} law\">\n{}  </channel>\n</system>\n",
        escape(&comment(&input.description.banner(), "  ", 96)),
        number(o.step, Precision::Double),
        o.name,
        o.name,
        o.name,
        w.declared,
        o.name,
        w.channel
    );
    vec![File::text(format!("{}_law.xml", o.name), text)]
}

fn escape(text: &str) -> String {
    text.replace('&', "and").replace('<', "(").replace('>', ")")
}

/// Tables over airspeed.
fn tables(w: &mut Writer) {
    w.section("tables over true airspeed, linear between breakpoints, constant beyond");
    let d = w.input.description;
    for t in d.law_tables() {
        for row in 0..t.rows.len() {
            for column in 0..t.columns.len() {
                let first = t.values[0][row][column];
                if t.values.iter().all(|m| m[row][column] == first) {
                    continue;
                }
                let mut data = String::new();
                for (speed, m) in d.speed.values.iter().zip(&t.values) {
                    let _ = write!(
                        data,
                        "\n        {}  {}",
                        number(*speed, Precision::Double),
                        number(m[row][column], Precision::Double)
                    );
                }
                let table = format!(
                    "<table><independentVar lookup=\"row\">{}</independentVar><tableData>{data}\n\
                     \x20     </tableData></table>",
                    w.name("schedule-m_sec")
                );
                w.set(&entry_property(t, row, column), &table);
            }
        }
    }
}

fn law(w: &mut Writer) {
    let settings = w.input.schedule.law;
    let constant = |name: &str| {
        w.input.description.constants.iter().find(|c| c.name == name).map_or(0.0, |c| c.value)
    };
    let (gravity, limit) = (constant("gravity"), constant("attitude_limit"));
    let (slowness, acceleration_limit) =
        (constant("outer_slowness"), constant("acceleration_limit"));
    let (lead_limit, forgetting) = (constant("schedule_lead"), constant("forgetting"));
    let (yaw_lead, slow) = (constant("yaw_lead"), constant("slow"));
    let pedal_yaw = constant("pedal_yaw_growth");
    let powers = [constant("pedal_power_min"), constant("pedal_power_max")];
    let (turn, width) =
        (w.input.schedule.turn_coordination_speed, w.input.schedule.turn_coordination_width);
    let limits = w.input.schedule.stick_limits;
    let delay = delay_steps(w.input);
    let dt = || v(w_step(w.input));
    let input = |w: &Writer, name: &str| w.p(&format!("in/{name}"));

    w.section("kinematics");
    let (phi, theta) = (input(w, "phi-rad"), input(w, "theta-rad"));
    let sp = w.set("kinematics/sin-phi", &op("sin", std::slice::from_ref(&phi)));
    let cp = w.set("kinematics/cos-phi", &op("cos", std::slice::from_ref(&phi)));
    let st = w.set("kinematics/sin-theta", &op("sin", std::slice::from_ref(&theta)));
    let ct = w.set("kinematics/cos-theta", &op("cos", std::slice::from_ref(&theta)));
    let velocity = ["u-m_sec", "v-m_sec", "w-m_sec"].map(|n| input(w, n));
    let rates = ["p-rad_sec", "q-rad_sec", "r-rad_sec"].map(|n| input(w, n));
    let [u, vv, ww] = velocity.clone();
    let level = w.set(
        "kinematics/level-m_sec",
        &sum(&[product(&[vv.clone(), sp.clone()]), product(&[ww.clone(), cp.clone()])]),
    );
    let vertical = w.set(
        "kinematics/v-z-m_sec",
        &minus(product(&[level.clone(), ct.clone()]), product(&[u.clone(), st.clone()])),
    );
    let forward = w.set(
        "kinematics/v-x-m_sec",
        &sum(&[product(&[u.clone(), ct.clone()]), product(&[level, st.clone()])]),
    );
    let right = w.set(
        "kinematics/v-y-m_sec",
        &minus(product(&[vv, cp.clone()]), product(&[ww, sp.clone()])),
    );
    let turning = w.set(
        "kinematics/turning-rad_sec",
        &sum(&[product(&[rates[1].clone(), sp.clone()]), product(&[rates[2].clone(), cp.clone()])]),
    );
    let phi_dot = w.set(
        "kinematics/phi-dot-rad_sec",
        &sum(&[rates[0].clone(), product(&[over(st.clone(), ct.clone()), turning])]),
    );
    let theta_dot = w.set(
        "kinematics/theta-dot-rad_sec",
        &minus(product(&[rates[1].clone(), cp.clone()]), product(&[rates[2].clone(), sp.clone()])),
    );

    // Through the air as far as it is known: the forward airspeed is.
    let wind = w.set("kinematics/wind-m_sec", &minus(input(w, "airspeed-m_sec"), forward.clone()));
    let along =
        [ct.clone(), product(&[st.clone(), sp.clone()]), product(&[st.clone(), cp.clone()])];
    let mut air = Vec::new();
    for (k, name) in ["u", "v", "w"].iter().enumerate() {
        let x = sum(&[velocity[k].clone(), product(&[wind.clone(), along[k].clone()])]);
        air.push(w.set(&format!("air/{name}-m_sec"), &x));
    }
    let turn_now = over(
        sum(&[product(&[rates[1].clone(), sp.clone()]), product(&[rates[2].clone(), cp.clone()])]),
        ct.clone(),
    );

    w.section("memory of the last frame, or the start from what is measured");
    let started = w.p("started");
    let reset = input(w, "reset");
    let fresh = w.set("fresh", &op("or", &[above(reset, v(0.5)), below(started, v(0.5))]));
    w.set("started", &v(1.0));
    let in_velocity = above(input(w, "velocity-mode"), v(0.5));
    let was = above(w.p("velocity-mode-before"), v(0.5));
    // References of velocity begin anew with the velocity mode.
    let entered =
        w.set("entered", &op("or", &[fresh.clone(), both(in_velocity.clone(), op("not", &[was]))]));
    w.set("velocity-mode-before", &pick(in_velocity.clone(), v(1.0), v(0.0)));
    let measured = [
        phi.clone(),
        theta.clone(),
        rates[2].clone(),
        vertical.clone(),
        forward.clone(),
        right.clone(),
    ];
    let names = ["phi", "theta", "r", "v-z"];
    let velocities = ["v-x", "v-y"];
    let anew = |name: &str| {
        if name.starts_with("v-x") || name.starts_with("v-y") {
            entered.clone()
        } else {
            fresh.clone()
        }
    };
    let mut last = Vec::new();
    for (name, m) in names.iter().chain(&velocities).zip(&measured) {
        let old = w.p(&format!("reference/{name}"));
        let x = pick(anew(name), m.clone(), old);
        last.push(w.set(&format!("last/reference-{name}"), &x));
    }
    let mut last_rate = Vec::new();
    for name in names[..2].iter().chain(&velocities) {
        let old = w.p(&format!("reference/{name}-rate"));
        let x = pick(anew(name), v(0.0), old);
        last_rate.push(w.set(&format!("last/reference-{name}-rate"), &x));
    }
    let mut last_command = Vec::new();
    for (k, name) in velocities.iter().enumerate() {
        let old = w.p(&format!("command/{name}"));
        let x = pick(entered.clone(), measured[4 + k].clone(), old);
        last_command.push(w.set(&format!("last/command-{name}"), &x));
    }
    let old = w.p("turn/rate");
    let last_turn = w.set("last/turn", &pick(fresh.clone(), turn_now, old));
    let old = w.p("turn/rate-rate");
    let last_turn_rate = w.set("last/turn-rate", &pick(fresh.clone(), v(0.0), old));
    let mut integral = Vec::new();
    for name in names {
        let old = w.p(&format!("integral/{name}"));
        integral.push(w.set(&format!("last/integral-{name}"), &pick(fresh.clone(), v(0.0), old)));
    }
    let mut velocity_integral = Vec::new();
    for name in ["v-x", "v-y"] {
        let old = w.p(&format!("integral/{name}"));
        velocity_integral
            .push(w.set(&format!("last/integral-{name}"), &pick(entered.clone(), v(0.0), old)));
    }
    w.section("references of the past: from the oldest on, each takes the next one's last value");
    let mut lines: Vec<(String, X, X)> = Vec::new();
    for (k, name) in names.iter().chain(&velocities).enumerate() {
        lines.push(((*name).into(), measured[k].clone(), last[k].clone()));
    }
    for (k, name) in names.iter().take(2).enumerate() {
        lines.push((format!("{name}-rate"), v(0.0), last_rate[k].clone()));
    }
    let mut past = Vec::new();
    for (name, start, last) in lines {
        for k in (2..=delay).rev() {
            let next = w.p(&format!("delay/{name}-{}", k - 1));
            w.set(&format!("delay/{name}-{k}"), &pick(anew(&name), start.clone(), next));
        }
        if delay > 0 {
            w.set(&format!("delay/{name}-1"), &sum(std::slice::from_ref(&last)));
            past.push(w.p(&format!("delay/{name}-{delay}")));
        } else {
            // Without a delay the velocity errors see the last reference.
            past.push(last);
        }
    }
    let due = past[4..6].to_vec();

    w.section("speed of the schedule");
    let lead = pick(
        in_velocity.clone(),
        held(minus(due[0].clone(), forward.clone()), -lead_limit, lead_limit),
        v(0.0),
    );
    let airspeed = input(w, "airspeed-m_sec");
    w.set("schedule-m_sec", &op("max", &[sum(&[airspeed.clone(), lead]), v(0.0)]));
    tables(w);
    let trim_velocity: [X; 3] = std::array::from_fn(|i| w.value("trim_velocity", i, 0));
    let trim_roll = w.value("trim_attitude", 0, 0);
    let trim_pitch = w.value("trim_attitude", 1, 0);

    w.section("the reference model's velocities, from the trim at the speed of the schedule");
    let mut model = Vec::new();
    for (k, name) in ["u", "v"].iter().enumerate() {
        let (old, trim) = (w.p(&format!("model/{name}")), w.p(&format!("model/trim-{name}")));
        let start = minus(air[k].clone(), trim_velocity[k].clone());
        let moved = minus(old, minus(trim_velocity[k].clone(), trim));
        model.push(w.set(&format!("last/model-{name}"), &pick(fresh.clone(), start, moved)));
    }
    for (k, name) in ["u", "v"].iter().enumerate() {
        w.set(&format!("model/trim-{name}"), &sum(&trim_velocity[k..=k]));
    }

    w.section("outer loops and turn coordination");
    let heading_rate = input(w, "heading-rate-rad_sec");
    let t = w.set(
        "turn/t",
        &held(sum(&[over(minus(airspeed.clone(), v(turn)), v(width)), v(0.5)]), 0.0, 1.0),
    );
    let blend = w
        .set("turn/blend", &product(&[t.clone(), t.clone(), minus(v(3.0), product(&[v(2.0), t]))]));
    let frequencies = [settings.pitch_frequency, settings.roll_frequency];
    // Acceleration per attitude of the inverted model: forward per pitch down,
    // to the right per bank.
    let mut per_attitude = Vec::new();
    for (k, name) in velocities.iter().enumerate() {
        let column = |w: &Writer, table: &str, rows: usize, column: usize| -> Vec<X> {
            (0..rows).map(|i| w.value(table, i, column)).collect()
        };
        let model: Vec<X> = (0..2)
            .map(|j| {
                let state = column(w, "reference_state", 8, j);
                let x = sum(&w.terms("ground_velocity", k, &state));
                w.set(&format!("power/{name}-{j}"), &x)
            })
            .collect();
        let moved = column(w, "reference_input", 8, 1 - k);
        let terms: Vec<X> = (0..8)
            .map(|i| {
                let rate = sum(&[
                    product(&[model[0].clone(), w.value("reference_dynamics", 0, i)]),
                    product(&[model[1].clone(), w.value("reference_dynamics", 1, i)]),
                ]);
                product(&[rate, moved[i].clone()])
            })
            .collect();
        let through = if k == 0 { product(&[v(-1.0), sum(&terms)]) } else { sum(&terms) };
        let own = w.set(&format!("power/{name}-own"), &through);
        let sound = above(own.clone(), v(0.5 * gravity));
        per_attitude.push(w.set(&format!("power/{name}"), &pick(sound, own, v(gravity))));
    }
    let mut velocity_command = Vec::new();
    let mut limited = Vec::new();
    for (k, name) in velocities.iter().enumerate() {
        let command = input(w, &format!("command-{}", k + 1));
        let acceleration = w.set(
            &format!("command/{name}-acceleration"),
            &held(
                over(
                    product(&[minus(command, last_command[k].clone()), v(frequencies[k])]),
                    v(slowness),
                ),
                -acceleration_limit,
                acceleration_limit,
            ),
        );
        velocity_command.push(w.set(
            &format!("command/{name}"),
            &sum(&[last_command[k].clone(), product(&[dt(), acceleration.clone()])]),
        ));
        let flown = if k == 0 { forward.clone() } else { right.clone() };
        let error = w.set(&format!("error/{name}"), &minus(due[k].clone(), flown));
        let mut asked = sum(&[
            over(acceleration, per_attitude[k].clone()),
            over(
                sum(&[
                    product(&[w.value("gains", 4 + k, 1), error.clone()]),
                    product(&[w.value("gains", 4 + k, 2), velocity_integral[k].clone()]),
                ]),
                v(gravity),
            ),
        ]);
        // Where turn coordination has the bank, the lateral integral has
        // nothing to do and is forgotten.
        let mut step = product(&[dt(), error.clone()]);
        let mut kept = v(1.0);
        if k == 1 {
            let turn =
                over(product(&[velocity_command[0].clone(), heading_rate.clone()]), v(gravity));
            asked = sum(&[asked, op("atan", &[turn])]);
            step = product(&[dt(), minus(v(1.0), blend.clone()), error.clone()]);
            kept = minus(v(1.0), over(product(&[dt(), blend.clone()]), v(forgetting)));
        }
        let raw = w.set(&format!("command/{name}-raw"), &asked);
        let size = op("abs", std::slice::from_ref(&raw));
        let outward =
            both(above(size, v(limit)), above(product(&[raw.clone(), error.clone()]), v(0.0)));
        // Anti-windup: hold while the attitude limit is reached.
        let grown = sum(&[velocity_integral[k].clone(), pick(outward, v(0.0), step)]);
        w.set(
            &format!("integral/{name}"),
            &pick(in_velocity.clone(), product(&[grown, kept]), velocity_integral[k].clone()),
        );
        limited.push(w.set(&format!("command/{name}-limited"), &held(raw, -limit, limit)));
    }
    let from_velocity = [
        sum(&[trim_roll.clone(), limited[1].clone()]),
        minus(trim_pitch.clone(), limited[0].clone()),
    ];
    let asked: [X; 2] = std::array::from_fn(|k| {
        pick(in_velocity.clone(), from_velocity[k].clone(), input(w, &format!("command-{}", k + 1)))
    });
    let coordinated =
        op("atan", &[over(product(&[airspeed.clone(), heading_rate.clone()]), v(gravity))]);
    let roll_command = w.set(
        "command/phi",
        &sum(&[
            product(&[minus(v(1.0), blend.clone()), asked[0].clone()]),
            product(&[blend.clone(), sum(&[trim_roll.clone(), coordinated])]),
        ]),
    );
    let pitch_command = w.set("command/theta", &asked[1]);
    let heave_command = input(w, "v-z-m_sec");

    w.section("command models");
    let mut feed = Vec::new();
    let mut reference = Vec::new();
    let mut reference_rate = Vec::new();
    let attitudes =
        [(roll_command, settings.roll_frequency), (pitch_command, settings.pitch_frequency)];
    for (k, (command, omega)) in attitudes.into_iter().enumerate() {
        let name = names[k];
        let acceleration = w.set(
            &format!("reference/{name}-acceleration"),
            &minus(
                product(&[v(omega * omega), minus(command, last[k].clone())]),
                product(&[v(2.0 * settings.attitude_damping * omega), last_rate[k].clone()]),
            ),
        );
        let rate = w.set(
            &format!("reference/{name}-rate"),
            &sum(&[last_rate[k].clone(), product(&[dt(), acceleration.clone()])]),
        );
        reference.push(w.set(
            &format!("reference/{name}"),
            &sum(&[last[k].clone(), product(&[dt(), rate.clone()])]),
        ));
        reference_rate.push(rate);
        feed.push(acceleration);
    }
    for (k, name) in velocities.iter().enumerate() {
        // What the aircraft can do of a velocity: the attitude command model
        // stands between.
        let (omega, rate) = (frequencies[k], &last_rate[2 + k]);
        let acceleration = minus(
            product(&[v(omega * omega), minus(velocity_command[k].clone(), last[4 + k].clone())]),
            product(&[v(2.0 * settings.attitude_damping * omega), rate.clone()]),
        );
        let moved = sum(&[rate.clone(), product(&[dt(), acceleration])]);
        let now = w.set(
            &format!("reference/{name}-rate"),
            &pick(in_velocity.clone(), moved, rate.clone()),
        );
        let moved = sum(&[last[4 + k].clone(), product(&[dt(), now])]);
        w.set(&format!("reference/{name}"), &pick(in_velocity.clone(), moved, last[4 + k].clone()));
    }
    // The heading turns no sooner than the bank that must go with it.
    let omega = settings.roll_frequency;
    let acceleration = minus(
        product(&[v(omega * omega), minus(heading_rate.clone(), last_turn.clone())]),
        product(&[v(2.0 * settings.attitude_damping * omega), last_turn_rate.clone()]),
    );
    let turn_rate =
        w.set("turn/rate-rate", &sum(&[last_turn_rate, product(&[dt(), acceleration])]));
    let turn_value = w.set("turn/rate", &sum(&[last_turn, product(&[dt(), turn_rate.clone()])]));
    let together = w.set(
        "turn/together",
        &held(over(product(&[v(yaw_lead), airspeed.clone()]), v(turn)), 0.0, 1.0),
    );
    let lag = settings.yaw_time_constant;
    let led = sum(&[turn_value, product(&[v(lag), turn_rate])]);
    let turned = sum(&[
        product(&[minus(v(1.0), together.clone()), heading_rate]),
        product(&[together, led]),
    ]);
    // In a coordinated turn the aircraft rolls about its flight path: to keep v
    // at zero, rolling with w asks for yaw, p w = r u.
    let slope = pick(
        above(trim_velocity[0].clone(), v(slow)),
        over(product(&[blend.clone(), trim_velocity[2].clone()]), trim_velocity[0].clone()),
        v(0.0),
    );
    let rolling =
        product(&[slope, sum(&[reference_rate[0].clone(), product(&[v(lag), feed[0].clone()])])]);
    let yaw_command =
        w.set("command/r", &sum(&[product(&[turned, cp.clone(), ct.clone()]), rolling]));
    let lags =
        [(yaw_command, settings.yaw_time_constant), (heave_command, settings.heave_time_constant)];
    for (k, (command, lag)) in (2..).zip(lags) {
        let name = names[k];
        let rate = w
            .set(&format!("reference/{name}-rate"), &over(minus(command, last[k].clone()), v(lag)));
        reference.push(w.set(
            &format!("reference/{name}"),
            &sum(&[last[k].clone(), product(&[dt(), rate.clone()])]),
        ));
        feed.push(rate);
    }

    // What the errors see.
    let delayed: Vec<X> = if delay > 0 {
        [&past[..4], &past[6..]].concat()
    } else {
        [reference.as_slice(), reference_rate.as_slice()].concat()
    };

    w.section("accelerations wanted of phi, theta, r, V_z");
    let mut error = Vec::new();
    for (k, name) in names.iter().enumerate() {
        error
            .push(w.set(&format!("error/{name}"), &minus(delayed[k].clone(), measured[k].clone())));
    }
    let rho = [
        minus(reference[0].clone(), trim_roll.clone()),
        minus(reference[1].clone(), trim_pitch.clone()),
        reference_rate[0].clone(),
        reference_rate[1].clone(),
        reference[2].clone(),
        reference[3].clone(),
    ];
    let states = ["u", "v", "w", "p", "q", "r", "phi", "theta"];
    // Exact kinematics: in a turn the aircraft also pitches and rolls; and under
    // a velocity demand its velocities are known from their references.
    let sr = w.set("reference/sin-phi", &op("sin", &reference[..1]));
    let cr = w.set("reference/cos-phi", &op("cos", &reference[..1]));
    let s_pitch = w.set("reference/sin-theta", &op("sin", &reference[1..2]));
    let c_pitch = w.set("reference/cos-theta", &op("cos", &reference[1..2]));
    let turn_of = w.set(
        "reference/turn",
        &over(
            sum(&[reference[2].clone(), product(&[reference_rate[1].clone(), sr.clone()])]),
            product(&[c_pitch.clone(), cr.clone()]),
        ),
    );
    let along = sum(&[w.p("reference/v-x"), wind]);
    let down = reference[3].clone();
    let lifted = w.set(
        "reference/lifted-m_sec",
        &sum(&[
            product(&[along.clone(), s_pitch.clone()]),
            product(&[down.clone(), c_pitch.clone()]),
        ]),
    );
    // A coordinated turn leaves no v.
    let across = w.set(
        "reference/across-m_sec",
        &minus(
            product(&[minus(v(1.0), blend.clone()), w.p("reference/v-y")]),
            over(product(&[blend, lifted.clone(), sr.clone()]), cr.clone()),
        ),
    );
    let known = [
        minus(product(&[along, c_pitch.clone()]), product(&[down, s_pitch.clone()])),
        sum(&[product(&[across.clone(), cr.clone()]), product(&[lifted.clone(), sr.clone()])]),
        minus(product(&[lifted, cr.clone()]), product(&[across, sr.clone()])),
    ];
    let turning_rates = [
        minus(reference_rate[0].clone(), product(&[turn_of.clone(), s_pitch])),
        sum(&[product(&[reference_rate[1].clone(), cr]), product(&[turn_of, c_pitch, sr])]),
        reference[2].clone(),
    ];
    let mut ideal = Vec::new();
    for (i, state) in states.iter().enumerate() {
        let mut terms = w.terms("reference_state", i, &model);
        terms.extend(w.terms("reference_input", i, &rho));
        let x = match i {
            0..3 => pick(
                in_velocity.clone(),
                minus(known[i].clone(), trim_velocity[i].clone()),
                sum(&terms),
            ),
            3..6 => sum(&turning_rates[i - 3..i - 2]),
            _ => sum(&terms),
        };
        ideal.push(w.set(&format!("model/ideal-{state}"), &x));
    }
    let mut deviation = Vec::new();
    for (k, state) in states.iter().enumerate() {
        let x = match k {
            0..3 => minus(air[k].clone(), trim_velocity[k].clone()),
            3..6 => sum(&rates[k - 3..k - 2]),
            6 => minus(phi.clone(), trim_roll.clone()),
            _ => minus(theta.clone(), trim_pitch.clone()),
        };
        deviation.push(w.set(&format!("deviation/{state}"), &x));
    }
    let measured_rate = [phi_dot, theta_dot];
    let mut nu = Vec::new();
    let mut commanded = Vec::new();
    for (i, name) in names.iter().enumerate() {
        let mut wanted = vec![
            product(&[w.value("gains", i, 1), error[i].clone()]),
            product(&[w.value("gains", i, 2), integral[i].clone()]),
        ];
        if i < 2 {
            wanted.push(product(&[
                w.value("gains", i, 0),
                minus(delayed[4 + i].clone(), measured_rate[i].clone()),
            ]));
        }
        // F x with the velocity terms times kappa.
        let cancelled = |w: &Writer, x: &[X]| -> X {
            let mut terms = w.terms("feedback", i, x);
            let velocity = w.terms("feedback", i, &x[..3]);
            terms.drain(..velocity.len());
            terms.push(product(&[v(settings.kappa), sum(&velocity)]));
            sum(&terms)
        };
        let mut asked = minus(sum(&wanted), cancelled(w, &deviation));
        let mut fed = feed[i].clone();
        if settings.hybrid_feedforward {
            asked = sum(&[asked, cancelled(w, &ideal)]);
            fed = minus(fed, sum(&w.terms("feedback", i, &ideal)));
        }
        nu.push(w.set(&format!("feedback/{name}"), &asked));
        commanded.push(w.set(&format!("commanded/{name}"), &sum(&[fed])));
    }
    for (k, name) in ["u", "v"].iter().enumerate() {
        let mut terms = w.terms("reference_dynamics", k, &ideal);
        terms.extend(w.terms("reference_drive", k, &feed));
        let moved = sum(&[model[k].clone(), product(&[dt(), sum(&terms)])]);
        w.set(&format!("model/{name}"), &pick(in_velocity.clone(), ideal[k].clone(), moved));
    }

    w.section("powers of the sticks away from the trim");
    let (col, ped) = (2, 3);
    let per_power = w.value("decoupling", ped, 2);
    // Power of the pedals over yaw, relative to the trim's, at a change of
    // collective from it.
    let pedal_power = |collective: X| {
        let growth = product(&[v(pedal_yaw), per_power.clone(), collective]);
        held(sum(&[v(1.0), growth]), powers[0], powers[1])
    };
    let mut lifting = None;
    if settings.hybrid_feedforward {
        // Pitch acceleration of the lift that the references ask for, with the
        // tail's load.
        let [forward, down] = [0, 2].map(|k| sum(&[trim_velocity[k].clone(), ideal[k].clone()]));
        let load = w.set(
            "off-trim/load-m2_sec2",
            &minus(
                product(&[forward, down]),
                product(&[trim_velocity[0].clone(), trim_velocity[2].clone()]),
            ),
        );
        let x = sum(&w.terms("decoupling", col, &commanded));
        let collective = w.set("off-trim/col", &x);
        let x = over(sum(&w.terms("decoupling", ped, &commanded)), pedal_power(collective.clone()));
        let pedal = w.set("off-trim/ped", &x);
        let grown = sum(&[
            product(&[v(0.5 * constant("collective_pitch_growth")), collective]),
            product(&[v(constant("pedal_pitch_growth")), pedal]),
        ]);
        lifting = Some(w.set("off-trim/lifting-rad_sec2", &product(&[load, grown])));
    }

    w.section("inversion, limits and anti-windup");
    let sticks = ["lat", "lon", "col", "ped"];
    let mut delta = Vec::new();
    for (j, stick) in sticks.iter().enumerate() {
        let mut x =
            sum(&[sum(&w.terms("decoupling", j, &commanded)), sum(&w.terms("allocation", j, &nu))]);
        if let Some(lifting) = &lifting {
            x = minus(x, product(&[w.value("decoupling", j, 1), lifting.clone()]));
        }
        delta.push(w.set(&format!("change/{stick}"), &x));
    }
    let trim_collective = w.value("trim_sticks", col, 0);
    let collective =
        held(sum(&[trim_collective.clone(), delta[col].clone()]), limits[col][0], limits[col][1]);
    let collective = w.set("off-trim/collective", &minus(collective, trim_collective));
    delta[ped] = over(delta[ped].clone(), pedal_power(collective));
    let mut wanted = Vec::new();
    for (j, stick) in sticks.iter().enumerate() {
        let x = sum(&[w.value("trim_sticks", j, 0), delta[j].clone()]);
        wanted.push(w.set(&format!("wanted/{stick}"), &x));
    }
    for (j, stick) in sticks.iter().enumerate() {
        let x = held(wanted[j].clone(), limits[j][0], limits[j][1]);
        w.set(&format!("sticks/{stick}"), &x);
    }
    for (i, (name, e)) in names.iter().zip([0, 1, 3, 2]).enumerate() {
        let push = product(&[w.value("allocation", e, i), error[i].clone()]);
        let stuck = op(
            "or",
            &[
                both(above(wanted[e].clone(), v(limits[e][1])), above(push.clone(), v(0.0))),
                both(below(wanted[e].clone(), v(limits[e][0])), below(push, v(0.0))),
            ],
        );
        let grown = pick(stuck, v(0.0), product(&[dt(), error[i].clone()]));
        w.set(&format!("integral/{name}"), &sum(&[integral[i].clone(), grown]));
    }
}

fn w_step(input: &Input) -> f64 {
    input.options.step
}
