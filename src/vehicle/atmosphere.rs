//! US Standard Atmosphere 1976, from below sea level to 32 km.

use crate::problem::AtmosphereConditions;
use crate::units::STANDARD_GRAVITY;

/// Specific gas constant of air, J/(kg K) (US Standard Atmosphere 1976: R*/M0).
const GAS_CONSTANT: f64 = 8.314_32e3 / 28.9644;
/// Ratio of specific heats of air.
const HEAT_RATIO: f64 = 1.4;
/// Base altitude (geopotential m), base temperature (K), lapse rate (K/m).
const LAYERS: [(f64, f64, f64); 3] =
    [(0.0, 288.15, -6.5e-3), (11_000.0, 216.65, 0.0), (20_000.0, 216.65, 1.0e-3)];
/// Sea-level standard pressure, Pa.
const SEA_LEVEL_PRESSURE: f64 = 101_325.0;

/// Air at one place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Air {
    /// Density ρ, kg/m³.
    pub density: f64,
    /// Speed of sound, m/s.
    pub sound_speed: f64,
    /// Temperature, K.
    pub temperature: f64,
    /// Static pressure, Pa.
    pub pressure: f64,
}

impl Air {
    /// Air at a pressure altitude, its temperature off the standard day by
    /// the given offset: the pressure is that of the standard day, the density
    /// follows from the gas law.
    #[must_use]
    pub fn at(conditions: &AtmosphereConditions) -> Self {
        let altitude = conditions.altitude;
        let mut pressure = SEA_LEVEL_PRESSURE;
        let mut standard_temperature = LAYERS[0].1;
        for (index, &(base, base_temperature, lapse)) in LAYERS.iter().enumerate() {
            let top = LAYERS.get(index + 1).map_or(f64::INFINITY, |layer| layer.0);
            let height = altitude.min(top) - base;
            if index > 0 && height <= 0.0 {
                break;
            }
            standard_temperature = base_temperature + lapse * height;
            pressure *= if lapse == 0.0 {
                (-STANDARD_GRAVITY * height / (GAS_CONSTANT * base_temperature)).exp()
            } else {
                (standard_temperature / base_temperature)
                    .powf(-STANDARD_GRAVITY / (GAS_CONSTANT * lapse))
            };
        }
        let temperature = standard_temperature + conditions.temperature_offset;
        Self {
            density: pressure / (GAS_CONSTANT * temperature),
            sound_speed: (HEAT_RATIO * GAS_CONSTANT * temperature).sqrt(),
            temperature,
            pressure,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Tables of the US Standard Atmosphere 1976.
    #[test]
    fn val_standard_atmosphere_table() {
        for (altitude, temperature, pressure, density, sound) in [
            (0.0, 288.15, 101_325.0, 1.2250, 340.294),
            (5_000.0, 255.650, 54_019.9, 0.73612, 320.529),
            (11_000.0, 216.650, 22_632.1, 0.36392, 295.069),
            (15_000.0, 216.650, 12_044.6, 0.19367, 295.069),
            (25_000.0, 221.650, 2_511.02, 0.039466, 298.455),
        ] {
            let air = Air::at(&AtmosphereConditions { altitude, temperature_offset: 0.0 });
            assert_relative_eq!(air.temperature, temperature, max_relative = 1e-6);
            assert_relative_eq!(air.pressure, pressure, max_relative = 2e-5);
            assert_relative_eq!(air.density, density, max_relative = 4e-5);
            assert_relative_eq!(air.sound_speed, sound, max_relative = 1e-5);
        }
    }

    /// A hot day is thinner by the ratio of temperatures.
    #[test]
    fn hot_day_thins_the_air() {
        let standard =
            Air::at(&AtmosphereConditions { altitude: 1_000.0, temperature_offset: 0.0 });
        let hot = Air::at(&AtmosphereConditions { altitude: 1_000.0, temperature_offset: 20.0 });
        assert_relative_eq!(
            hot.density / standard.density,
            standard.temperature / hot.temperature,
            max_relative = 1e-12
        );
        assert_eq!(hot.pressure, standard.pressure);
    }
}
