//! Every identity of the validation page, for all built-in problems.

mod common;

use coaxdesign::validation::identities;
use common::problem;

#[test]
fn identities_hold() {
    for name in ["coax2d", "coax2d-appendix", "coax2d-physics"] {
        let list = identities(&problem(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(list.len() >= 20, "{name}: only {} identities", list.len());
        for identity in &list {
            println!(
                "{name}: {}, {}: {:.1e} of {:.1e}",
                identity.statement, identity.case, identity.error, identity.tolerance
            );
            assert!(identity.holds(), "{name}: {identity:?}");
        }
    }
}
