//! From checked tables to the problem, with the checks that join several keys.

use std::path::Path;
use std::sync::Arc;

use crate::units::{Kind, System};

use super::read::{CheckedTable, nearest_help};
use super::report::Severity;
use super::source::Place;
use super::*;

/// Tip Mach number beyond which a file is taken to be mistaken.
const TIP_MACH_LIMIT: f64 = 1.2;
/// Tip Mach number beyond which airfoil tables and theory are doubtful.
const TIP_MACH_WARNING: f64 = 0.95;
/// Relative slack of the triangle inequality, for printed, rounded inertias.
const TRIANGLE_SLACK: f64 = 1e-9;

/// Keys that belong to some kinds of hub only.
const HUB_KEYS: [(&str, &[&str]); 10] = [
    ("drive_train", &["teetering"]),
    ("undersling", &["teetering", "gimballed"]),
    ("teeter_spring", &["teetering"]),
    ("delta_3", &["teetering", "gimballed", "articulated", "hingeless"]),
    ("hinge_offset", &["articulated", "hingeless"]),
    ("flap_spring", &["articulated"]),
    ("flap_frequency", &["hingeless"]),
    ("flap_damping", &["articulated", "hingeless"]),
    ("gimbal_spring", &["gimballed"]),
    ("gimbal_damping", &["gimballed"]),
];

/// What the builder needs of the loader.
pub(super) trait Host {
    fn finding(
        &mut self,
        severity: Severity,
        place: &Place,
        key: &str,
        message: String,
        help: String,
    );
    fn airfoil(&mut self, path: &Path, place: &Place, key: &str) -> Option<Arc<AirfoilTable>>;
    fn fuselage(&mut self, path: &Path, place: &Place, key: &str) -> Option<Arc<FuselageTable>>;
}

/// Builds the problem; `None` where an error has been reported.
pub(super) fn problem(host: &mut dyn Host, root: &CheckedTable, lenient: bool) -> Option<Problem> {
    let mass = root.table("mass").and_then(|table| mass(host, table));
    let atmosphere = root.table("atmosphere").and_then(|table| {
        Some(AtmosphereConditions {
            altitude: table.number("altitude")?,
            temperature_offset: table.number("temperature_offset")?,
        })
    });
    names(host, root);
    let fuselages: Vec<_> =
        root.named("fuselages").iter().map(|(name, table)| fuselage(host, name, table)).collect();
    let rotor_tables = root.named("rotors");
    if rotor_tables.is_empty() && root.given("rotors") && !lenient {
        host.finding(
            Severity::Error,
            root.place("rotors"),
            "rotors",
            "there is no rotor".into(),
            "add at least one, such as [rotors.main]".into(),
        );
    }
    let rotors: Vec<_> = rotor_tables
        .iter()
        .map(|(name, table)| rotor(host, name, table, atmosphere.as_ref()))
        .collect();
    hubs(host, &rotors, rotor_tables);
    blades(host, mass.as_ref(), &rotors, root);
    let wings: Vec<_> =
        root.named("wings").iter().map(|(name, table)| wing(host, name, table)).collect();
    let inflow = root.table("inflow").and_then(inflow);
    let formulation = root.table("formulation").and_then(|table| {
        let teeters =
            rotor_tables.iter().any(|(_, rotor)| rotor.choice("hub") == Some("teetering"));
        formulation(host, table, teeters)
    });
    if let Some(formulation) = &formulation {
        averages(host, formulation, rotor_tables);
    }
    let rotor_names: Vec<(&str, f64)> = rotor_tables
        .iter()
        .map(|(name, table)| (name.as_str(), table.number("speed").unwrap_or(0.0)))
        .collect();
    let controls =
        root.table("controls").and_then(|table| controls(host, table, &rotor_names, lenient));
    let reference = match root.choice("reference")? {
        "coax2d-paper" => Some(Reference::Coax2dPaper),
        _ => None,
    };
    let units = match root.choice("units")? {
        "us" => Some(System::Us),
        "si" => Some(System::Si),
        _ => None,
    };
    let mut rotors: Vec<Rotor> = rotors.into_iter().collect::<Option<_>>()?;
    if reference == Some(Reference::Coax2dPaper) {
        // The paper holds the speed.
        for (rotor, (_, table)) in rotors.iter_mut().zip(rotor_tables) {
            if !table.given("drive_train") {
                rotor.drive_train = DriveTrain::Held;
            }
        }
    }
    Some(Problem {
        name: root.text("name")?.into(),
        description: root.text("description")?.into(),
        reference,
        units,
        mass: mass?,
        atmosphere: atmosphere?,
        fuselages: fuselages.into_iter().collect::<Option<_>>()?,
        rotors,
        wings: wings.into_iter().collect::<Option<_>>()?,
        inflow: inflow?,
        formulation: formulation?,
        controls: controls?,
    })
}

