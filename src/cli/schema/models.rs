//! Schemas of trims, linear models and what is read from them.

use serde_json::{Value as Json, json};

use super::build::{
    Entry, count, document, list, named, number, numbers, object, or_null, positive, text, texts,
    truth, vector, words,
};

/// One key in SI, or another in US customary units.
fn either(schema: &mut Json, si: &str, us: &str, value: &Json) {
    schema["properties"][si] = value.clone();
    schema["properties"][us] = value.clone();
    let choice = json!({ "oneOf": [{ "required": [si] }, { "required": [us] }] });
    match schema["allOf"].as_array_mut() {
        Some(all) => all.push(choice),
        None => schema["allOf"] = json!([choice]),
    }
}

fn speed(schema: &mut Json) {
    either(schema, "speed_m_s", "speed_kt", &positive("true airspeed over the ground"));
}

fn channel() -> Json {
    let unit = text("unit, such as ft/s, rad/s, %; 1 for none");
    object("A channel.", &[("name", text("name")), ("unit", unit)], &[])
}

fn channels() -> [Entry<'static>; 3] {
    [
        ("states", list("in the order of the rows of a", channel())),
        ("inputs", list("in the order of the columns of b", channel())),
        ("outputs", list("in the order of the rows of c", channel())),
    ]
}

fn matrices() -> [Entry<'static>; 4] {
    let matrix = |doc: &str| list(doc, numbers("a row"));
    [
        ("a", matrix("state matrix by rows, in the units of the channels")),
        ("b", matrix("input matrix by rows")),
        ("c", matrix("output matrix by rows")),
        ("d", matrix("feed-through matrix by rows")),
    ]
}

/// One or, for `--interactions both`, a list of two.
fn one_or_both(schema: Json) -> Json {
    let both = json!({ "type": "array", "items": { "$ref": "#/$defs/one" }, "minItems": 2 });
    json!({ "anyOf": [{ "$ref": "#/$defs/one" }, both], "$defs": { "one": schema } })
}

/// `coaxdesign.lti/1`.
pub(super) fn lti() -> Json {
    let head = [
        ("speed_kt", number("true airspeed, kt")),
        ("interactions", or_null(truth("whether rotors act on one another; null: unknown"))),
    ];
    one_or_both(document(
        "coaxdesign.lti/1",
        "A linear model x' = A x + B u, y = C x + D u of deviations from a trim.",
        &[&head[..], &channels()[..], &matrices()[..]].concat(),
        &[
            ("x0", numbers("states of the trim")),
            ("u0", numbers("inputs of the trim")),
            ("u_min", numbers("least values of the inputs")),
            ("u_max", numbers("greatest values of the inputs")),
        ],
    ))
}

/// `coaxdesign.ltp/1`.
pub(super) fn ltp() -> Json {
    let azimuth = [("azimuth_rad", number("azimuth of the reference rotor, rad"))];
    let sample = object("The model at an azimuth.", &[&azimuth[..], &matrices()[..]].concat(), &[]);
    let head = [
        ("speed_kt", number("true airspeed, kt")),
        ("interactions", or_null(truth("whether rotors act on one another"))),
        ("frequency_rad_per_s", positive("of the period, rad/s")),
    ];
    let samples = [("samples", list("one period, evenly spaced", sample))];
    one_or_both(document(
        "coaxdesign.ltp/1",
        "A linear model whose matrices are periodic.",
        &[&head[..], &channels()[..], &samples[..]].concat(),
        &[],
    ))
}

/// `coaxdesign.trim/1`.
pub(super) fn trim() -> Json {
    document(
        "coaxdesign.trim/1",
        "Trims. Names of numbers end in their unit, which is US customary or SI.",
        &[
            ("problem", text("name of the aircraft")),
            ("version", text("of the program")),
            ("units", words("units of what differs", &["us", "si"])),
            ("points", list("one a condition and a state of the interactions", trim_point())),
        ],
        &[],
    )
}

