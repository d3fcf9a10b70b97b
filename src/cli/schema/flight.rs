//! Schemas of flights and of studies of many flights.

use serde_json::{Value as Json, json};

use super::build::{
    Entry, count, document, hash, list, named, number, numbers, object, or_null, positive, text,
    truth, vector, words,
};
use super::design::{counted, head, sweep_head};
use coaxdesign::pipeline::STUDY_SCHEMA;
use coaxdesign::simulate::montecarlo::COLUMNS;

/// How a flight ended.
const ENDS: [&str; 3] = ["completed", "limit", "diverged"];

/// `coaxdesign.simulation/1`.
pub(super) fn simulation() -> Json {
    let schedule = object(
        "The law that flew.",
        &[
            ("name", text("of the schedule")),
            ("requirements_met", truth("as its tuning said")),
            ("problem_hash", hash("of what it was tuned for")),
            ("specification_hash", hash("of what it was tuned to")),
        ],
        &[],
    );
    let model = object(
        "The flown model.",
        &[
            ("interactions", or_null(truth("whether rotors act on one another, of a vehicle"))),
            ("mass_factor", positive("on the problem's")),
            ("inertia_factor", positive("on the problem's")),
            ("center_of_gravity_shift_m", number("aft, m")),
            ("extra_delay_s", number("s")),
            ("interference_gain", number("factor on the inflow of rotors on one another")),
            ("gust_m_s", vector(3, "forward, to starboard, up, m/s")),
            ("governor_s", or_null(positive("time constant given to every rotor, s"))),
        ],
        &[],
    );
    let simulation = object(
        "How it was flown.",
        &[
            ("duration_s", positive("of the manoeuvre, s")),
            ("control_rate_hz", positive("Hz")),
            ("integration_step_s", positive("s")),
            ("delay_s", number("from a measurement to the blades, s")),
            ("seed", count("of noise and turbulence")),
        ],
        &[],
    );
    let column = object("A column.", &[("name", text("name")), ("unit", text("SI"))], &[]);
    let row = list("a time", json!({ "type": ["number", "null"] }));
    let history = object(
        "The flight over time.",
        &[("columns", list("of the rows", column)), ("rows", list("one a time", row))],
        &[],
    );
    let start = [("maneuver", text("title"))];
    let rest = [
        ("schedule", or_null(schedule)),
        ("model", model),
        ("simulation", simulation),
        ("metrics", metrics()),
    ];
    let mut schema = document(
        "coaxdesign.simulation/1",
        "A flight, SI.",
        &[&start[..], &head()[..], &rest[..]].concat(),
        &[("history", history)],
    );
    // Without a design there is no name of one.
    schema["properties"]["problem"] = or_null(text("problem file"));
    schema
}

fn error_size() -> [Entry<'static>; 3] {
    [
        ("rms", number("root mean square")),
        ("peak", number("largest magnitude")),
        ("peak_time_s", number("when that was, s")),
    ]
}