fn station(table: &CheckedTable) -> Option<Station> {
    Some(Station {
        fuselage_station: table.number("fuselage_station")?,
        butt_line: table.number("butt_line")?,
        water_line: table.number("water_line")?,
    })
}

fn mass(host: &mut dyn Host, table: &CheckedTable) -> Option<MassProperties> {
    let center_of_gravity = table.table("center_of_gravity").and_then(station);
    let mass = MassProperties {
        mass: table.number("mass")?,
        i_xx: table.number("i_xx")?,
        i_yy: table.number("i_yy")?,
        i_zz: table.number("i_zz")?,
        i_xz: table.number("i_xz")?,
        i_xy: table.number("i_xy")?,
        i_yz: table.number("i_yz")?,
        center_of_gravity: center_of_gravity?,
    };
    let tensor = nalgebra::Matrix3::new(
        mass.i_xx, -mass.i_xy, -mass.i_xz, //
        -mass.i_xy, mass.i_yy, -mass.i_yz, //
        -mass.i_xz, -mass.i_yz, mass.i_zz,
    );
    // The entries are finite and bounded, so the iteration ends.
    let mut principal: [f64; 3] = tensor.symmetric_eigenvalues().into();
    principal.sort_by(f64::total_cmp);
    let shown = principal.map(|moment| {
        let value = Kind::Inertia.from_si(moment, System::Us);
        // Four digits, so that small aircraft have figures too.
        let digits = if value.abs() >= 1.0 { 1 } else { 5 };
        format!("{value:.digits$}")
    });
    let (severity, fault) = if principal[0] <= 0.0 {
        (Severity::Error, "the inertia tensor is not positive definite")
    } else if principal[0] + principal[1] < principal[2] * (1.0 - TRIANGLE_SLACK) {
        let fault =
            "no body has this inertia: one principal moment is larger than the sum of the others";
        (Severity::Warning, fault)
    } else {
        return Some(mass);
    };
    let usable = severity == Severity::Warning;
    host.finding(
        severity,
        table.place("i_xx"),
        &table.path,
        format!("{fault} (principal moments {} slug ft^2)", shown.join(", ")),
        "check the moments and products, their units and their signs, such as \
         i_xx = \"446 slug ft^2\""
            .into(),
    );
    usable.then_some(mass)
}

/// Every body has a name of its own, since results are filed by name.
fn names(host: &mut dyn Host, root: &CheckedTable) {
    let mut seen: Vec<(&str, String)> = Vec::new();
    for kind in ["fuselages", "rotors", "wings"] {
        for (name, table) in root.named(kind) {
            if let Some((_, other)) = seen.iter().find(|(known, _)| known == name) {
                host.finding(
                    Severity::Error,
                    &table.place,
                    &table.path,
                    format!("`{other}` has the same name"),
                    format!("give one of them another name, such as [{kind}.{name}_2]"),
                );
            }
            seen.push((name, table.path.clone()));
        }
    }
}

fn wash(table: &CheckedTable) -> Option<Wash> {
    Some(match table.choice("wash")? {
        "full" => Wash::Full,
        "angle_only" => Wash::AngleOnly,
        _ => Wash::None,
    })
}

fn fuselage(host: &mut dyn Host, name: &str, table: &CheckedTable) -> Option<Fuselage> {
    let aerodynamics = if let Some(path) = table.path("table") {
        host.fuselage(path, table.place("table"), &table.key_path("table"))
            .map(FuselageAerodynamics::Table)
    } else {
        table.table("flat_plate").and_then(|plate| {
            Some(FuselageAerodynamics::FlatPlate {
                area: plate.numbers("area")?,
                drag_coefficient: plate.numbers("drag_coefficient")?,
            })
        })
    };
    Some(Fuselage {
        name: name.into(),
        position: table.table("position").and_then(station)?,
        aerodynamics: aerodynamics?,
        wash: wash(table)?,
    })
}