fn trim_point() -> Json {
    let attitude = object(
        "Means over a revolution.",
        &[("roll", number("to starboard")), ("pitch", number("nose up"))],
        &[],
    );
    let residual = object(
        "What is left of an equation.",
        &[
            ("equation", text("which")),
            ("unit", text("SI")),
            ("value", or_null(number("in that unit"))),
        ],
        &[],
    );
    let failure = object(
        "Why there is no trim.",
        &[
            ("equations", texts("equations that are not met")),
            ("binding_limits", texts("limits that were in the way")),
            ("reason", text("for people")),
        ],
        &[],
    );
    let last = object(
        "The last condition on the path from level flight that trims.",
        &[
            ("speed_m_s", number("m/s")),
            ("climb_rate_m_s", number("m/s")),
            ("turn_rate_rad_s", number("rad/s")),
        ],
        &[],
    );
    let power = object(
        "Where the shaft power goes, W.",
        &[
            ("shaft", number("in all, W")),
            ("profile", number("drag of the blades, W")),
            ("induced", number("W")),
            ("parasite", number("drag of the body, W")),
            ("climb", number("W")),
        ],
        &[],
    );
    let percent = |doc: &str| named(doc, or_null(number("%")));
    let azimuth = number("of the flight path from the nose, to starboard, where it is held");
    let mut point = object(
        "A trim.",
        &[
            ("interactions", truth("whether rotors act on one another")),
            ("status", words("outcome", &["converged", "beyond_limits", "failed"])),
            ("branch", text("which of several solutions it is")),
            ("iterations", count("of the solver")),
            ("residual_norm", or_null(number("scaled"))),
            ("climb_rate_m_s", number("m/s")),
            ("turn_rate_rad_s", number("rad/s, to starboard")),
            ("controls_percent", percent("sticks, %")),
            ("rotors", named("by name", rotor_of_trim())),
            ("power_w", power),
            ("margins_percent", percent("distance of each control from its nearer limit, %")),
            ("steps_per_period", count("of the integration")),
            ("step_error", or_null(number("estimate of the period's error, scaled"))),
            ("residuals", list("the equations", residual)),
        ],
        &[
            ("failure", failure),
            ("beyond_limits", texts("controls beyond their limits")),
            ("last_from_level_flight", last),
            ("wind_azimuth_rad", azimuth.clone()),
            ("wind_azimuth_deg", azimuth),
        ],
    );
    speed(&mut point);
    either(&mut point, "attitude_rad", "attitude_deg", &attitude);
    either(&mut point, "sideslip_rad", "sideslip_deg", &number("wind from starboard"));
    either(&mut point, "total_power_w", "total_power_hp", &number("shaft power of all rotors"));
    point
}

fn rotor_of_trim() -> Json {
    let mut worst = object(
        "The worst place of the disk.",
        &[
            ("severity", number("beyond 1 is stalled")),
            ("station", number("radius over that of the tip")),
            ("mach", number("Mach number")),
        ],
        &[],
    );
    either(&mut worst, "azimuth_rad", "azimuth_deg", &number("azimuth"));
    either(&mut worst, "angle_of_attack_rad", "angle_of_attack_deg", &number("angle of attack"));
    let share = |doc: &str| number(doc);
    let blades = object(
        "How the blades work.",
        &[
            ("c_t_over_sigma", number("blade loading")),
            ("stalled_share", share("of the disk")),
            ("drag_divergence_share", share("of the disk")),
            ("reversed_share", share("of the disk")),
            ("worst", worst),
        ],
        &[],
    );
    let inflow = |name: &'static str| (name, number("inflow over the tip's speed"));
    let mut rotor = object(
        "Means over a revolution.",
        &[
            ("flow_state", text("such as normal, vortex_ring")),
            ("c_t", number("thrust coefficient T/(ρπR²(ΩR)²)")),
            ("c_p", number("power coefficient")),
            ("c_t_over_sigma", number("blade loading")),
            ("figure_of_merit", or_null(number("null where it has no meaning"))),
            ("profile_power_w", number("W")),
            ("induced_power_w", number("W")),
            inflow("lambda_0"),
            inflow("lambda_1c"),
            inflow("lambda_1s"),
            inflow("lambda_s0"),
            inflow("lambda_s1c"),
            inflow("lambda_s1s"),
        ],
        &[("blades", blades)],
    );
    either(&mut rotor, "thrust_n", "thrust_lbf", &number("thrust"));
    either(&mut rotor, "torque_n_m", "torque_lbf_ft", &number("torque"));
    either(&mut rotor, "power_w", "power_hp", &number("shaft power"));
    for (stem, doc) in [
        ("beta_1c", "flapping aft"),
        ("beta_1s", "flapping to the side"),
        ("theta_0", "collective pitch"),
        ("theta_1c", "lateral cyclic pitch"),
        ("theta_1s", "longitudinal cyclic pitch"),
    ] {
        let [si, us] = ["rad", "deg"].map(|unit| format!("{stem}_{unit}"));
        either(&mut rotor, &si, &us, &number(doc));
    }
    rotor
}

