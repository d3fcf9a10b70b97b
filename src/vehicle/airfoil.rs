//! Section aerodynamics from tables or analytic pairs.
