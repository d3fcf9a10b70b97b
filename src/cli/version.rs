//! The version, with the commit that the program was built from.

/// Version and commit, like `0.1.0 (1a2b3c4d5e6f)`; the version alone in
/// development builds, and where the sources came without their history.
pub(super) const LONG: &str = env!("COAXDESIGN_VERSION");
