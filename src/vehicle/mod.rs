//! The time-periodic flight dynamics of a rotorcraft.

pub mod airfoil;
pub mod interference;
