//! The CoAX 2D: Kreienkamp, Saetti, Özkurt and Fichter, *Flight Dynamics and
//! Control of a Coaxial-Teetering Rotor Ultralight Helicopter with
//! Rotor-on-Rotor Interactions*.
//!
//! * [`table2`]: the printed hover performance.
//! * [`appendix`]: the printed matrices, and [`entries`] and [`eigenvalues`]
//!   of them beside ours.
//! * [`claims`]: what the text says of curves without numbers.
//! * [`hypotheses`]: what was tried on numbers that do not fit, one problem
//!   file each in the folder `hypotheses`.
//!
//! `coaxdesign validate` writes the page [`PAGE`] with tables of all of it.

pub mod appendix;
pub mod claims;
pub mod eigenvalues;
pub mod entries;
pub mod hypotheses;
pub mod table2;

/// The text of the validation page, with a line `<!-- study: NAME -->` where
/// the table of a study of [`hypotheses`] stands.
pub const PAGE: &str = include_str!("page.md");
