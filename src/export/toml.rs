//! The description as TOML: the same keys as in JSON.

use super::{ExportError, File, Input};

pub(super) fn files(input: &Input) -> Result<Vec<File>, ExportError> {
    let mut text = String::new();
    for warning in &input.description.warnings {
        text += &format!("# WARNING: {}\n", warning.replace('\n', " "));
    }
    text += &::toml::to_string(input.description)
        .map_err(|e| ExportError::Format { format: "toml", reason: e.to_string() })?;
    Ok(vec![File::text(format!("{}.toml", input.options.name), text)])
}
