//! Histories as Apache Parquet: columns of doubles, in groups of rows, so that
//! memory does not grow with the flight.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use parquet::basic::{Repetition, Type as Physical};
use parquet::data_type::DoubleType;
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

use super::CliError;
use super::output::WholeFile;

/// Rows that are held until they are written together.
const GROUP: usize = 4096;

/// A file of columns, on its way.
pub(super) struct Columns {
    path: PathBuf,
    writer: SerializedFileWriter<WholeFile>,
    /// Rows not yet written, one list a column.
    waiting: Vec<Vec<f64>>,
}

impl Columns {
    /// Begins a file with columns of these names.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn create(path: &Path, overwrite: bool, names: &[String]) -> Result<Self, CliError> {
        let fault = |error| failed(path, error);
        let fields = names
            .iter()
            .map(|name| {
                Type::primitive_type_builder(name, Physical::DOUBLE)
                    .with_repetition(Repetition::REQUIRED)
                    .build()
                    .map(Arc::new)
            })
            .collect::<Result<Vec<_>, _>>()
            .map_err(fault)?;
        let schema =
            Type::group_type_builder("history").with_fields(fields).build().map_err(fault)?;
        // Measured numbers hardly repeat.
        let properties = WriterProperties::builder().set_dictionary_enabled(false).build();
        let file = WholeFile::create(path, overwrite)?;
        let writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties))
            .map_err(fault)?;
        Ok(Self { path: path.into(), writer, waiting: vec![Vec::new(); names.len()] })
    }

    /// Adds a row.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn row(&mut self, values: impl Iterator<Item = f64>) -> Result<(), CliError> {
        for (column, value) in self.waiting.iter_mut().zip(values) {
            column.push(value);
        }
        if self.waiting.first().is_some_and(|column| column.len() >= GROUP) {
            self.write_group()?;
        }
        Ok(())
    }

    fn write_group(&mut self) -> Result<(), CliError> {
        let Self { path, writer, waiting } = self;
        let mut write = || -> Result<(), ParquetError> {
            let mut group = writer.next_row_group()?;
            for values in waiting.iter_mut() {
                if let Some(mut column) = group.next_column()? {
                    column.typed::<DoubleType>().write_batch(values, None, None)?;
                    column.close()?;
                }
                values.clear();
            }
            group.close()?;
            Ok(())
        };
        write().map_err(|error| failed(path, error))
    }

    /// Writes what is left, and lets the file take its name.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn finish(mut self) -> Result<(), CliError> {
        if self.waiting.first().is_some_and(|column| !column.is_empty()) {
            self.write_group()?;
        }
        let Self { path, writer, .. } = self;
        writer.into_inner().map_err(|error| failed(&path, error))?.finish()
    }
}

fn failed(path: &Path, error: ParquetError) -> CliError {
    CliError::Io { path: path.into(), source: std::io::Error::other(error) }
}