/// `coaxdesign.rotor/1`.
pub(super) fn rotor() -> Json {
    let point = object(
        "A rotor on its stand.",
        &[
            ("status", words("outcome", &["converged", "failed"])),
            ("edgewise_m_s", number("air across the shaft, m/s")),
            ("axial_m_s", number("air down the shaft, m/s")),
            ("c_t", number("thrust coefficient T/(ρπR²(ΩR)²)")),
            ("c_p", number("power coefficient")),
            ("c_t_over_solidity", number("blade loading")),
            ("figure_of_merit", or_null(number("null where it has no meaning"))),
            ("pitch_rad", vector(3, "θ0, θ1c, θ1s, rad")),
            ("flapping_rad", vector(2, "β1c, β1s, rad")),
            ("inflow", vector(3, "λ0, λ1c, λ1s")),
            ("thrust_n", number("N")),
            ("torque_n_m", number("N m")),
            ("power_w", number("W")),
            ("profile_power_w", number("W")),
            ("induced_power_w", number("W")),
            ("flow_state", text("such as normal, vortex_ring")),
            ("residual_norm", or_null(number("scaled"))),
        ],
        &[("failure", text("why it did not converge"))],
    );
    document(
        "coaxdesign.rotor/1",
        "A rotor alone on a stand, SI.",
        &[
            ("problem", text("name of the aircraft")),
            ("rotor", text("its rotor")),
            ("version", text("of the program")),
            ("points", list("in the order asked", point)),
        ],
        &[],
    )
}

/// `coaxdesign.compare/1`.
pub(super) fn compare() -> Json {
    let point = object(
        "A trim.",
        &[
            ("speed_m_s", positive("m/s")),
            ("status", words("outcome", &["converged", "beyond_limits", "failed"])),
            ("power_w", or_null(number("shaft power, W"))),
            ("roll_rad", or_null(number("rad"))),
            ("pitch_rad", or_null(number("rad"))),
            ("sticks_percent", vector(4, "lat, lon, col, ped, %")),
            ("thrust_n", numbers("of each rotor, N")),
            ("least_margin_percent", or_null(number("of the control nearest to a limit, %"))),
            ("least_margin_of", or_null(text("that control"))),
        ],
        &[],
    );
    let mode = object(
        "An eigenvalue.",
        &[("real_rad_s", number("rad/s")), ("imaginary_rad_s", number("rad/s"))],
        &[],
    );
    let margin = object(
        "Design margins of an axis.",
        &[
            ("nominal_percent", number("of the nominal model, %")),
            ("all_models_percent", or_null(number("of the worst model, %"))),
            ("activity_percent", or_null(number("actuator activity, %"))),
        ],
        &[],
    );
    let entry = object(
        "A problem or a design.",
        &[
            ("name", text("as it was given")),
            ("problem", text("its aircraft")),
            ("interactions", truth("whether rotors act on one another")),
            ("trim", list("over speed", point)),
            ("modes_in_hover", list("fastest growth first", mode)),
            ("blade_pitch_rad_per_unit_of_nu", json!(true)),
            ("design_margins", named("by axis, of designs", margin)),
        ],
        &[],
    );
    let entries = [("entries", list("in the order given", entry))];
    document("coaxdesign.compare/1", "Problems or designs side by side, SI.", &entries, &[])
}

