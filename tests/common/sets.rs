//! Sets of linear models that several tests use.

use coaxdesign::linear::StateSpace;
use coaxdesign::linear::set::{ModelSet, TrimValues};
use coaxdesign::lti::mapping::Mapping;
use coaxdesign::lti::{LtiSet, load};
use std::path::{Path, PathBuf};

/// A set of `examples/models`.
pub fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/models").join(name)
}

/// The example of the UH-60A.
#[allow(dead_code)]
pub fn uh60a() -> LtiSet {
    load(&example("uh60a"), &Mapping::default()).unwrap_or_else(|r| panic!("{r}"))
}

/// Limits of the sticks of [`own_set`].
#[allow(dead_code)]
pub const OWN_LIMITS: [[f64; 2]; 4] = [[0.0, 100.0], [-5.0, 95.0], [0.0, 110.0], [0.0, 100.0]];

/// The example as a set of our own, with trims.
#[allow(dead_code)]
pub fn own_set() -> ModelSet {
    let set = uh60a();
    let trims = set.models.iter().map(|m| {
        let t = &m.trim;
        let [u, v, w] = t.velocity_body;
        TrimValues {
            states: vec![u, v, w, 0.0, 0.0, 0.0, t.roll, t.pitch],
            inputs: t.sticks.to_vec(),
            limits: OWN_LIMITS.to_vec(),
        }
    });
    let models = set.models.iter().map(|m| {
        // As `linearize` writes it: outputs are the states.
        let m = &m.model;
        let (states, inputs) = (m.states().to_vec(), m.inputs().to_vec());
        StateSpace::with_state_outputs(states, inputs, m.a().clone(), m.b().clone()).unwrap()
    });
    ModelSet::new(None, set.speeds(), models.collect())
        .and_then(|own| own.with_trims(trims.collect()))
        .unwrap()
}
