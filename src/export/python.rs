//! The tables as JSON, with a reader in pure Python that also runs the law and
//! makes linear models of it for python-control.

use super::text::{comment, fill};
use super::{File, Input, json};

const READER: &str = include_str!("templates/law.py.in");

/// Tables and reader.
pub(super) fn files(input: &Input) -> Vec<File> {
    let name = &input.options.name;
    // The banner stands in a docstring.
    let banner = comment(&input.description.banner(), "", 96);
    let reader = fill(READER, &[("BANNER", &banner), ("P", name)]);
    vec![
        File::text(format!("{name}.json"), json(input.description)),
        File::text(format!("{name}_law.py"), reader),
    ]
}
