//! All that is fixed between resets: masses, and the stages which a scene asks for.

use super::bend::{BendTriple, bending_stiffness, project_triples, triples};
use super::between::{Between, Tolerance};
use super::cloth::Cloth;
use super::collision::Layers;
use super::curve::{Lagged, ShearCurve, shear_curve};
use super::edges::{EdgeClass, project_edges};
use super::hinge::{BendHinge, hinges, project_hinges};
use super::law::Limit;
use super::length::{self, Limited, Plain};
use super::lines::Lines;
use super::locking::{Locking, locking};
use super::membrane::{
    Element, elements, project_elements, project_locking, shear_elements_by_curve, split,
};
use super::physics::{PhysicsConfig, Solver};
use super::shear::{self, Trellis, trellis};
use super::state::Snapshot;
use crate::fabric::{Family, Lamina};
use crate::math::Lanes;
use crate::tool::Tool;
use std::sync::Arc;

/// Constraints that are projected one after the other.
#[derive(Clone, Debug)]
pub(super) enum Pass {
    /// Edges of yarns with the limit or knee of each, if any yarn has one; one colour.
    Edges(EdgeClass, Vec<Limit>),
    /// Diagonals, one colour.
    Diagonals(EdgeClass, Trellis),
    /// Shear by a curve of several slopes.
    CurvedDiagonals(EdgeClass, ShearCurve),
    /// Their locking.
    LockingDiagonals(EdgeClass, Locking),
    /// Three-node bending, one colour.
    Triples(Vec<BendTriple>),
    /// Dihedral bending, one colour.
    Hinges(Vec<BendHinge>),
    /// Triangles whose sides are no yarns, one colour.
    Membrane(Vec<Element>),
    /// Their shear by a curve of several slopes.
    CurvedMembrane(Vec<Element>, ShearCurve),
    /// Their locking.
    LockingMembrane(Vec<Element>, Locking),
}

impl Pass {
    /// Projects its constraints, one after the other, with the factors of environments that differ.
    #[inline(always)]
    pub fn project<V: Lanes>(&self, cloth: &mut Cloth<V>, differ: bool) {
        let (x, w) = (&mut cloth.position[..], &cloth.mobility[..]);
        let previous = &cloth.previous[..];
        let s = if differ { Some(&cloth.scales) } else { None };
        match self {
            Self::Edges(class, limits) if limits.is_empty() => {
                project_edges(class, &Plain, x, w, s);
            }
            Self::Edges(class, limits) => project_edges(class, &Limited(limits), x, w, s),
            Self::Diagonals(class, trellis) => project_edges(class, trellis, x, w, s),
            Self::CurvedDiagonals(class, curve) => {
                project_edges(class, &Lagged { curve, previous }, x, w, s);
            }
            Self::LockingDiagonals(class, locking) => project_edges(class, locking, x, w, s),
            Self::Triples(triples) => project_triples(triples, x, w, s),
            Self::Hinges(hinges) => project_hinges(hinges, x, w, s),
            Self::Membrane(elements) => project_elements(elements, x, w, &mut cloth.density, s),
            Self::CurvedMembrane(elements, curve) => {
                shear_elements_by_curve(elements, &Lagged { curve, previous }, x, w, s);
            }
            Self::LockingMembrane(elements, locking) => project_locking(elements, locking, x, w, s),
        }
    }
}

/// The model of a lamina, in plain arrays.
#[derive(Clone, Debug)]
pub struct Model {
    /// 1/m of each vertex [1/kg].
    pub inverse_mass: Vec<f64>,
    /// What is solved along whole lines; none under Gauss-Seidel.
    pub(super) lines: Option<Lines>,
    /// Number of force densities that last; 0 without the solve along yarns.
    pub(super) edge_count: usize,
    /// What is projected constraint by constraint, in this order.
    pub(super) passes: Vec<Pass>,
    /// Membranes along yarns, in colours, beside lines: they follow the yarns, and their forces last
    /// like those of yarns.
    pub(super) membranes: Vec<Vec<Element>>,
    pub(super) bending_stiffness: [f64; 2],
    /// Static and dynamic coefficient.
    pub(super) friction: Option<[f64; 2]>,
    /// Greatest pull of the tool's tack on each vertex [N].
    pub(super) tack: Option<Vec<f64>>,
    /// Layers that hold each other apart.
    pub(super) layers: Option<Layers>,
    /// Contact between the vertices, over a tool that is finer than they are.
    pub(super) between: Option<Arc<Between>>,
    physics: PhysicsConfig,
}