fn airfoil(host: &mut dyn Host, table: &CheckedTable) -> Option<Airfoil> {
    if let Some(path) = table.path("table") {
        let read = host.airfoil(path, table.place("table"), &table.key_path("table"));
        return read.map(Airfoil::Table);
    }
    analytic_warnings(host, table);
    let polar = Polar {
        linear: table.number("drag_linear")?,
        quadratic: table.number("drag_quadratic")?,
        stall: table.number("stall"),
    };
    let small_angles = table.flag("small_angles")?;
    if small_angles && polar != Polar::default() {
        host.finding(
            Severity::Error,
            table.place("small_angles"),
            &table.key_path("small_angles"),
            "the published blade loads have constant drag and no stall".into(),
            "remove `small_angles`, or `drag_linear`, `drag_quadratic` and `stall`".into(),
        );
        return None;
    }
    if polar.quadratic > 0.0 {
        let drag = table.number("drag")?;
        let least = drag - 0.25 * polar.linear * polar.linear / polar.quadratic;
        if least < 0.0 {
            host.finding(
                Severity::Error,
                table.place("drag_linear"),
                &table.key_path("drag_linear"),
                format!("the drag polar falls to {least:.5}"),
                "no section has negative drag; check `drag`, `drag_linear` and `drag_quadratic`"
                    .into(),
            );
            return None;
        }
    } else if polar.linear != 0.0 {
        host.finding(
            Severity::Error,
            table.place("drag_linear"),
            &table.key_path("drag_linear"),
            "a drag that only falls or rises with the angle becomes negative".into(),
            "give `drag_quadratic` too, such as \"0.4 1/rad^2\"".into(),
        );
        return None;
    }
    Some(Airfoil::Analytic {
        lift_slope: table.number("lift_slope")?,
        zero_lift_angle: table.number("zero_lift_angle")?,
        drag: table.number("drag")?,
        polar,
        small_angles,
    })
}

/// What no section does, by rule.
fn analytic_warnings(host: &mut dyn Host, table: &CheckedTable) {
    let mut warn = |key: &str, message: String, help: &str| {
        let path = table.key_path(key);
        host.finding(Severity::Warning, table.place(key), &path, message, help.into());
    };
    if let Some(drag) = table.number("drag") {
        if drag == 0.0 {
            warn(
                "drag",
                "the section has no drag".into(),
                "powers will be those of an ideal rotor or wing; sections have about 0.01",
            );
        } else if !(0.0008..=0.2).contains(&drag) {
            warn(
                "drag",
                format!("a drag coefficient of {drag} is unusual"),
                "a smooth plate has at least 0.0008, and sections in use have about 0.01",
            );
        }
    }
    if let Some(slope) = table.number("lift_slope").filter(|slope| !(2.0..=10.0).contains(slope)) {
        warn(
            "lift_slope",
            format!("a lift slope of {slope:.3} 1/rad is unusual"),
            "thin airfoils have 6.28 1/rad; check the unit",
        );
    }
}

/// Speed of sound of the standard troposphere, m/s, for the check of tip
/// speeds.
fn speed_of_sound(atmosphere: &AtmosphereConditions) -> f64 {
    let temperature = 288.15 - 0.0065 * atmosphere.altitude + atmosphere.temperature_offset;
    (1.4 * 287.052_87 * temperature).sqrt()
}

