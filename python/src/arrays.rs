//! Columns and matrices as NumPy arrays. A vector becomes an array without a
//! copy.

use coaxdesign::linear::Channel;
use nalgebra::DMatrix;
use numpy::{PyArray1, PyArrayDyn, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

/// Columns in order: `{name: (unit, values)}`.
pub struct Columns<'py>(Bound<'py, PyDict>);

impl<'py> Columns<'py> {
    pub fn new(py: Python<'py>) -> Self {
        Self(PyDict::new(py))
    }

    /// Adds numbers, SI and radians.
    pub fn numbers(&self, name: &str, unit: &str, values: Vec<f64>) -> PyResult<()> {
        self.0.set_item(name, (unit, PyArray1::from_vec(self.0.py(), values)))
    }

    /// Adds whole numbers.
    pub fn counts(&self, name: &str, values: Vec<i64>) -> PyResult<()> {
        self.0.set_item(name, ("1", PyArray1::from_vec(self.0.py(), values)))
    }

    /// Adds yes or no.
    pub fn flags(&self, name: &str, values: Vec<bool>) -> PyResult<()> {
        self.0.set_item(name, ("", PyArray1::from_vec(self.0.py(), values)))
    }

    /// Adds words.
    pub fn words(&self, name: &str, values: Vec<String>) -> PyResult<()> {
        self.0.set_item(name, ("", PyList::new(self.0.py(), values)?))
    }

    /// Adds an array of any shape, the last index fastest.
    pub fn shaped(
        &self,
        name: &str,
        unit: &str,
        values: Vec<f64>,
        shape: &[usize],
    ) -> PyResult<()> {
        self.0.set_item(name, (unit, shaped(self.0.py(), values, shape)?))
    }

    pub fn finish(self) -> Bound<'py, PyDict> {
        self.0
    }
}

/// An array of a shape, the last index fastest.
pub fn shaped<'py>(
    py: Python<'py>,
    values: Vec<f64>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    PyArray1::from_vec(py, values).reshape(shape)
}

/// Matrices of one size, stacked: index of the matrix, row, column.
pub fn stacked<'py, 'a>(
    py: Python<'py>,
    matrices: impl Iterator<Item = &'a DMatrix<f64>>,
    count: usize,
    [rows, columns]: [usize; 2],
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let mut values = Vec::with_capacity(count * rows * columns);
    for matrix in matrices {
        for row in matrix.row_iter() {
            values.extend(row.iter());
        }
    }
    shaped(py, values, &[count, rows, columns])
}

/// Names and coherent units of channels.
pub fn channels(of: &[Channel]) -> Vec<(String, &'static str)> {
    of.iter().map(|channel| (channel.name.clone(), channel.kind.coherent())).collect()
}
