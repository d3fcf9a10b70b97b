//! Rotor-on-rotor interference by skewed vortex cylinders.
