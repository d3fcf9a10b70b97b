//! The control law, its specifications and its tuning.
//!
//! * [`axis`]: axes, channels, effectors and gains.
//! * [`plant`]: what is known of aircraft and hardware, and the inversion.
//! * [`loops`]: closed loops in the frequency domain, affine in the gains.
//! * [`metrics`]: margins, disturbance rejection, bandwidth: one definition each.
//! * [`kite`]: the region around −1 that margins forbid.
//! * [`tuning`]: gains by a sequence of conic programs.
//! * [`spec`]: the specification file.
//! * [`stability`]: closed-loop eigenvalues of the full order.
//! * [`closed_loop`]: the loop of the law as it is flown, read from its block diagram.
//! * [`law`]: the law over speed, and stepping in discrete time.
//! * [`models`]: from a problem to the plants of every model and speed.
//! * [`verify`]: dense verification, authority, design margins.
//! * [`design`]: from a specification to a tuned law.
//! * [`explain`]: what binds, best attainable values and the keys to change.
//! * [`testbed`]: plants from published matrices for tests and benchmarks.

pub mod axis;
pub mod closed_loop;
pub mod design;
pub mod explain;
pub mod kite;
pub mod law;
pub mod loops;
pub mod metrics;
pub mod misses;
pub mod models;
pub mod plant;
pub mod spec;
pub mod stability;
pub mod testbed;
pub mod tuning;
pub mod verify;