impl Model {
    /// Builds the stages for a lamina under `physics`, which must have been checked.
    pub fn new(lamina: &Lamina, physics: &PhysicsConfig) -> Self {
        let trellis = trellis(lamina, physics);
        let curve = shear_curve(lamina, physics);
        let locking = locking(lamina, physics);
        let by_edge = physics.solver == Solver::GaussSeidel;
        let mut passes = Vec::new();
        if by_edge {
            let yarns = length::edges(lamina, physics);
            passes.extend(yarns.map(|(class, limits)| Pass::Edges(class, limits)));
        }
        let lines = (!by_edge).then(|| Lines::new(lamina, physics, trellis.clone()));
        let yarn_edges = lines.as_ref().map(|lines| lines.edge_count);
        let classes = elements(lamina, physics, yarn_edges);
        let [membranes, classes] = match (by_edge, &curve) {
            (true, None) => [Vec::new(), classes],
            _ => split(&classes),
        };
        let sheared = classes.iter().cloned();
        match &curve {
            None => passes.extend(sheared.map(Pass::Membrane)),
            Some(curve) => {
                let along = membranes.iter().filter(|_| by_edge);
                passes.extend(along.cloned().map(Pass::Membrane));
                passes.extend(sheared.map(|class| Pass::CurvedMembrane(class, curve.clone())));
            }
        }
        if let Some(locking) = &locking {
            let lock = |class| Pass::LockingMembrane(class, locking.clone());
            passes.extend(classes.into_iter().map(lock));
        }
        if by_edge {
            if let Some(trellis) = &trellis {
                let classes = shear::edges(lamina, trellis);
                let sheared = classes.iter().cloned();
                passes.extend(sheared.map(|class| match &curve {
                    Some(curve) => Pass::CurvedDiagonals(class, curve.clone()),
                    None => Pass::Diagonals(class, trellis.clone()),
                }));
                if let Some(locking) = &locking {
                    let lock = |class| Pass::LockingDiagonals(class, locking.clone());
                    passes.extend(classes.into_iter().map(lock));
                }
            }
            passes.extend(triples(lamina, physics).into_iter().map(Pass::Triples));
        }
        passes.extend(hinges(lamina, physics).into_iter().map(Pass::Hinges));
        let friction = physics.friction.then(|| lamina.material.friction());
        Self {
            inverse_mass: lamina.mass.iter().map(|m| 1.0 / m).collect(),
            edge_count: yarn_edges.map_or(0, |count| {
                count + 2 * lamina.membranes.iter().filter(|m| !m.has_yarns).count()
            }),
            lines,
            passes,
            membranes: if by_edge { Vec::new() } else { membranes },
            layers: Layers::new(lamina, physics.self_collision, friction),
            bending_stiffness: [Family::Warp, Family::Weft]
                .map(|family| bending_stiffness(lamina, physics, family)),
            friction,
            tack: tack(lamina, physics),
            between: None,
            physics: physics.clone(),
        }
    }

    /// The model over a tool: with contact between the vertices of a blank that is laid flat at `flat` [m]
    /// where the tool is finer than its cells.
    pub fn over(self, lamina: &Lamina, tool: &Tool, flat: &[[f64; 3]]) -> Self {
        Self {
            between: Between::new(lamina, tool, flat).map(Arc::new),
            ..self
        }
    }

    /// The model over the tool of another of the same blank.
    pub fn over_that_of(self, other: &Self) -> Self {
        Self {
            between: other.between.clone(),
            ..self
        }
    }

    /// Whether it looks at the same points between its vertices as another model, if at any.
    pub fn feels_as(&self, other: &Self) -> bool {
        match (&self.between, &other.between) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (a, b) => a.is_none() && b.is_none(),
        }
    }

    /// The vertices of a sheet at `x` [m], and the points between them that may touch the tool under it.
    pub fn felt(&self, x: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let mut felt = x.to_vec();
        felt.extend(
            { &self.between }
                .iter()
                .flat_map(|between| between.points(x)),
        );
        felt
    }

    /// Whether contact is looked for between the vertices too.
    pub fn feels_between(&self) -> bool {
        self.between.is_some()
    }

    /// What contact holds between the vertices; none where it has no need to.
    pub fn tolerance(&self) -> Option<Tolerance> {
        self.between.as_ref().map(|between| between.tolerance())
    }

    /// Whether `state` is one of this model: of its size, finite, and of parts that it has.
    pub fn fits(&self, state: &Snapshot) -> bool {
        let (count, pressed) = (self.vertex_count(), &state.pressed);
        let know = |layers: &Layers| layers.know(&state.sides);
        [state.position.len(), state.velocity.len()] == [count; 2]
            && [pressed.touched.len(), pressed.draped.len()] == [count; 2]
            && state.fixed.len() <= count
            && state.force_density.len() <= self.edge_count
            && pressed.stencil.iter().all(|&v| (v as usize) < count)
            && state.is_finite()
            && self.layers.as_ref().map_or(state.sides.is_empty(), know)
    }

    /// Of warps and wefts, per width [N m].
    pub fn bending_stiffness(&self) -> [f64; 2] {
        self.bending_stiffness
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.inverse_mass.len()
    }

    /// The physics this was built from.
    pub fn physics(&self) -> &PhysicsConfig {
        &self.physics
    }
}

/// Tack times the area of each vertex [N].
fn tack(lamina: &Lamina, physics: &PhysicsConfig) -> Option<Vec<f64>> {
    let pull = |area: f64| 1e3 * physics.adhesion * area;
    let areas = lamina.vertex_areas();
    (physics.adhesion > 0.0).then(|| areas.into_iter().map(pull).collect())
}

#[cfg(test)]
mod tests;
