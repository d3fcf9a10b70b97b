//! From a description of a rotorcraft to a flyable gain schedule.
//!
//! Data flows one way down this street; a module uses only those above it.
//!
//! * [`units`]: the only conversion constants, and quantities with units.
//! * [`numerics`]: interpolation, quadrature, derivatives, least squares, conic programs.
//! * [`law`]: the control law as a block diagram in data, from which it is stepped, linearised and written.
//! * [`problem`]: a TOML file becomes checked data, every error of it reported at once.
//! * [`vehicle`]: the time-periodic dynamics `xdot = f(azimuth, x, u)`.
//! * [`trim`]: the periodic orbit of a flight condition.
//! * [`linear`]: linear time-periodic and time-invariant models along that orbit.
//! * [`lti`]: linear models from elsewhere, and one stitched model of them.
//! * [`control`]: the control law, its specifications and metrics, and its tuning.
//! * [`schedule`]: the gain schedule as a file.
//! * [`simulate`]: flight in time of the full nonlinear vehicle under the law.
//! * [`export`]: the schedule in the forms of other programs, and back.
//! * [`validation`]: identities that must hold whatever the numbers, and the paper's numbers.
//! * [`pipeline`]: all stages, one after the other, as the program runs them.
//! * [`studies`]: publications beside our results.
//! * [`report`]: tables and plots of what the stages found.
//!
//! # From a file to a flight
//!
//! A problem file becomes a vehicle, the vehicle a trim, the trim a linear
//! model. Inside the library every number is SI and radians; [`units`] has the
//! constants for everything else.
//!
//! ```
//! use coaxdesign::linear::linearize::{Options as LinearOptions, averaged};
//! use coaxdesign::linear::modes::modes;
//! use coaxdesign::linear::reduction::{RIGID_BODY, residualise};
//! use coaxdesign::trim::{self, FlightCondition};
//! use coaxdesign::units::{HORSEPOWER, KNOT};
//! use coaxdesign::{problem, vehicle::Vehicle};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let loaded = problem::builtin()?;
//! let vehicle = Vehicle::new(&loaded.problem)?;
//!
//! let condition = FlightCondition::level(40.0 * KNOT);
//! let point = trim::trim_at(&vehicle, condition, &trim::Options::default());
//! assert!(point.power.shaft < 50.0 * HORSEPOWER);
//!
//! // Only a trim that has converged can be linearised.
//! let trim = point.into_converged().map_err(|point| format!("{:?}", point.status))?;
//! let full = averaged(&vehicle, &trim, &LinearOptions::default())?;
//! let reduced = residualise(&full, &RIGID_BODY)?.model;
//! assert_eq!(reduced.states().len(), 8);
//! assert!(modes(&reduced)?.iter().any(|mode| mode.oscillates()));
//! # Ok(())
//! # }
//! ```
//!
//! A specification says what the gains must meet; tuning makes a law of it,
//! and verification looks at that law by other means.
//!
//! ```no_run
//! use coaxdesign::pipeline::{Requirements, Silent, TuneOptions, tune};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let aircraft = coaxdesign::problem::builtin()?;
//! let tuned = tune(&aircraft, &Requirements::builtin()?, &TuneOptions::default(), &Silent)?;
//! std::fs::write("schedule.json", tuned.schedule.to_json()?)?; // as `coaxdesign tune-gains`
//! println!("met: {}", tuned.verified.met());
//! # Ok(())
//! # }
//! ```
//!
//! What a tuning leaves behind is a schedule, which can be read back and flown.
//!
//! ```
//! use coaxdesign::control::axis::Channel;
//! use coaxdesign::schedule::Schedule;
//! use coaxdesign::units::KNOT;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let text = std::fs::read_to_string("designs/coax2d/schedule.json")?;
//! let law = Schedule::from_json(&text)?.law()?;
//! // Between breakpoints everything is interpolated linearly in airspeed.
//! let [at, low, high] = [25.0, 20.0, 30.0].map(|knots| {
//!     law.at(knots * KNOT).gains[Channel::Roll.index()].k_p
//! });
//! assert!((at - 0.5 * (low + high)).abs() < 1e-9);
//! # Ok(())
//! # }
//! ```
//!
//! A manoeuvre flies it on the whole nonlinear vehicle, from a trim.
//!
//! ```
//! use coaxdesign::control::spec;
//! use coaxdesign::schedule::Schedule;
//! use coaxdesign::simulate::flight::Autopilot;
//! use coaxdesign::simulate::{Flight, Options, Status, maneuver};
//! use coaxdesign::trim::{self, FlightCondition};
//! use coaxdesign::{problem, vehicle::Vehicle};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let vehicle = Vehicle::new(&problem::builtin()?.problem)?;
//! let text = r#"
//!     title = "Two seconds of hover"
//!     duration = "2 s"
//!     mode = "velocity"
//! "#;
//! let hover = maneuver::parse("hover.toml", text).map_err(|report| report.to_string())?;
//! let condition = hover.start.condition;
//! let point = trim::trim_at(&vehicle, condition, &trim::Options::default());
//! let start = point.into_converged().map_err(|point| format!("{:?}", point.status))?;
//!
//! let schedule = Schedule::from_json(&std::fs::read_to_string("designs/coax2d/schedule.json")?)?;
//! let law = Autopilot { table: schedule.law()?, stick_limits: schedule.stick_limits };
//! let options = Options::new(schedule.hardware, spec::builtin()?.pitch_rate_limit);
//! let mut flight = Flight::new(&vehicle, &start, Some(&law), &hover, &options)?;
//! assert_eq!(flight.fly(|_| {}), Status::Completed);
//! let [north, east, _] = flight.simulator.position();
//! assert!(north.hypot(east) < 1.0, "drifted {north} m, {east} m");
//! # Ok(())
//! # }
//! ```
//!
//! Exports are files of other programs, proven in them.
//!
//! ```
//! use coaxdesign::export::{self, Format, Precision};
//! use coaxdesign::schedule::Schedule;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let schedule = Schedule::from_json(&std::fs::read_to_string("designs/coax2d/schedule.json")?)?;
//! let options = export::Options {
//!     name: "coax".into(),
//!     step: 0.01,
//!     precision: Precision::Double,
//!     speed: 0.0,
//!     binaries: Vec::new(),
//! };
//! let files = export::export(&schedule, Vec::new(), Format::C, &options)?;
//! assert!(files.iter().any(|file| file.name == "coax_law.h"));
//! # Ok(())
//! # }
//! ```
//!
//! Reports draw what they are given, as text, SVG or one HTML page.
//!
//! ```
//! use coaxdesign::report::html::{Page, Section};
//! use coaxdesign::report::plot::{Axis, Figure, Panel, Series};
//!
//! let power = Panel::new(Axis::linear("airspeed", "kt"), Axis::linear("power", "hp"))
//!     .line(Series::new("interactions on", &[0.0, 40.0, 80.0], &[76.0, 40.0, 107.0]).marks());
//! let page = Page::new("A rotorcraft")
//!     .section(Section::new("Trim").figure(Figure::new("Power").panel(power), "Level flight."));
//! assert!(page.to_html().starts_with("<!DOCTYPE html>"));
//! ```
//!
//! `examples/own_rotorcraft.rs` does the first of these for a helicopter with
//! main and tail rotor.

pub mod control;
pub mod export;
pub mod law;
pub mod linear;
pub mod lti;
pub mod numerics;
pub mod pipeline;
pub mod problem;
pub mod report;
pub mod schedule;
pub mod simulate;
pub mod studies;
pub mod trim;
pub mod units;
pub mod validation;
pub mod vehicle;