fn rotor(
    host: &mut dyn Host,
    name: &str,
    table: &CheckedTable,
    atmosphere: Option<&AtmosphereConditions>,
) -> Option<Rotor> {
    if table.given("motor") && table.given("governor") {
        host.finding(
            Severity::Error,
            table.place("motor"),
            &table.key_path("motor"),
            "a rotor has a motor or a governor".into(),
            "remove one of them".into(),
        );
        return None;
    }
    if table.given("motor") && table.choice("azimuth") == Some("resolved") {
        host.finding(
            Severity::Error,
            table.place("azimuth"),
            &table.key_path("azimuth"),
            "a rotor whose speed the sticks command has no period to be resolved in".into(),
            "remove it".into(),
        );
        return None;
    }
    if let Some(coefficients) = table.table("coefficients") {
        return rotor_by_coefficients(name, table, coefficients);
    }
    let position = table.table("position").and_then(station);
    let section = table.table("airfoil").and_then(|table| airfoil(host, table));
    let mut sound = true;
    let mut fault = |key: &str, message: String, help: String| {
        let path = table.key_path(key);
        host.finding(Severity::Error, table.place(key), &path, message, help);
        sound = false;
    };
    let hub = table.choice("hub");
    if let (Some("teetering"), Some(count)) = (hub, table.count("blades"))
        && count != 2
    {
        fault(
            "blades",
            format!("a teetering hub has two blades, not {count}"),
            "write blades = 2, or hub = \"rigid\"".into(),
        );
    }
    if let (Some("articulated" | "hingeless"), Some(offset), Some(radius), Some(cutout)) =
        (hub, table.number("hinge_offset"), table.number("radius"), table.number("root_cutout"))
        && offset > cutout * radius
    {
        fault(
            "hinge_offset",
            "the lifting blade would begin inboard of its flap hinge".into(),
            format!("write root_cutout = {:.4} or more", offset / radius),
        );
    }
    if hub == Some("hingeless") {
        match (
            table.number("flap_frequency"),
            table.number("hinge_offset"),
            table.number("blade_first_moment"),
            table.number("blade_second_moment"),
        ) {
            (None, ..) if !table.given("flap_frequency") => fault(
                "flap_frequency",
                "missing key: a hingeless hub needs it".into(),
                "add it, such as flap_frequency = 1.1".into(),
            ),
            (Some(frequency), Some(offset), Some(first), Some(second))
                if frequency * frequency < 1.0 + offset * first / second =>
            {
                fault(
                    "flap_frequency",
                    "is below that of a free hinge at `hinge_offset`".into(),
                    format!(
                        "write {:.4} or more, or a smaller offset",
                        (1.0 + offset * first / second).sqrt()
                    ),
                );
            }
            _ => {}
        }
    }
    if let (Some(cutout), Some(tip)) = (table.number("root_cutout"), table.number("tip_loss"))
        && cutout >= tip
    {
        fault(
            "root_cutout",
            format!("nothing is left of the blade between root cutout {cutout} and tip loss {tip}"),
            "write a root cutout below the tip-loss factor, such as root_cutout = 0.1".into(),
        );
    }
    if let (Some(radius), Some(speed), Some(atmosphere)) =
        (table.number("radius"), table.number("speed"), atmosphere)
    {
        let mach = radius * speed / speed_of_sound(atmosphere);
        if mach > TIP_MACH_LIMIT {
            fault(
                "speed",
                format!("the blade tips would move at Mach {mach:.2}"),
                format!(
                    "check `radius` and `speed` and their units, such as speed = \"47.65 rad/s\"; \
                     the tip Mach number must be at most {TIP_MACH_LIMIT}"
                ),
            );
        }
    }
    if let (Some(mass), Some(first), Some(radius)) =
        (table.number("blade_mass"), table.number("blade_first_moment"), table.number("radius"))
        && first > mass * radius
    {
        fault(
            "blade_first_moment",
            "the centre of mass of the blade would lie beyond its tip".into(),
            format!(
                "write at most blade_mass × radius, which is {:.4} slug ft",
                Kind::FirstMoment.from_si(mass * radius, System::Us)
            ),
        );
    }
    if !sound {
        return None;
    }
    rotor_warnings(host, table, atmosphere);
    let hub_kind = match hub? {
        "teetering" => HubKind::Teetering {
            undersling: table.number("undersling")?,
            spring: table.number("teeter_spring")?,
            delta_3: table.number("delta_3")?,
        },
        "gimballed" => HubKind::Gimballed {
            undersling: table.number("undersling")?,
            spring: table.number("gimbal_spring")?,
            damping: table.number("gimbal_damping")?,
            delta_3: table.number("delta_3")?,
        },
        "articulated" => HubKind::Articulated {
            hinge_offset: table.number("hinge_offset")?,
            spring: table.number("flap_spring")?,
            damping: table.number("flap_damping")?,
            delta_3: table.number("delta_3")?,
        },
        "hingeless" => HubKind::Hingeless {
            hinge_offset: table.number("hinge_offset")?,
            frequency: table.number("flap_frequency")?,
            damping: table.number("flap_damping")?,
            delta_3: table.number("delta_3")?,
        },
        _ => HubKind::Rigid,
    };
    let governor = match table.table("governor") {
        Some(governor) => Some(Governor { time_constant: governor.number("time_constant")? }),
        None => None,
    };
    Some(Rotor {
        name: name.into(),
        hub: position?,
        cant: table.number("cant")?,
        tilt: table.number("tilt")?,
        direction: direction(table)?,
        blades: table.count("blades")?,
        radius: table.number("radius")?,
        chord: table.spanwise("chord")?,
        twist: table.spanwise("twist")?,
        root_cutout: table.number("root_cutout")?,
        tip_loss: table.number("tip_loss")?,
        induced_power_factor: table.number("induced_power_factor")?,
        elements: table.count("elements")?,
        airfoil: section?,
        precone: table.number("precone")?,
        blade_mass: table.number("blade_mass")?,
        blade_first_moment: table.number("blade_first_moment")?,
        blade_second_moment: table.number("blade_second_moment")?,
        hub_kind,
        swashplate_phase: table.number("swashplate_phase")?,
        speed: table.number("speed")?,
        azimuth_offset: table.number("azimuth_offset")?,
        governor,
        motor: motor(table),
        coefficients: None,
        drive_train: match table.choice("drive_train") {
            Some("held") => DriveTrain::Held,
            _ => DriveTrain::Soft,
        },
        azimuth: azimuth(table),
    })
}

