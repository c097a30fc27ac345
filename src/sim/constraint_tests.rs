use nalgebra::{DMatrix, DVector};

use super::constraints::*;
use super::model::{BendHinge, BendTriple, Chain, EdgeClass, EdgeLaw};
use crate::math::{Purpose, Stream, Vec3, Vec3x};

fn v(x: [f64; 3]) -> Vec3x<f64> {
    Vec3x(x)
}

fn vec3(x: Vec3x<f64>) -> Vec3 {
    Vec3::from(x.0)
}
