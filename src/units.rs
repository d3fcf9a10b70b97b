//! The only conversion constants of the project, and quantities with units.
//!
//! Inside the library everything is SI and radians. A [`Kind`] says what a
//! number measures and how to write it for people in either [`System`].
