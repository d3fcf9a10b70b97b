//! The whole law as an FMI 2.0 unit for co-simulation, made of the C export.

use std::io::{Cursor, Write as _};

use super::text::{comment, fill, number, xml};
use super::{ExportError, File, Input, Precision, c};
use crate::schedule::hash;

const SOURCE: &str = include_str!("templates/fmu.c");

/// Real inputs in the order of their value references: name, unit, meaning.
const INPUTS: [(&str, &str, &str); 14] = [
    ("u", "m/s", "velocity over the ground, body axes, forward"),
    ("v", "m/s", "velocity over the ground, body axes, to the right"),
    ("w", "m/s", "velocity over the ground, body axes, down"),
    ("p", "rad/s", "roll rate"),
    ("q", "rad/s", "pitch rate"),
    ("r", "rad/s", "yaw rate"),
    ("phi", "rad", "bank angle"),
    ("theta", "rad", "pitch angle"),
    ("airspeed", "m/s", "true airspeed, at which the tables are read"),
    ("command_1", "1", "bank, rad; or velocity forward, m/s"),
    ("command_2", "1", "pitch, rad; or velocity to the right, m/s"),
    ("heading_rate", "rad/s", "demanded heading rate"),
    ("v_z_command", "m/s", "demanded vertical velocity, down positive"),
    ("reset", "1", "above 0.5: the law starts anew"),
];

const OUTPUTS: [(&str, &str); 4] = [
    ("lat", "lateral stick"),
    ("lon", "longitudinal stick"),
    ("col", "collective"),
    ("ped", "pedals"),
];

fn guid(input: &Input) -> String {
    let (header, source) = c::texts(input);
    hash([header.as_str(), source.as_str(), SOURCE])
}

/// Sources of the shared object.
pub(super) fn sources(input: &Input) -> Vec<File> {
    let (name, d) = (&input.options.name, input.description);
    let (header, source) = c::texts(input);
    let warnings: Vec<String> = d.warnings.iter().map(|w| format!("WARNING: {w}")).collect();
    let unit = fill(
        SOURCE,
        &[
            ("WARNINGS", &comment(&warnings, " * ", 96)),
            ("GUID", &guid(input)),
            ("U", &name.to_uppercase()),
            ("P", name),
        ],
    );
    vec![
        File::text(format!("{name}_fmu.c"), unit),
        File::text(format!("{name}_law.c"), source),
        File::text(format!("{name}_law.h"), header),
    ]
}

fn model_description(input: &Input) -> String {
    let (name, d) = (&input.options.name, input.description);
    let mut variables = String::new();
    for (k, (variable, unit, meaning)) in INPUTS.iter().enumerate() {
        variables += &format!(
            "    <ScalarVariable name=\"{variable}\" valueReference=\"{k}\" causality=\"input\" \
             variability=\"continuous\" description=\"{meaning}\">\n      <Real start=\"0\" \
             unit=\"{unit}\"/>\n    </ScalarVariable>\n"
        );
    }
    for (k, (variable, meaning)) in (INPUTS.len()..).zip(OUTPUTS) {
        variables += &format!(
            "    <ScalarVariable name=\"{variable}\" valueReference=\"{k}\" causality=\"output\" \
             variability=\"continuous\" initial=\"calculated\" description=\"{meaning}\">\n      \
             <Real unit=\"%\"/>\n    </ScalarVariable>\n"
        );
    }
    variables += &format!(
        "    <ScalarVariable name=\"mode\" valueReference=\"{}\" causality=\"input\" \
         variability=\"discrete\" description=\"0: commands are attitudes; 1: velocities\">\n      \
         <Integer start=\"0\" min=\"0\" max=\"1\"/>\n    </ScalarVariable>\n",
        INPUTS.len() + OUTPUTS.len()
    );
    let outputs: String = (INPUTS.len() + 1..=INPUTS.len() + OUTPUTS.len())
        .map(|k| format!("      <Unknown index=\"{k}\" dependencies=\"\"/>\n"))
        .collect();
    let status = if d.warnings.is_empty() {
        String::new()
    } else {
        format!(" WARNING: {}", d.warnings.join("; "))
    };
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiModelDescription fmiVersion=\"2.0\" \
         modelName=\"{name}\" guid=\"{}\" description=\"{}\" \
         generationTool=\"coaxdesign {}\" variableNamingConvention=\"flat\" \
         numberOfEventIndicators=\"0\">\n  <CoSimulation modelIdentifier=\"{name}\" \
         canHandleVariableCommunicationStepSize=\"true\" canGetAndSetFMUstate=\"true\">\n    \
         <SourceFiles>\n      <File name=\"{name}_fmu.c\"/>\n      <File name=\"{name}_law.c\"/>\n    \
         </SourceFiles>\n  </CoSimulation>\n  <UnitDefinitions>\n    \
         <Unit name=\"1\"><BaseUnit/></Unit>\n    \
         <Unit name=\"m/s\"><BaseUnit m=\"1\" s=\"-1\"/></Unit>\n    \
         <Unit name=\"rad\"><BaseUnit rad=\"1\"/></Unit>\n    \
         <Unit name=\"rad/s\"><BaseUnit rad=\"1\" s=\"-1\"/></Unit>\n    \
         <Unit name=\"%\"><BaseUnit factor=\"0.01\"/></Unit>\n  </UnitDefinitions>\n  \
         <DefaultExperiment startTime=\"0\" stepSize=\"{}\"/>\n  <ModelVariables>\n{variables}  \
         </ModelVariables>\n  <ModelStructure>\n    <Outputs>\n{outputs}    </Outputs>\n    \
         <InitialUnknowns>\n{outputs}    </InitialUnknowns>\n  </ModelStructure>\n\
         </fmiModelDescription>\n",
        guid(input),
        xml(&format!("Control law of {}.{status}", d.name)),
        env!("CARGO_PKG_VERSION"),
        number(input.options.step, Precision::Double),
    )
}

/// The unit.
pub(super) fn files(input: &Input) -> Result<Vec<File>, ExportError> {
    let name = &input.options.name;
    let failed =
        |e: &dyn std::fmt::Display| ExportError::Format { format: "fmu", reason: e.to_string() };
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    // No clock: the same input gives the same bytes.
    let options = zip::write::SimpleFileOptions::default()
        .compression_method(zip::CompressionMethod::Stored)
        .last_modified_time(zip::DateTime::default());
    let mut parts = vec![File::text("modelDescription.xml".into(), model_description(input))];
    parts.push(File::text(
        "documentation/index.txt".into(),
        comment(&input.description.banner(), "", 96),
    ));
    for source in sources(input) {
        parts.push(File { name: format!("sources/{}", source.name), bytes: source.bytes });
    }
    if let Some(binary) = &input.options.binary {
        // The only platform that this program builds for is its own.
        let (folder, ending) = match std::env::consts::OS {
            "windows" => ("win64", "dll"),
            "macos" => ("darwin64", "dylib"),
            _ => ("linux64", "so"),
        };
        parts.push(File {
            name: format!("binaries/{folder}/{name}.{ending}"),
            bytes: binary.clone(),
        });
    }
    for part in parts {
        zip.start_file(part.name, options).map_err(|e| failed(&e))?;
        zip.write_all(&part.bytes).map_err(|e| failed(&e))?;
    }
    let bytes = zip.finish().map_err(|e| failed(&e))?.into_inner();
    Ok(vec![File { name: format!("{name}.fmu"), bytes }])
}
