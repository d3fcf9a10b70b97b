//! Schemas of designs: `verification.json`, `design.json`.

use serde_json::{Value as Json, json};

use super::build::{
    Entry, count, document, hash, list, named, number, object, or_null, positive, text, texts,
    truth, words,
};
use coaxdesign::pipeline::SWEEP_SCHEMA;

/// What stands before results of a design.
pub(super) fn head() -> [Entry<'static>; 4] {
    [
        ("design", or_null(text("directory or file"))),
        ("aircraft", text("its name")),
        ("problem", text("problem file")),
        ("specification", or_null(text("specification"))),
    ]
}

const AXES: [&str; 6] = ["roll", "pitch", "yaw", "heave", "vx", "vy"];

fn axis() -> Json {
    words("channel", &AXES)
}

fn speed() -> Entry<'static> {
    ("speed_m_s", positive("true airspeed, m/s"))
}

/// `coaxdesign.verification/1`.
pub(super) fn verification() -> Json {
    let left_out = object(
        "A model that was not judged.",
        &[("model", text("its name")), speed(), ("reason", text("for people"))],
        &[],
    );
    let price = object(
        "What a target costs, to first order.",
        &[
            ("axis", axis()),
            speed(),
            ("target", text("which")),
            ("tightening", text("what the price is of")),
            ("activity_percent", number("change of actuator activity, %")),
        ],
        &[],
    );
    let column = list("name, unit", text(""));
    document(
        "coaxdesign.verification/1",
        "Requirements of a schedule at every speed and model. SI, but margins in degrees and \
         decibels.",
        &[
            ("passed", truth("every requirement of every model is met")),
            ("nominal_passed", truth("every requirement of the nominal model is met")),
            ("columns", list("numbers of the rows and their units", column)),
            ("rows", list("an axis, a speed, a model", row())),
            ("stability", list("eigenvalues of the closed loop", stability())),
            ("authority", list("use of blade controls by a step of a command", authority())),
            ("explanations", list("why targets are missed, where that was asked", explanation())),
            ("prices", list("of targets that bind", price)),
            ("left_out", list("models that were not judged", left_out)),
        ],
        &[
            head()[0].clone(),
            head()[1].clone(),
            head()[2].clone(),
            head()[3].clone(),
            ("not_required", list("outer loops that fade at a speed", not_required())),
        ],
    )
}

fn row() -> Json {
    let missed = object(
        "A requirement that is missed.",
        &[
            ("requirement", text("which")),
            ("value", number("is")),
            ("bound", number("ought to be")),
        ],
        &[],
    );
    object(
        "An axis at a speed with a model.",
        &[
            ("axis", axis()),
            speed(),
            ("breakpoint", truth("whether the schedule has a breakpoint there")),
            ("model", text("its name")),
            ("class", text("kind of model")),
            ("drb_rad_s", or_null(number("disturbance rejection bandwidth, rad/s"))),
            ("drp_db", number("disturbance rejection peak, dB")),
            ("crossover_rad_s", or_null(number("rad/s"))),
            ("gm_up_db", or_null(number("gain margin upwards, dB"))),
            ("gm_down_db", or_null(number("gain margin downwards, dB"))),
            ("pm_deg", or_null(number("phase margin, deg"))),
            ("disk_margin", number("radius")),
            ("activity", number("actuator activity")),
            ("design_margin_percent", or_null(number("distance of the nearest requirement, %"))),
            ("binding", or_null(text("the nearest requirement"))),
            ("passed", truth("all of its requirements are met")),
            ("missed", list("those that are not", missed)),
        ],
        &[
            ("bandwidth_rad_s", number("of the attitude response, rad/s")),
            ("phase_delay_s", number("of the attitude response, s")),
        ],
    )
}

fn stability() -> Json {
    let mode = object(
        "A mode that grows.",
        &[
            ("state", text("its dominant state")),
            ("growth_per_s", number("1/s")),
            ("frequency_rad_s", number("rad/s")),
            ("time_to_double_s", number("s")),
        ],
        &[],
    );
    object(
        "The closed loop at a speed with a model.",
        &[
            speed(),
            ("model", text("its name")),
            ("outer_loops", truth("whether they are closed")),
            ("growth_per_s", number("of the fastest growing mode, 1/s")),
            ("least_damping", or_null(number("ratio"))),
            ("pade_change_per_s", number("change with a finer approximation of the delay, 1/s")),
            ("verdict", words("what it says", &["stable", "drifts", "unstable", "unsure"])),
            ("passed", truth("whether that is good enough")),
        ],
        &[("growing_modes", list("modes that grow", mode))],
    )
}

fn not_required() -> Json {
    object(
        "An outer loop whose requirements do not count at a speed.",
        &[
            ("axis", axis()),
            speed(),
            ("reason", words("why it fades", &["gains", "turn_coordination", "open", "no_speed"])),
            ("share", number("of its attitude that it commands there")),
        ],
        &[],
    )
}

fn authority() -> Json {
    object(
        "Use of a blade control.",
        &[
            ("axis", axis()),
            speed(),
            ("control", text("the control nearest to a limit")),
            ("used_percent", number("of its travel from trim, %")),
            ("rate_deg_s", number("largest rate, deg/s")),
            ("rate_limit_deg_s", number("deg/s")),
            ("step", number("of the command, SI")),
            ("largest_step", number("that the control allows, SI")),
            ("passed", truth("whether the control suffices")),
        ],
        &[],
    )
}

