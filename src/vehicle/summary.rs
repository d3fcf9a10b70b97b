//! Numbers that rotorcraft are known by, derived from a problem.

use std::f64::consts::PI;

use crate::problem::{
    Airfoil, CoefficientGrid, HubKind, MassProperties, Problem, Rotor, Spanwise, Wing,
};
use crate::units::DEGREE;
use crate::units::STANDARD_GRAVITY;
use crate::vehicle::atmosphere::Air;
use crate::vehicle::interference::Interference;

/// Where the blade section stands for the whole blade, fraction of R.
const REPRESENTATIVE_STATION: f64 = 0.75;

/// Derived numbers of the whole aircraft.
#[derive(Debug, Clone, PartialEq)]
pub struct AircraftSummary {
    /// Weight under standard gravity, N.
    pub weight: f64,
    /// Principal moments of inertia, kg m², in increasing order.
    pub principal_inertia: [f64; 3],
    /// Sum of the disk areas, m²; overlap counts twice.
    pub disk_area: f64,
    /// Weight over the sum of the disk areas, Pa.
    pub disk_loading: f64,
    /// The air.
    pub air: Air,
}

/// Derived numbers of one rotor.
#[derive(Debug, Clone, PartialEq)]
pub struct RotorSummary {
    /// Hub position from the centre of gravity, body axes x, y, z, m.
    pub hub_from_center_of_gravity: [f64; 3],
    /// Disk area πR², m².
    pub disk_area: f64,
    /// Blade area over disk area, N_b ∫c dr/(πR²), from the axis to the tip.
    pub solidity: f64,
    /// Tip speed ΩR, m/s.
    pub tip_speed: f64,
    /// Tip Mach number in hover.
    pub tip_mach: f64,
    /// Lift-curve slope of the section at 0.75 R, at its Mach number in hover, 1/rad.
    pub lift_slope: f64,
    /// Lock number ρ a c R⁴/I_β, with a and c at 0.75 R; none without the inertia
    /// of a blade.
    pub lock_number: Option<f64>,
    /// Teeter frequency in vacuo, without undersling, per revolution:
    /// sqrt(1 + k/(2 I_β Ω²)). None for other hubs.
    pub teeter_frequency: Option<f64>,
    /// Centre of mass of a blade, M_β/m_b, fraction of R; none without mass.
    pub blade_mass_center: Option<f64>,
}

/// Derived numbers of the aircraft.
pub fn aircraft(problem: &Problem) -> AircraftSummary {
    let weight = problem.mass.mass * STANDARD_GRAVITY;
    let disk_area: f64 = problem.rotors.iter().map(|rotor| PI * rotor.radius * rotor.radius).sum();
    AircraftSummary {
        weight,
        principal_inertia: principal_inertia(&problem.mass),
        disk_area,
        disk_loading: weight / disk_area,
        air: Air::at(&problem.atmosphere),
    }
}

fn principal_inertia(mass: &MassProperties) -> [f64; 3] {
    let tensor = nalgebra::Matrix3::new(
        mass.i_xx, -mass.i_xy, -mass.i_xz, //
        -mass.i_xy, mass.i_yy, -mass.i_yz, //
        -mass.i_xz, -mass.i_yz, mass.i_zz,
    );
    let mut moments: [f64; 3] = tensor.symmetric_eigenvalues().into();
    moments.sort_by(f64::total_cmp);
    moments
}

/// Derived numbers of a rotor of the problem.
pub fn rotor(problem: &Problem, rotor: &Rotor) -> RotorSummary {
    let air = Air::at(&problem.atmosphere);
    let center = &problem.mass.center_of_gravity;
    let radius = rotor.radius;
    let disk_area = PI * radius * radius;
    let tip_speed = rotor.speed * radius;
    let tip_mach = tip_speed / air.sound_speed;
    let lift_slope = lift_slope(&rotor.airfoil, REPRESENTATIVE_STATION * tip_mach);
    let chord = rotor.chord.at(REPRESENTATIVE_STATION);
    let inertia = rotor.blade_second_moment;
    RotorSummary {
        hub_from_center_of_gravity: [
            center.fuselage_station - rotor.hub.fuselage_station,
            rotor.hub.butt_line - center.butt_line,
            center.water_line - rotor.hub.water_line,
        ],
        disk_area,
        solidity: rotor.blades as f64 * mean(&rotor.chord) * radius / disk_area,
        tip_speed,
        tip_mach,
        lift_slope,
        lock_number: (inertia > 0.0)
            .then(|| air.density * lift_slope * chord * radius.powi(4) / inertia),
        teeter_frequency: match rotor.hub_kind {
            HubKind::Teetering { spring, .. } => {
                Some((1.0 + spring / (2.0 * inertia * rotor.speed.powi(2))).sqrt())
            }
            _ => None,
        },
        blade_mass_center: (rotor.blade_mass > 0.0)
            .then(|| rotor.blade_first_moment / (rotor.blade_mass * radius)),
    }
}