fn metrics() -> Json {
    let end = object(
        "How the flight ended.",
        &[
            ("status", words("how", &ENDS)),
            ("state", or_null(text("the state that left its bounds"))),
            ("time_s", positive("when, s")),
            ("value", or_null(number("of that state, SI"))),
            ("bound", or_null(number("that it passed, SI"))),
        ],
        &[],
    );
    let what = [
        ("channel", text("what is tracked")),
        ("unit", text("of the numbers")),
        ("commanded", truth("whether the manoeuvre commands it")),
    ];
    let tracking = object("An error.", &[&what[..], &error_size()[..]].concat(), &[]);
    let actuator = object(
        "How an actuator was used.",
        &[
            ("control", text("blade control")),
            ("minimum_rad", number("rad")),
            ("maximum_rad", number("rad")),
            ("travel_used_percent", number("of the way to the nearer limit, %")),
            ("rate_rad_s", number("largest, rad/s")),
            ("rate_used_percent", number("of its limit, %")),
            ("saturated_s", number("time at a limit, s")),
        ],
        &[],
    );
    let stick = object(
        "How the actuator of a stick was used.",
        &[
            ("stick", text("which")),
            ("minimum_percent", number("%")),
            ("maximum_percent", number("%")),
            ("travel_used_percent", number("of the way to the nearer limit, %")),
            ("rate_percent_s", number("largest, %/s")),
            ("saturated_s", number("time at a limit, s")),
        ],
        &[],
    );
    let beyond = object(
        "Flight beyond the speeds of a set of linear models.",
        &[
            ("range_m_s", vector(2, "airspeed along x that the set has, m/s")),
            ("time_s", positive("time outside, s")),
        ],
        &[],
    );
    let state = object(
        "Range of a state.",
        &[
            ("state", text("its name")),
            ("unit", text("SI")),
            ("minimum", or_null(number("least"))),
            ("maximum", or_null(number("greatest"))),
        ],
        &[],
    );
    let power = object(
        "Power of all rotors, means over a revolution.",
        &[("mean_w", number("W")), ("peak_w", number("W"))],
        &[],
    );
    object(
        "What the flight amounts to.",
        &[
            ("end", end),
            ("tracking", list("errors against the references of the law", tracking.clone())),
            ("command_lag", list("errors against lags of the commands", tracking)),
            ("steady_turn_rate_error_rad_s", or_null(number("rad/s"))),
            (
                "coordinated_bank_error_rad",
                or_null(object("Bank against that of a turn.", &error_size(), &[])),
            ),
            ("roll_peak_rad", number("rad")),
            ("pitch_peak_rad", number("rad")),
            ("stick_jump_percent", vector(4, "from one control period to the next, %")),
            ("actuators", list("each", actuator)),
            ("saturated_s", number("time with any actuator at a limit, s")),
            ("drift_m", number("largest distance over the ground, m")),
            ("height_change_m", vector(2, "loss and gain, m")),
            ("states", list("each", state)),
        ],
        &[
            ("power", power),
            ("stick_actuators", list("each, of stitched linear models", stick)),
            ("beyond_models", beyond),
        ],
    )
}

/// `coaxdesign.identification/1`.
pub(super) fn identification() -> Json {
    let interval = json!({
        "type": ["array", "null"],
        "description": "95 % confidence; null where there is none",
        "items": { "type": ["number", "null"] },
        "minItems": 2,
        "maxItems": 2,
    });
    let pair = object(
        "A number, measured and predicted.",
        &[
            ("axis", text("which")),
            ("quantity", text("what")),
            ("unit", text("of the numbers")),
            ("measured", or_null(number("in flight"))),
            ("measured_interval", interval),
            ("predicted", or_null(number("by the linear model"))),
            ("difference_percent", or_null(number("%"))),
        ],
        &[],
    );
    let values = |doc: &str| list(doc, json!({ "type": ["number", "null"] }));
    let response = object(
        "A frequency response.",
        &[
            ("omega_rad_s", numbers("frequencies, rad/s")),
            ("real", values("of the measured response")),
            ("imaginary", values("of the measured response")),
            ("coherence", values("0 to 1")),
            ("standard_error", values("of the magnitude")),
            ("predicted_real", values("of the linear model")),
            ("predicted_imaginary", values("of the linear model")),
        ],
        &[],
    );
    let axis = object(
        "Responses of an axis.",
        &[
            ("axis", text("which")),
            ("loop", response.clone()),
            ("sensitivity", or_null(response.clone())),
            ("command", or_null(response)),
        ],
        &[],
    );
    let rest = [
        ("speed_m_s", positive("true airspeed, m/s")),
        ("numbers", list("an axis and a quantity", pair)),
        ("responses", list("of each axis", axis)),
    ];
    // A set of linear models has no problem.
    let [design, aircraft, problem, specification] = head();
    document(
        "coaxdesign.identification/1",
        "Loops measured in simulated flight beside those of the linear model.",
        &[&[design, aircraft, specification], &rest[..]].concat(),
        &[problem],
    )
}

/// `coaxdesign.steps/1`.
pub(super) fn steps() -> Json {
    let step = object(
        "A small step.",
        &[
            ("channel", text("that is commanded")),
            ("size_si", number("of the step")),
            ("rms_difference_percent", or_null(number("of the step, %"))),
            ("peak_difference_percent", or_null(number("of the step, %"))),
            ("time_s", numbers("s")),
            ("flown_si", numbers("response of the nonlinear vehicle")),
            ("linear_si", numbers("response of the linear model")),
        ],
        &[],
    );
    let rest =
        [("speed_m_s", positive("true airspeed, m/s")), ("steps", list("of each channel", step))];
    let [design, aircraft, problem, specification] = head();
    document(
        "coaxdesign.steps/1",
        "Small steps of the nonlinear vehicle and of the linear model.",
        &[&[design, aircraft, specification], &rest[..]].concat(),
        &[problem],
    )
}

