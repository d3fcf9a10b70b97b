//! STUB.
use crate::problem::InterferenceRule;
#[derive(Debug, Clone)]
pub struct DiskGeometry {
    pub source_radius: f64,
    pub offset: [f64; 3],
    pub receiver_radius: f64,
    pub receiver_axis: [f64; 3],
    pub source_mirrored: bool,
    pub receiver_mirrored: bool,
}
#[derive(Debug, Clone)]
pub struct PointGeometry {
    pub source_radius: f64,
    pub point: [f64; 3],
    pub source_mirrored: bool,
}
#[derive(Debug, Clone, thiserror::Error)]
#[error("geometry")]
pub struct GeometryError;
#[derive(Debug, Clone)]
pub struct Interference;
impl Interference {
    pub fn new(_: &DiskGeometry, _: InterferenceRule) -> Result<Self, GeometryError> {
        Ok(Self)
    }
    pub fn evaluate(&self, _x: [f64; 2]) -> [[f64; 3]; 3] {
        [[0.0; 3]; 3]
    }
    pub fn evaluate_with_partials(
        &self,
        _x: [f64; 2],
    ) -> ([[f64; 3]; 3], [[f64; 3]; 3], [[f64; 3]; 3]) {
        Default::default()
    }
}
#[derive(Debug, Clone)]
pub struct PointWash;
impl PointWash {
    pub fn new(_: &PointGeometry, _core: f64) -> Result<Self, GeometryError> {
        Ok(Self)
    }
    pub fn evaluate_with_partials(&self, _x: [f64; 2]) -> ([f64; 3], [f64; 3], [f64; 3]) {
        Default::default()
    }
}
