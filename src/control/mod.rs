//! The control law, its specifications and its tuning.