fn explanation() -> Json {
    let class = || words("whose", &["nominal", "off_nominal"]);
    let binding = object(
        "A requirement that holds another back.",
        &[
            ("target", text("which")),
            ("class", class()),
            ("key", text("key of the specification that asks for it")),
        ],
        &[],
    );
    let target = object(
        "A target.",
        &[
            ("target", text("which")),
            ("class", class()),
            ("asked", number("in its unit")),
            ("reached", or_null(number("with the worst model of the class; null: no limit"))),
            ("missed", truth("whether the design misses it here")),
            (
                "attainable",
                or_null(number(
                    "missed: what can be had with the others held; met: at which it lets all be met",
                )),
            ),
            ("key", text("key of the specification that asks for it")),
            ("price_percent", or_null(number("rise of activity for a tightening, %"))),
            ("price_of", text("that tightening")),
        ],
        &[
            ("bound_by", list("what holds the attainable value", binding)),
            ("set_to", text("what to write at the key for the attainable value")),
        ],
    );
    let mut remedy = texts("key that ties this speed to the others, and what to write there");
    remedy["minItems"] = 2.into();
    remedy["maxItems"] = 2.into();
    object(
        "What is known about a channel at a speed.",
        &[
            ("axis", axis()),
            speed(),
            ("breakpoint", truth("whether the schedule has a breakpoint there")),
            ("met", truth("whether the design meets every target here, with every model")),
            ("attainable", truth("whether gains for this speed alone meet all targets")),
            ("targets", list("each", target)),
        ],
        &[("remedy", remedy)],
    )
}

/// `coaxdesign.design/2`.
pub(super) fn note() -> Json {
    let part = || {
        object(
            "A file that the design holds.",
            &[
                ("file", text("its place in the directory")),
                ("origin", text("path or built-in name that it was given by")),
                ("hash", hash("of its text")),
            ],
            &[],
        )
    };
    let aircraft = object(
        "The aircraft.",
        &[
            ("name", text("its name")),
            ("problem", part()),
            ("files", texts("all files of the problem, the problem file first")),
        ],
        &[
            ("form", words("what it is", &["problem", "models"])),
            ("copied_from", text("folder, where files name one another by absolute paths")),
        ],
    );
    let stage = object(
        "A stage that has run.",
        &[
            ("inputs", hash("of all that it was made from")),
            ("outputs", named("hash of every file that it made", hash("of the file"))),
            ("ended", words("how", &["done", "goal_missed"])),
        ],
        &[],
    );
    document(
        "coaxdesign.design/2",
        "What a design was made from.",
        &[
            ("generator", text("program and version")),
            ("aircraft", aircraft),
            ("specification", part()),
        ],
        &[
            ("maneuvers", list("flown by the pipeline", part())),
            ("options", named("choices that shape results", text(""))),
            ("stages", named("by name", stage)),
        ],
    )
}

/// What a sweep is.
pub(super) fn sweep_head() -> Json {
    let part =
        object("A part.", &[("name", text("for people")), ("hash", hash("of all it holds"))], &[]);
    let plan = object(
        "What is varied.",
        &[
            ("keys", texts("of a problem file; after spec., of a specification")),
            ("cases", list("a value of every key for each case", list("a case", json!(true)))),
        ],
        &[],
    );
    document(
        SWEEP_SCHEMA,
        "What a sweep is: all that changes a result.",
        &[
            ("generator", text("program and version")),
            ("problems", list("with their bases and tables", part.clone())),
            ("specifications", list("each", part.clone())),
            ("schedule", or_null(part)),
            ("channels", texts("outer loops that are tuned; none: all")),
            ("plan", plan),
        ],
        &[],
    )
}

/// A row of a sweep: the varied keys stand between `case` and `status`.
pub(super) fn case() -> Json {
    let mut schema = object(
        "A case of a sweep: its number, a value for every varied key, and what came of it.",
        &[
            ("case", count("from 0")),
            ("status", words("what came of it", &["met", "missed", "no_design"])),
            ("reason", or_null(text("why there is no design"))),
            ("missed", or_null(count("rows of the verification that miss a requirement"))),
            ("left_out", or_null(count("models and speeds that were not judged"))),
            ("least_margin_percent", or_null(number("design margin of the nearest row, %"))),
            ("least_margin_axis", or_null(text("its axis"))),
            ("least_margin_speed_m_s", or_null(number("its speed, m/s"))),
            ("least_margin_model", or_null(text("its model"))),
            ("least_gain_margin_db", or_null(number("of all rows, dB"))),
            ("least_phase_margin_deg", or_null(number("of all rows, deg"))),
            ("growth_per_s", or_null(number("of the fastest growing mode, 1/s"))),
            ("authority_used_percent", or_null(number("of a blade control's travel, %"))),
        ],
        &[],
    );
    for axis in AXES {
        let name = format!("{axis}_margin_percent");
        schema["properties"][&name] = or_null(number("least design margin of the axis, %"));
        if let Some(required) = schema["required"].as_array_mut() {
            required.push(name.into());
        }
    }
    // The varied keys.
    schema["additionalProperties"] = json!(true);
    schema
}

/// `sweep --format json`.
pub(super) fn sweep() -> Json {
    document(
        SWEEP_SCHEMA,
        "A sweep with its rows.",
        &[("sweep", sweep_head()), ("rows", list("in order", case()))],
        &[],
    )
}

/// A count that results name, such as that of runs.
pub(super) fn counted(name: &'static str) -> Entry<'static> {
    (name, count("number of runs"))
}