/// What a study is.
fn study_head() -> Json {
    let part = |doc: &str| {
        object(doc, &[("name", text("for people")), ("hash", hash("of all it holds"))], &[])
    };
    let model = object(
        "What is varied in every run alike.",
        &[
            ("interactions", or_null(truth("if not the problem's"))),
            ("mass", positive("factor")),
            ("inertia", positive("factor")),
            ("center_of_gravity", number("shift aft, m")),
            ("delay", number("on top, s")),
            ("turbulence", or_null(positive("wind at 20 ft, m/s"))),
            ("inflow", number("factor on the inflow of rotors on one another")),
            ("gust", vector(3, "forward, to starboard, up, m/s")),
            ("governor", or_null(positive("time constant, s"))),
        ],
        &[],
    );
    let ranges = object(
        "What is drawn, evenly.",
        &[
            ("mass", positive("either way, as a fraction")),
            ("inertia", positive("either way, as a fraction")),
            ("center_of_gravity", positive("either way, m")),
            ("delay", positive("largest, s")),
            ("turbulence", positive("largest wind at 20 ft, m/s; 0 keeps the manoeuvre's")),
            ("inflow", positive("either way, as a fraction")),
            ("gust", positive("largest component, m/s")),
        ],
        &[],
    );
    let criterion = object(
        "What makes a run a success.",
        &[
            ("velocity_peak", number("largest peak error of any velocity, m/s")),
            ("saturated", number("longest time at actuator limits, s")),
        ],
        &[],
    );
    document(
        STUDY_SCHEMA,
        "What a study is: all that changes a result.",
        &[
            ("generator", text("program and version")),
            ("problem", part("The problem with its bases and tables.")),
            ("schedule", or_null(part("The schedule, if a law flies."))),
            ("maneuver", part("The manoeuvre.")),
            ("simulation", part("Control computer, integration, hardware.")),
            ("model", model),
            ("runs", count("of the whole study")),
            ("seed", count("of the draws")),
            ("ranges", ranges),
            ("criterion", criterion),
        ],
        &[],
    )
}

/// `FILE.study.json`, and `study.json` of a dataset.
pub(super) fn study() -> Json {
    object(
        "What a Monte Carlo study or a sweep is.",
        &[
            ("study", hash("of the head: the name of the study")),
            ("head", json!({ "anyOf": [study_head(), sweep_head()] })),
            ("units", named("unit of each column of the rows; 1 for none", text(""))),
        ],
        &[],
    )
}

/// A row of a study.
pub(super) fn run() -> Json {
    let entries: Vec<Entry<'_>> = COLUMNS
        .iter()
        .map(|&(name, unit)| {
            let schema = match name {
                "run" | "seed" => count("1"),
                "success" => truth("whether the criterion is met"),
                "interactions" => or_null(truth("null: the problem's")),
                "status" => words("how it ended", &["completed", "limit", "diverged", "no_trim"]),
                "state" => or_null(text("the state that left its bounds")),
                "turbulence_m_s" | "governor_s" => or_null(number(unit)),
                _ => number(unit),
            };
            (name, schema)
        })
        .collect();
    object("A run of a study, SI; the description of a number is its unit.", &entries, &[])
}

/// The summary of `coaxdesign montecarlo`.
pub(super) fn montecarlo() -> Json {
    document(
        STUDY_SCHEMA,
        "Runs of a study, summed up.",
        &[
            ("design", or_null(text("directory or file"))),
            ("aircraft", text("its name")),
            ("specification", or_null(text("specification"))),
            ("study", study_head()),
            counted("flown"),
            counted("completed"),
            counted("limit"),
            counted("diverged"),
            counted("no_trim"),
            counted("successes"),
            ("success_rate", or_null(number("successes over runs"))),
            ("confidence_95", vector(2, "Wilson's interval of the success rate")),
            ("worst", list("the worst first", run())),
        ],
        &[],
    )
}
