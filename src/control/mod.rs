//! The control law, its specifications and its tuning.
//!
//! * [`axis`]: axes, channels, effectors and gains.
//! * [`plant`]: what is known of aircraft and hardware, and the inversion.
//! * [`loops`]: closed loops in the frequency domain, affine in the gains.
//! * [`metrics`]: margins, disturbance rejection, bandwidth: one definition each.
//! * [`kite`]: the region around −1 that margins forbid.
//! * [`tuning`]: gains by a sequence of conic programs.
//! * [`stability`]: closed-loop eigenvalues of the full order.
//! * [`testbed`]: plants from published matrices for tests and benchmarks.

pub mod axis;
pub mod kite;
pub mod loops;
pub mod metrics;
pub mod plant;
pub mod stability;
pub mod testbed;
pub mod tuning;