/// How the rotor turns; a motor with a commanded speed leaves no choice.
fn azimuth(table: &CheckedTable) -> Option<AzimuthModel> {
    if table.given("motor") {
        return Some(AzimuthModel::Averaged);
    }
    table.choice("azimuth").map(|word| match word {
        "averaged" => AzimuthModel::Averaged,
        _ => AzimuthModel::Resolved,
    })
}

fn motor(table: &CheckedTable) -> Option<Motor> {
    let motor = table.table("motor")?;
    Some(Motor { time_constant: motor.number("time_constant")? })
}

/// A rotor without blades: what only blades have is zero.
fn rotor_by_coefficients(
    name: &str,
    table: &CheckedTable,
    coefficients: &CheckedTable,
) -> Option<Rotor> {
    let none = Spanwise { station: vec![0.0], value: vec![0.0] };
    let governor = match table.table("governor") {
        Some(governor) => Some(Governor { time_constant: governor.number("time_constant")? }),
        None => None,
    };
    Some(Rotor {
        name: name.into(),
        hub: table.table("position").and_then(station)?,
        cant: table.number("cant")?,
        tilt: table.number("tilt")?,
        direction: direction(table)?,
        blades: 1,
        radius: table.number("radius")?,
        chord: none.clone(),
        twist: none,
        root_cutout: 0.0,
        tip_loss: 1.0,
        induced_power_factor: 1.0,
        elements: 1,
        airfoil: Airfoil::Analytic {
            lift_slope: 0.0,
            zero_lift_angle: 0.0,
            drag: 0.0,
            polar: Polar::default(),
            small_angles: false,
        },
        precone: 0.0,
        blade_mass: 0.0,
        blade_first_moment: 0.0,
        blade_second_moment: 0.0,
        hub_kind: HubKind::Rigid,
        swashplate_phase: 0.0,
        speed: table.number("speed")?,
        azimuth_offset: table.number("azimuth_offset")?,
        governor,
        motor: motor(table),
        drive_train: DriveTrain::Held,
        coefficients: Some(RotorCoefficients {
            thrust: coefficients.number("thrust")?,
            torque: coefficients.number("torque")?,
            drag: coefficients.number("drag")?,
            inertia: coefficients.number("inertia")?,
        }),
        azimuth: Some(AzimuthModel::Averaged),
    })
}

fn direction(table: &CheckedTable) -> Option<Direction> {
    Some(match table.choice("direction")? {
        "clockwise" => Direction::Clockwise,
        _ => Direction::CounterClockwise,
    })
}

fn rotor_warnings(
    host: &mut dyn Host,
    table: &CheckedTable,
    atmosphere: Option<&AtmosphereConditions>,
) {
    let mut warn = |key: &str, message: String, help: String| {
        let path = table.key_path(key);
        host.finding(Severity::Warning, table.place(key), &path, message, help);
    };
    if let (Some(mass), Some(first), Some(second)) = (
        table.number("blade_mass"),
        table.number("blade_first_moment"),
        table.number("blade_second_moment"),
    ) && mass * second < first * first
    {
        warn(
            "blade_first_moment",
            "no distribution of mass has these moments: m_b I_β is below M_β²".into(),
            format!(
                "with this mass and second moment the first moment is at most {:.4} slug ft; \
                 the value is used as given",
                Kind::FirstMoment.from_si((mass * second).sqrt(), System::Us)
            ),
        );
    }
    if let (Some(radius), Some(speed), Some(atmosphere)) =
        (table.number("radius"), table.number("speed"), atmosphere)
    {
        let mach = radius * speed / speed_of_sound(atmosphere);
        if mach > TIP_MACH_WARNING {
            warn(
                "speed",
                format!("the blade tips move at Mach {mach:.2} in hover"),
                "airfoil tables and the theory are doubtful there".into(),
            );
        }
    }
    if let Some(hub) = table.choice("hub") {
        for (key, hubs) in HUB_KEYS {
            if table.given(key) && !hubs.contains(&hub) {
                let article = if hub == "articulated" { "an" } else { "a" };
                warn(
                    key,
                    format!("has no meaning for {article} {hub} hub, and is ignored"),
                    format!("remove it, or write hub = \"{}\"", hubs[0]),
                );
            }
        }
    }
}

