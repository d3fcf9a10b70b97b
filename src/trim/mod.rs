//! Periodic trim.
