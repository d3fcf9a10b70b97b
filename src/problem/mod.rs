//! From a TOML problem file to checked data.

pub mod model;

pub use model::*;
