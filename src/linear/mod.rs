//! Linear models of the periodic dynamics.
