//! The control law as a block diagram in data.
//!
//! Everything that runs, judges, prints or draws the law is read from one
//! [`Diagram`]: a list of named blocks joined by wires.
//!
//! * [`diagram`]: blocks, wires, memories and delay lines; the parts that laws
//!   are made of, such as command models and notch filters.
//! * [`mdi`]: the multi-loop dynamic-inversion law. Each formula of the law
//!   stands there, once.
//! * [`program`]: the diagram as a flat list of operations, for stepping.
//! * [`linear`]: the diagram for small deviations: a state space with names.
//! * [`tables`]: names, units and order of the tables over airspeed.
//!
//! The module knows neither plants nor requirements: it reads numbers from
//! tables and does not ask where they come from.

pub mod diagram;
pub mod linear;
pub mod mdi;
pub mod program;
pub mod tables;

pub use diagram::{Block, Diagram, Kind, Wire};
pub use linear::LinearLaw;
pub use program::{Breakpoints, Memory, Program};
