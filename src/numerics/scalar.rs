//! Real numbers and forward-mode duals behind one trait.
