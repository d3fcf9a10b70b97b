//! A flight made ready: problem, variation, law and manoeuvre together.

use super::flight::{Autopilot, Flight, FlightError};
use super::maneuver::{Maneuver, Mode};
use super::montecarlo::Variation;
use super::simulator::Options;
use crate::control::spec;
use crate::problem::{Problem, Report};
use crate::schedule::{Schedule, ScheduleError};
use crate::trim::{ConvergedTrim, Options as TrimOptions, TrimPoint, sweep};
use crate::vehicle::{Vehicle, VehicleError};

/// Everything that a flight needs but its vehicle and its trim, which borrow
/// from it.
#[derive(Debug, Clone)]
pub struct Setup {
    /// The problem as read.
    pub problem: Problem,
    /// How it is varied.
    pub variation: Variation,
    /// The law, if there is one.
    pub autopilot: Option<Autopilot>,
    /// The manoeuvre as its file has it.
    pub as_read: Maneuver,
    /// The manoeuvre in the varied air.
    pub maneuver: Maneuver,
    /// How to simulate; the delay of the variation is in it.
    pub options: Options,
}

/// Why a flight cannot be made ready.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// A manoeuvre under a law, without one.
    #[error("the manoeuvre is flown by a control law, but no schedule is given")]
    NoSchedule,
    /// The schedule holds no law.
    #[error(transparent)]
    Schedule(#[from] ScheduleError),
    /// The built-in specification does not read.
    #[error(transparent)]
    Specification(#[from] Report),
    /// No vehicle can be built of the varied problem.
    #[error(transparent)]
    Vehicle(#[from] VehicleError),
    /// No trim to start from: the point that was reached.
    #[error("no trim to start from: {}", .0.status.word())]
    NoTrim(Box<TrimPoint>),
    /// The flight cannot begin.
    #[error(transparent)]
    Flight(#[from] FlightError),
}

impl Setup {
    /// A flight of the manoeuvre with the varied problem. The hardware is the
    /// schedule's, or that of the built-in specification without one; blade
    /// pitch has the rate limit of the built-in specification. Other options
    /// may be set afterwards.
    ///
    /// # Errors
    /// A manoeuvre that needs a law where no schedule is given, and a schedule
    /// that holds none.
    pub fn new(
        problem: Problem,
        schedule: Option<&Schedule>,
        as_read: Maneuver,
        variation: Variation,
    ) -> Result<Self, SetupError> {
        let maneuver = variation.fly_in(&as_read);
        if maneuver.mode != Mode::OpenLoop && schedule.is_none() {
            return Err(SetupError::NoSchedule);
        }
        let autopilot = schedule
            .map(|schedule| -> Result<Autopilot, ScheduleError> {
                Ok(Autopilot { table: schedule.law()?, stick_limits: schedule.stick_limits })
            })
            .transpose()?;
        let specification = spec::builtin()?;
        let hardware = schedule.map_or(specification.hardware, |schedule| schedule.hardware);
        let options = Options {
            extra_delay: variation.delay,
            ..Options::new(hardware, specification.pitch_rate_limit)
        };
        Ok(Self { problem, variation, autopilot, as_read, maneuver, options })
    }

    /// The vehicle that flies.
    ///
    /// # Errors
    /// A problem of which no model can be built.
    pub fn vehicle(&self) -> Result<Vehicle, VehicleError> {
        self.variation.vehicle(&self.problem)
    }

    /// The trim that the manoeuvre starts from.
    ///
    /// # Errors
    /// [`SetupError::NoTrim`], with the point that was reached.
    pub fn start(&self, vehicle: &Vehicle) -> Result<ConvergedTrim, SetupError> {
        let condition = self.maneuver.start.condition;
        let mut found = sweep(vehicle, &[condition], &TrimOptions::default(), |_| {});
        // A sweep gives a point for every condition.
        let point = found.points.remove(0);
        point.into_converged().map_err(SetupError::NoTrim)
    }

    /// The flight, about to begin.
    ///
    /// # Errors
    /// As [`Flight::new`].
    pub fn flight<'a>(
        &'a self,
        vehicle: &'a Vehicle,
        start: &ConvergedTrim,
    ) -> Result<Flight<'a>, SetupError> {
        Ok(Flight::new(vehicle, start, self.autopilot.as_ref(), &self.maneuver, &self.options)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::maneuver;

    fn problem() -> Problem {
        crate::problem::builtin().unwrap().problem
    }

    fn doublet() -> Maneuver {
        maneuver::builtin("lateral-doublet").unwrap().unwrap()
    }

    #[test]
    fn a_law_is_asked_for_where_the_maneuver_needs_one() {
        let slalom = maneuver::builtin("slalom").unwrap().unwrap();
        let refused = Setup::new(problem(), None, slalom, Variation::default());
        assert!(matches!(refused, Err(SetupError::NoSchedule)));
    }

    /// The variation reaches the vehicle, the air and the delay.
    #[test]
    fn the_variation_is_flown() {
        let variation = Variation { mass: 1.1, delay: 0.02, ..Variation::default() };
        let setup = Setup::new(problem(), None, doublet(), variation).unwrap();
        let nominal = Setup::new(problem(), None, doublet(), Variation::default()).unwrap();
        let (heavy, plain) = (setup.vehicle().unwrap(), nominal.vehicle().unwrap());
        assert!((heavy.mass / plain.mass - 1.1).abs() < 1e-12);
        assert_eq!(setup.options.extra_delay, 0.02);
        assert_eq!(nominal.options.extra_delay, 0.0);
        let start = setup.start(&heavy).unwrap();
        assert!(start.point().power.shaft > nominal.start(&plain).unwrap().point().power.shaft);
        let mut flight = setup.flight(&heavy, &start).unwrap();
        flight.decide();
        assert_eq!(flight.advance(), Ok(()));
        assert!(flight.simulator.time() > 0.0);
    }
}
