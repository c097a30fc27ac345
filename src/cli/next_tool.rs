//! The tool that a draped ply makes for the next, as several commands write it.

use std::path::Path;

use anyhow::Context;

use super::Failure;
use drape_cloth::math::Vec3;
use drape_cloth::mesh::{TriMesh, write_stl};
use drape_cloth::scene::Scene;
use drape_cloth::tool::Tool;
use drape_field::next_tool;
use drape_task::path::Frame;

/// The tool that the next ply falls on, in the folder of a run.
pub(super) const NEXT_TOOL: &str = "next-tool.stl";

/// A blank whose vertices are at `position` [m], in the scene.
pub(super) fn sheet(scene: &Scene, position: &[[f64; 3]]) -> TriMesh {
    scene.lamina.mesh(&scene.tool.in_scene(position))
}

/// Writes the tool that the next ply falls on, in a frame, where a blank of `run` has come to lie with its vertices at
/// `position` [m].
pub(super) fn write_next_tool(
    scene: &Scene,
    position: &[[f64; 3]],
    frame: &Frame,
    run: &Path,
    file: &Path,
) -> Result<(), Failure> {
    let sheet = sheet(scene, position);
    let thickness = scene.lamina.material.thickness();
    let refused = || format!("{}: no ply can be laid on this one", run.display());
    let next = next_tool(&scene.tool.mesh_in_scene(), &sheet, thickness);
    let mut mesh = next.with_context(refused)?;
    // In the scene, where z is up.
    Tool::from_mesh(mesh.clone(), &scene.config.tool.grid).with_context(refused)?;
    let place = |x: &Vec3| frame.point(x);
    mesh.vertices = mesh.vertices.iter().map(place).collect();
    Ok(write_stl(file, &mesh, "tool and ply")?)
}