/// Hubs must stand apart: the wake of one acts on the disk of the other.
fn hubs(host: &mut dyn Host, rotors: &[Option<Rotor>], tables: &[(String, CheckedTable)]) {
    for (index, (rotor, (_, table))) in rotors.iter().zip(tables).enumerate() {
        let Some(rotor) = rotor else { continue };
        for other in rotors[..index].iter().flatten() {
            if other.hub == rotor.hub {
                host.finding(
                    Severity::Error,
                    table.place("position"),
                    &table.key_path("position"),
                    format!("the hub of `{}` stands at the same point", other.name),
                    "move one of them, such as position = { fuselage_station = \"0 ft\", \
                     water_line = \"4.52 ft\" }"
                        .into(),
                );
            }
        }
    }
}

/// The blades cannot outweigh the aircraft that they are a part of.
fn blades(
    host: &mut dyn Host,
    mass: Option<&MassProperties>,
    rotors: &[Option<Rotor>],
    root: &CheckedTable,
) {
    let Some(mass) = mass else { return };
    let blades: f64 =
        rotors.iter().flatten().map(|rotor| rotor.blade_mass * rotor.blades as f64).sum();
    if blades >= mass.mass
        && let Some(table) = root.table("mass")
    {
        host.finding(
            Severity::Error,
            table.place("mass"),
            &table.key_path("mass"),
            format!(
                "the blades alone have a mass of {:.4} lb",
                Kind::Mass.from_si(blades, System::Us)
            ),
            "write the gross mass, blades included, such as mass = \"992 lb\"".into(),
        );
    }
}

fn wing(host: &mut dyn Host, name: &str, table: &CheckedTable) -> Option<Wing> {
    let position = table.table("aerodynamic_center").and_then(station);
    let model = if let Some(strips) = table.table("strips") {
        let section = strips.table("airfoil").and_then(|table| airfoil(host, table));
        section.and_then(|airfoil| {
            Some(WingModel::Elements {
                elements: strips.count("count")?,
                airfoil,
                induced_angle: strips.flag("induced_angle")?,
            })
        })
    } else {
        table.table("finite").and_then(|finite| {
            Some(WingModel::Finite {
                lift_slope: finite.number("lift_slope")?,
                zero_lift_angle: finite.number("zero_lift_angle")?,
                parasite_drag: finite.number("parasite_drag")?,
                oswald: finite.number("oswald")?,
                stall_angle: finite.number("stall_angle")?,
            })
        })
    };
    let incidence_schedule = match table.table("incidence_schedule") {
        Some(schedule) => Some(incidence_schedule(host, schedule)?),
        None => None,
    };
    let dynamic_pressure = match table.table("dynamic_pressure") {
        Some(behind) => Some(dynamic_pressure(host, behind)?),
        None => None,
    };
    let surface = match table.table("surface") {
        Some(surface) => Some(control_surface(host, surface)?),
        None => None,
    };
    Some(Wing {
        name: name.into(),
        aerodynamic_center: position?,
        span: table.number("span")?,
        chord: table.spanwise("chord")?,
        incidence: table.number("incidence")?,
        incidence_schedule,
        surface,
        cant: table.number("cant")?,
        dihedral: table.number("dihedral")?,
        model: model?,
        wash: wash(table)?,
        dynamic_pressure,
    })
}

fn dynamic_pressure(host: &mut dyn Host, table: &CheckedTable) -> Option<DynamicPressure> {
    let (over, key) = match table.number_list("angle_of_attack") {
        Some(_) => (FlowAngle::Attack, "angle_of_attack"),
        None => (FlowAngle::Sideslip, "sideslip"),
    };
    let (angle, ratio) = (table.number_list(key)?, table.number_list("ratio")?);
    let increasing = angle.windows(2).all(|pair| pair[0] < pair[1]);
    let fault = if angle.len() < 2 || !increasing {
        "angles must increase strictly, and be two or more".to_owned()
    } else if ratio.len() != angle.len() {
        format!("there are {} angles but {} ratios", angle.len(), ratio.len())
    } else {
        return Some(DynamicPressure { over, angle, ratio });
    };
    host.finding(
        Severity::Error,
        table.place(key),
        &table.key_path(key),
        fault,
        format!("write as many of both, such as {key} = [\"-20 deg\", \"20 deg\"]"),
    );
    None
}

