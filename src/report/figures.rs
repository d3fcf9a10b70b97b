//! The ready-made figures of this field, from plain data.
