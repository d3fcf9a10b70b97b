//! Smooth interpolation in tables.