/// `coaxdesign.check/1`.
pub(super) fn check() -> Json {
    let warning = object(
        "A doubt about the file.",
        &[
            ("file", or_null(text("name"))),
            ("line", or_null(count("from 1"))),
            ("column", or_null(count("from 1"))),
            ("key", or_null(text("dotted"))),
            ("message", text("what is odd")),
            ("help", or_null(text("what may be meant"))),
        ],
        &[],
    );
    let value = json!({
        "anyOf": [
            { "type": ["number", "string", "null"] },
            { "type": "array", "items": { "type": ["number", "null"] } },
            {
                "type": "object",
                "additionalProperties": {
                    "anyOf": [
                        { "type": ["number", "string", "null"] },
                        { "type": "array", "items": { "type": ["number", "null"] } },
                    ],
                },
            },
        ],
    });
    let mut schema = document(
        "coaxdesign.check/1",
        "What was understood of a problem file: beside what stands here, an object a section, with \
         values whose names end in their unit, or such objects by name.",
        &[
            ("name", text("name of the aircraft")),
            ("description", or_null(text("of the file"))),
            ("warnings", list("in the order of the file", warning)),
            ("files", texts("files that it was read from")),
        ],
        &[],
    );
    schema["additionalProperties"] = named("A section of the problem.", value);
    schema
}

/// `coaxdesign.modes/1`.
pub(super) fn modes() -> Json {
    let share = object(
        "A state and its part in the mode.",
        &[("state", text("its name")), ("share", number("of 1"))],
        &[],
    );
    let floquet = object(
        "The periodic model's exponent beside the averaged model's eigenvalue.",
        &[
            ("averaged_real_rad_per_s", number("rad/s")),
            ("averaged_imaginary_rad_per_s", number("rad/s")),
            ("difference_rad_per_s", number("distance of both, rad/s")),
            (
                "branch",
                json!({ "type": "integer", "description": "multiples of the frequency added" }),
            ),
            ("branch_ambiguous", truth("whether another branch is as near")),
            ("uncertainty_rad_per_s", or_null(number("null: the multiplier is zero to rounding"))),
        ],
        &[],
    );
    let mode = object(
        "A mode.",
        &[
            ("real_rad_per_s", number("growth, rad/s")),
            ("imaginary_rad_per_s", number("rad/s")),
            ("damping_ratio", or_null(number("null where it has no meaning"))),
            ("natural_frequency_rad_per_s", number("rad/s")),
            ("time_constant_s", or_null(number("s"))),
            ("time_to_half_s", or_null(number("s"))),
            ("time_to_double_s", or_null(number("s"))),
            ("dominant", list("states, the greatest share first", share)),
            ("name", or_null(text("such as phugoid"))),
        ],
        &[("floquet", floquet)],
    );
    let listing = object(
        "Modes of a model.",
        &[
            ("label", text("for people")),
            ("interactions", or_null(truth("whether rotors act on one another"))),
            ("published", truth("whether it is a publication's model")),
            ("modes", list("of the model", mode)),
        ],
        &[],
    );
    let models = [("models", list("one a state of the interactions", listing))];
    let mut point = object("A speed.", &models, &[]);
    speed(&mut point);
    document(
        "coaxdesign.modes/2",
        "Eigenvalues or Floquet exponents.",
        &[
            ("name", text("the aircraft or the set of models")),
            ("model", text("which model")),
            ("points", list("one a speed", point)),
        ],
        &[],
    )
}

/// `coaxdesign.frequency-response/1`.
pub(super) fn frequency_response() -> Json {
    let mut response = object(
        "A response.",
        &[
            ("interactions", or_null(truth("whether rotors act on one another"))),
            ("reduced", truth("whether of the reduced model")),
            ("input", text("channel")),
            ("output", text("channel")),
            ("unit", text("of the magnitude")),
            ("magnitude", numbers("at each frequency")),
            ("phase_deg", numbers("at each frequency, deg")),
        ],
        &[],
    );
    speed(&mut response);
    document(
        "coaxdesign.frequency-response/2",
        "Frequency responses of a trim.",
        &[
            ("name", text("the aircraft or the set of models")),
            ("model", text("which model")),
            ("omega_rad_per_s", numbers("frequencies, rad/s")),
            ("responses", list("in the order asked", response)),
        ],
        &[],
    )
}
