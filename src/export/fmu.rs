//! The whole law as an FMI 2.0 unit for co-simulation, made of the C export.

use std::io::{Cursor, Write as _};

use super::text::{comment, fill, number, xml};
use super::{ExportError, File, Input, Precision, c};
use crate::schedule::hash;

const SOURCE: &str = include_str!("templates/fmu.c");

/// Real inputs in the order of their value references: name, unit, meaning.
const INPUTS: [(&str, &str, &str); 19] = [
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
    (
        "engage",
        "1",
        "above 0.5: the law starts from the sticks given by lat_0 to ped_0, without a transient",
    ),
    ("lat_0", "%", "lateral stick to start from"),
    ("lon_0", "%", "longitudinal stick to start from"),
    ("col_0", "%", "collective to start from"),
    ("ped_0", "%", "pedals to start from"),
];

const OUTPUTS: [(&str, &str); 4] = [
    ("lat", "lateral stick"),
    ("lon", "longitudinal stick"),
    ("col", "collective"),
    ("ped", "pedals"),
];

/// What a shared object of a unit runs on, as FMI 2.0 names it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Platform {
    /// Linux on x86.
    Linux32,
    /// Linux on x86-64.
    Linux64,
    /// Windows on x86.
    Win32,
    /// Windows on x86-64.
    Win64,
    /// macOS.
    Darwin64,
}

impl Platform {
    /// Every platform.
    pub const ALL: [Self; 5] =
        [Self::Linux32, Self::Linux64, Self::Win32, Self::Win64, Self::Darwin64];

    /// Its folder below `binaries`.
    pub fn folder(self) -> &'static str {
        match self {
            Self::Linux32 => "linux32",
            Self::Linux64 => "linux64",
            Self::Win32 => "win32",
            Self::Win64 => "win64",
            Self::Darwin64 => "darwin64",
        }
    }

    /// Ending of a shared object.
    pub fn ending(self) -> &'static str {
        match self {
            Self::Linux32 | Self::Linux64 => "so",
            Self::Win32 | Self::Win64 => "dll",
            Self::Darwin64 => "dylib",
        }
    }

    /// The platform of a compiler's target, such as `x86_64-linux-gnu`, which
    /// `cc -dumpmachine` prints. `None` where FMI 2.0 has no name for it.
    pub fn of_target(target: &str) -> Option<Self> {
        let processor = target.split('-').next().unwrap_or_default();
        let wide = matches!(processor, "x86_64" | "amd64");
        let narrow = matches!(processor, "i386" | "i486" | "i586" | "i686" | "x86");
        if target.contains("mingw") || target.contains("windows") || target.contains("cygwin") {
            return match (wide, narrow) {
                (true, _) => Some(Self::Win64),
                (_, true) => Some(Self::Win32),
                _ => None,
            };
        }
        if target.contains("apple") || target.contains("darwin") {
            return Some(Self::Darwin64);
        }
        if target.contains("android") || !target.contains("linux") {
            return None;
        }
        match (wide, narrow) {
            (true, _) => Some(Self::Linux64),
            (_, true) => Some(Self::Linux32),
            _ => None,
        }
    }
}

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
    // Outputs change at communication points only; the first ones are computed
    // from the inputs of the initialisation, the mode among them.
    let outputs = |inputs: &str| -> String {
        (INPUTS.len() + 1..=INPUTS.len() + OUTPUTS.len())
            .map(|k| format!("      <Unknown index=\"{k}\" dependencies=\"{inputs}\"/>\n"))
            .collect()
    };
    let all: Vec<String> = (1..=INPUTS.len())
        .chain([INPUTS.len() + OUTPUTS.len() + 1])
        .map(|k| k.to_string())
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
         </ModelVariables>\n  <ModelStructure>\n    <Outputs>\n{}    </Outputs>\n    \
         <InitialUnknowns>\n{}    </InitialUnknowns>\n  </ModelStructure>\n\
         </fmiModelDescription>\n",
        guid(input),
        xml(&format!("Control law of {}.{status}", d.name)),
        env!("CARGO_PKG_VERSION"),
        number(input.options.step, Precision::Double),
        outputs(""),
        outputs(&all.join(" ")),
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
    for (platform, binary) in &input.options.binaries {
        let (folder, ending) = (platform.folder(), platform.ending());
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn compilers_say_their_platform() {
        for (target, wanted) in [
            ("x86_64-linux-gnu", Some(Platform::Linux64)),
            ("x86_64-unknown-linux-musl", Some(Platform::Linux64)),
            ("i686-linux-gnu", Some(Platform::Linux32)),
            ("x86_64-w64-mingw32", Some(Platform::Win64)),
            ("i686-w64-mingw32", Some(Platform::Win32)),
            ("x86_64-pc-windows-msvc", Some(Platform::Win64)),
            ("arm64-apple-darwin23.1.0", Some(Platform::Darwin64)),
            ("aarch64-linux-gnu", None),
            ("x86_64-linux-android", None),
            ("arm-none-eabi", None),
        ] {
            assert_eq!(Platform::of_target(target), wanted, "{target}");
        }
    }
}
