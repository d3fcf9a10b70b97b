//! Numerical methods that know nothing of aircraft.
//!
//! * [`scalar`]: real numbers and forward-mode duals behind one trait.
//! * [`interpolation`]: smooth tables in one and two variables.
//! * [`quadrature`]: Gauss–Legendre and periodic rules.
//! * [`integration`]: fixed-step Runge–Kutta of known order.
//! * [`least_squares`]: bounded Levenberg–Marquardt as an argmin solver.
//! * [`conic`]: convex quadratic programs over half-spaces and second-order cones.

pub mod conic;
pub mod integration;
pub mod interpolation;
pub mod least_squares;
pub mod quadrature;
pub mod scalar;