fn control_surface(host: &mut dyn Host, table: &CheckedTable) -> Option<ControlSurface> {
    let effectiveness = match table.table("table") {
        Some(points) => effectiveness_table(host, points)?,
        None => Effectiveness::Constant(
            table
                .number("effectiveness")
                .or_else(|| table.number("chord_fraction").map(ControlSurface::thin_airfoil))?,
        ),
    };
    let mut gearing = [0.0; 4];
    for (value, stick) in gearing.iter_mut().zip(STICKS) {
        *value = table.number(stick)?;
    }
    Some(ControlSurface {
        effectiveness,
        gearing,
        rigging: table.number("rigging")?,
        limits: table.numbers("limits")?,
    })
}

fn effectiveness_table(host: &mut dyn Host, table: &CheckedTable) -> Option<Effectiveness> {
    let (deflection, shift) = (table.number_list("deflection")?, table.number_list("shift")?);
    let increasing = deflection.windows(2).all(|pair| pair[0] < pair[1]);
    let fault = if deflection.len() < 2 || !increasing {
        "deflections must increase strictly, and be two or more".to_owned()
    } else if shift.len() != deflection.len() {
        format!("there are {} deflections but {} shifts", deflection.len(), shift.len())
    } else {
        return Some(Effectiveness::Table { deflection, shift });
    };
    host.finding(
        Severity::Error,
        table.place("deflection"),
        &table.key_path("deflection"),
        fault,
        "write as many of both, such as deflection = [\"-20 deg\", \"20 deg\"]".into(),
    );
    None
}

fn incidence_schedule(host: &mut dyn Host, table: &CheckedTable) -> Option<IncidenceSchedule> {
    let (airspeed, incidence) = (table.number_list("airspeed")?, table.number_list("incidence")?);
    let increasing = airspeed.windows(2).all(|pair| pair[0] < pair[1]);
    let fault = if airspeed.len() < 2 || !increasing {
        "airspeeds must increase strictly, and be two or more".to_owned()
    } else if incidence.len() != airspeed.len() {
        format!("there are {} airspeeds but {} incidences", airspeed.len(), incidence.len())
    } else {
        return Some(IncidenceSchedule { airspeed, incidence });
    };
    host.finding(
        Severity::Error,
        table.place("airspeed"),
        &table.key_path("airspeed"),
        fault,
        "write as many of both, such as airspeed = [\"0 kt\", \"80 kt\"]".into(),
    );
    None
}

fn inflow(table: &CheckedTable) -> Option<InflowOptions> {
    let bandwidth = table.number("lowpass_bandwidth");
    Some(InflowOptions {
        interactions: table.flag("interactions")?,
        mass_flow: match table.choice("mass_flow")? {
            "total" => MassFlow::Total,
            _ => MassFlow::SelfInduced,
        },
        total_inflow: match table.choice("total_inflow")? {
            "lowpass" => TotalInflow::LowPass { bandwidth: bandwidth? },
            _ => TotalInflow::Algebraic,
        },
        wash_core: table.number("wash_core")?,
        reach: table.number("reach")?,
        wash_edge: table.number("wash_edge")?,
    })
}

/// Published formulas of teetering blades are for rotors that are resolved.
fn averages(host: &mut dyn Host, formulation: &Formulation, rotors: &[(String, CheckedTable)]) {
    let exact =
        formulation.teeter_torque_tilt && formulation.teeter_equation == TeeterEquation::Exact;
    for (_, table) in rotors {
        let averaged = table.choice("azimuth") == Some("averaged");
        if averaged && table.choice("hub") == Some("teetering") && !exact {
            host.finding(
                Severity::Error,
                table.place("azimuth"),
                &table.key_path("azimuth"),
                "a teetering rotor is averaged with exact mechanics only".into(),
                "write azimuth = \"resolved\", or remove `teeter_torque_tilt` and \
                 `teeter_equation` from [formulation]"
                    .into(),
            );
        }
    }
}

