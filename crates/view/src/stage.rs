//! What stays as it is from moment to moment: tool, blank and task.

use std::sync::Arc;

use drape_cloth::fabric::Family;
use drape_cloth::math::Vec3;
use drape_cloth::mesh::TriMesh;
use drape_cloth::scene::Scene;
use drape_cloth::sim::{DRAPED, Snapshot, TOUCHED};
use drape_report::creased;
use drape_task::env::{Draping, Tasks};
use serde_json::json;

use super::host::Spec;
use super::message::Message;

/// Marks beyond those of [`drape_cloth::sim`]: the vertex is of the region.
pub const REGION: u8 = 16;
/// A clamp holds it.
pub const CLAMPED: u8 = 32;
/// It has been pulled by hand.
pub const PULLED: u8 = 64;

/// Tool, blank and task.
pub struct Stage {
    /// Tells it from others of the session.
    pub number: u64,
    pub scene: Scene,
    /// The tool with sharp edges.
    pub tool: TriMesh,
    /// [`REGION`] and [`CLAMPED`] `[vertex]`.
    pub marks: Vec<u8>,
    /// The box that is looked at [m].
    pub bounds: (Vec3, Vec3),
    message: Vec<u8>,
}

impl Stage {
    /// Of a scene whose blank is `at` these places before it falls [m].
    pub fn new(number: u64, scene: &Scene, spec: &Spec, at: &[[f64; 3]]) -> Arc<Self> {
        let lamina = &scene.lamina;
        let region = spec.env.region(lamina);
        let marks = (0..lamina.vertex_count()).map(|v| match &region {
            Ok(region) if region.vertices.contains(v) => REGION,
            _ => 0,
        });
        let mut marks: Vec<u8> = marks.collect();
        for clamp in &spec.scene.clamps {
            let at = clamp.at_mm.map(|mm| 1e-3 * mm);
            let square = |&[u, w]: &[f64; 2]| (u - at[0]).powi(2) + (w - at[1]).powi(2);
            let all = lamina.rest.iter().map(square).enumerate();
            let (nearest, _) = all
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .expect("a blank has vertices");
            for v in lamina.within(nearest as u32, 1e-3 * clamp.radius_mm) {
                marks[v as usize] |= CLAMPED;
            }
        }
        let tool = creased(&scene.tool.mesh);
        // Of the tool what is near the blank, as seen from above.
        let (low, high) = lamina.mesh(at).bounds();
        let margin = Vec3::new(0.1, 0.1, f64::INFINITY);
        let low = low.inf(&tool.bounds().0.sup(&(low - margin)));
        let high = high.sup(&tool.bounds().1.inf(&(high + margin)));
        let mut stage = Self {
            number,
            scene: scene.clone(),
            tool,
            marks,
            bounds: (low, high),
            message: Vec::new(),
        };
        stage.message = stage.encode(spec);
        stage.into()
    }

    /// What has become of each vertex, of which one may be pulled, and whether a press on it is allowed.
    pub fn marked(&self, draping: &Draping, state: &Snapshot, pulled: Option<u32>) -> Vec<u8> {
        let seen = draping.observation(0);
        let mark = |(v, &fixed): (usize, &u8)| {
            let action = draping.action(v as u32);
            let mut mark = fixed | action.map_or(0, |action| seen.marks[action as usize]);
            for (bits, set) in [
                (&state.pressed.touched, TOUCHED),
                (&state.pressed.draped, DRAPED),
            ] {
                mark |= if bits.contains(v) { set } else { 0 };
            }
            mark | if pulled == Some(v as u32) { PULLED } else { 0 }
        };
        self.marks.iter().enumerate().map(mark).collect()
    }

    /// As it is sent to a page.
    pub fn message(&self) -> Vec<u8> {
        self.message.clone()
    }

    fn encode(&self, spec: &Spec) -> Vec<u8> {
        let Scene { lamina, tool, .. } = &self.scene;
        let yarns = |family| {
            let of = lamina
                .yarn_edges()
                .filter(move |(yarn, _)| yarn.family == family);
            of.flat_map(|(_, ends)| ends)
        };
        let floats = |x: &Vec3| [x.x as f32, x.y as f32, x.z as f32];
        let header = json!({
            "kind": "stage",
            "stage": self.number,
            "origin": [tool.origin.x, tool.origin.y, tool.origin.z],
            "bounds": [floats(&self.bounds.0), floats(&self.bounds.1)],
            "stencil_mm": spec.env.stencil_mm,
            "region_mm": spec.env.region_mm,
            "placement": spec.scene.placement,
            "clamps": spec.scene.clamps,
        });
        Message::new(&header)
            .with("tool", self.tool.vertices.iter().flat_map(floats))
            .with(
                "tool_triangles",
                self.tool.triangles.iter().copied().flatten(),
            )
            .with("triangles", lamina.triangles.iter().copied().flatten())
            .with("warp", yarns(Family::Warp))
            .with("weft", yarns(Family::Weft))
            .with("rest", lamina.rest.iter().flatten().map(|&x| x as f32))
            .bytes()
    }
}