/// Mean inflow over the receiving disk in hover, over the uniform inflow of
/// the source, in the speed of the flow: 2 G11 at no skew. Far below a rotor
/// this is 2, at its own disk 1, and far above it 0.
pub fn hover_interference(interference: &Interference) -> f64 {
    2.0 * interference.evaluate([0.0, 0.0])[(0, 0)]
}

/// Planform area of a wing, m².
pub fn wing_area(wing: &Wing) -> f64 {
    wing.span * mean(&wing.chord)
}

/// Mean over the span from 0 to 1, exact for the broken line.
fn mean(spanwise: &Spanwise) -> f64 {
    let mut stations = vec![0.0];
    stations.extend(&spanwise.station);
    stations.push(1.0);
    stations
        .windows(2)
        .map(|pair| (pair[1] - pair[0]) * 0.5 * (spanwise.at(pair[0]) + spanwise.at(pair[1])))
        .sum()
}

/// Slope of the lift between -2° and 2°, 1/rad.
fn lift_slope(airfoil: &Airfoil, mach: f64) -> f64 {
    match airfoil {
        Airfoil::Analytic { lift_slope, .. } => *lift_slope,
        Airfoil::Table(table) => {
            let angle = 2.0 * DEGREE;
            (lift(&table.lift, angle, mach) - lift(&table.lift, -angle, mach)) / (2.0 * angle)
        }
    }
}

/// Bilinear look-up; it only serves numbers to look at.
fn lift(grid: &CoefficientGrid, angle: f64, mach: f64) -> f64 {
    let along = |row: usize| {
        let width = grid.mach.len();
        let values = grid.value[row * width..(row + 1) * width].to_vec();
        let line = Spanwise { station: grid.mach.clone(), value: values };
        line.at(mach)
    };
    let lifts = Spanwise {
        station: grid.angle_of_attack.clone(),
        value: (0..grid.angle_of_attack.len()).map(along).collect(),
    };
    lifts.at(angle)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// The broken line's mean is exact, inside and beyond its stations.
    #[test]
    fn mean_of_a_broken_line() {
        let line = Spanwise { station: vec![0.25, 0.75], value: vec![1.0, 3.0] };
        assert_relative_eq!(mean(&line), 0.25 * 1.0 + 0.5 * 2.0 + 0.25 * 3.0);
    }

    /// Table 1 of the paper by hand: σ = 2·0.72/(π 10.66), ΩR = 507.9 ft/s,
    /// W/(2πR²) = 1.3894 lbf/ft², a = 0.1065/deg Prandtl-Glauert corrected.
    #[test]
    fn val_numbers_of_the_coax2d() {
        let problem = crate::problem::builtin().unwrap().problem;
        let upper = rotor(&problem, &problem.rotors[0]);
        assert_relative_eq!(upper.solidity, 0.042_999, max_relative = 1e-4);
        assert_relative_eq!(upper.tip_speed, 507.949 * 0.3048, max_relative = 1e-5);
        assert_relative_eq!(upper.tip_mach, 0.4549, max_relative = 1e-3);
        let whole = aircraft(&problem);
        assert_relative_eq!(whole.disk_loading, 1.389_36 * 47.880_26, max_relative = 1e-4);
        // Its section slope is 0.1065 per degree at low Mach numbers.
        let mach = 0.75 * upper.tip_mach;
        let expected = 0.1065 / DEGREE / (1.0 - mach * mach).sqrt();
        assert_relative_eq!(upper.lift_slope, expected, max_relative = 0.02);
        assert_eq!(upper.teeter_frequency, Some(1.0));
        assert!(upper.hub_from_center_of_gravity[0] < 0.0);
        assert!(upper.hub_from_center_of_gravity[2] < 0.0);
    }
}