/// `teeters`: whether there is a teetering rotor.
fn formulation(host: &mut dyn Host, table: &CheckedTable, teeters: bool) -> Option<Formulation> {
    for key in ["teeter_torque_tilt", "teeter_equation"] {
        if table.given(key) && !teeters {
            host.finding(
                Severity::Warning,
                table.place(key),
                &table.key_path(key),
                "has no meaning without a teetering rotor, and is ignored".into(),
                "remove it".into(),
            );
        }
    }
    let (radii, skews) = (table.count("interference_radii"), table.count("interference_skews"));
    Some(Formulation {
        teeter_torque_tilt: table.flag("teeter_torque_tilt")?,
        teeter_equation: match table.choice("teeter_equation")? {
            "small_angles" => TeeterEquation::SmallAngles,
            _ => TeeterEquation::Exact,
        },
        interference_rule: match table.choice("interference_rule")? {
            "trapezoid" => InterferenceRule::Trapezoid { radii: radii?, skews: skews? },
            _ => InterferenceRule::Converged,
        },
        mirrored_interference: table.flag("mirrored_interference")?,
    })
}

fn controls(
    host: &mut dyn Host,
    table: &CheckedTable,
    rotors: &[(&str, f64)],
    lenient: bool,
) -> Option<Controls> {
    let mixes = table.named("mix");
    for (name, mix) in mixes {
        if !rotors.iter().any(|(rotor, _)| rotor == name) && !rotors.is_empty() {
            let help = nearest_help(name, rotors.iter().map(|(rotor, _)| *rotor), "rotors");
            host.finding(
                Severity::Error,
                &mix.place,
                &mix.path,
                format!("there is no rotor `{name}`"),
                help,
            );
        }
    }
    let mut mix = Vec::new();
    let mut collective_limits = Vec::new();
    let mut cyclic_limits = Vec::new();
    let mut speed_limits = Vec::new();
    let mut whole = true;
    for (rotor, speed) in rotors {
        let Some((_, entry)) = mixes.iter().find(|(name, _)| name == rotor) else {
            if !lenient && table.given("mix") {
                host.finding(
                    Severity::Error,
                    table.place("mix"),
                    &table.key_path(&format!("mix.{rotor}")),
                    "missing key: every rotor needs a mix".into(),
                    format!(
                        "add [controls.mix.{rotor}], with keys such as \
                         theta_0 = {{ col = \"20 deg/100%\" }}"
                    ),
                );
            }
            whole = false;
            continue;
        };
        match (
            rotor_mix(entry, *speed),
            entry.numbers("collective_limits"),
            entry.numbers("cyclic_limits"),
            entry.numbers("speed_limits"),
        ) {
            (Some(one), Some(collective), Some(cyclic), Some(speeds)) => {
                if [one.theta_0, one.theta_1c, one.theta_1s, one.speed]
                    .iter()
                    .flatten()
                    .all(|gearing| *gearing == 0.0)
                {
                    host.finding(
                        Severity::Warning,
                        &entry.place,
                        &entry.path,
                        "no stick moves this rotor".into(),
                        "add a gearing, such as theta_0 = { col = \"20 deg/100%\" }".into(),
                    );
                }
                mix.push(one);
                collective_limits.push(collective);
                cyclic_limits.push(cyclic);
                speed_limits.push(speeds);
            }
            _ => whole = false,
        }
    }
    let mut stick_limits = [[0.0; 2]; 4];
    for (limits, stick) in stick_limits.iter_mut().zip(STICKS) {
        *limits = table.table(stick)?.numbers("limits")?;
    }
    whole.then_some(Controls { stick_limits, mix, collective_limits, cyclic_limits, speed_limits })
}

/// `speed`: nominal speed of the rotor, rad/s.
fn rotor_mix(table: &CheckedTable, speed: f64) -> Option<RotorMix> {
    let gearing = |key: &str| -> Option<[f64; 4]> {
        let table = table.table(key)?;
        let mut values = [0.0; 4];
        for (value, stick) in values.iter_mut().zip(STICKS) {
            *value = table.number(stick)?;
        }
        Some(values)
    };
    let rigging = table.table("rigging")?;
    Some(RotorMix {
        theta_0: gearing("theta_0")?,
        theta_1c: gearing("theta_1c")?,
        theta_1s: gearing("theta_1s")?,
        rigging: [
            rigging.number("theta_0")?,
            rigging.number("theta_1c")?,
            rigging.number("theta_1s")?,
        ],
        speed: gearing("speed")?,
        speed_rigging: table.table("speed")?.number("rigging").unwrap_or(speed),
    })
}
