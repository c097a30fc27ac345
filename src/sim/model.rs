use serde::{Deserialize, Serialize};

use super::membrane::{Element, elements};
use super::self_contact::{Layers, SelfCollision};
use crate::fabric::{Family, Hinge, Lamina, color};

/// How the yarns' length is kept.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Solver {
    /// Coloured Gauss-Seidel over the edges, as in the paper.
    GaussSeidel,
    /// A direct tridiagonal solve along each yarn: all warps, then all wefts.
    #[default]
    Yarn,
}

/// How bending is modelled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Bending {
    /// Along each yarn, by the second difference of three neighbouring vertices.
    #[default]
    Yarns,
    /// By the angle between neighbouring triangles, as in the paper. Isotropic.
    Dihedral,
    /// Not at all.
    Off,
}

/// Bending stiffness per width.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BendingStiffness {
    /// What the material's bimodulus gives.
    #[default]
    Material,
    /// The same for warp and weft [N m].
    NewtonMetre(f64),
}

/// What a yarn does against compression.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Compression {
    /// The material's own compression branch.
    #[default]
    Material,
    /// As stiff as in tension.
    AsTension,
}

/// The physics of a scene: what is listed here is computed, the rest costs nothing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PhysicsConfig {
    pub solver: Solver,
    pub bending: Bending,
    pub bending_stiffness: BendingStiffness,
    pub compression: Compression,
    /// Resistance of the weave to shear.
    pub shear: bool,
    /// Coulomb friction against the tool.
    pub friction: bool,
    /// Contact of the cloth with itself; with friction where `friction` is listed.
    pub self_collision: SelfCollision,
    /// Gravity [m/s^2], along -z.
    pub gravity: f64,
    /// Decay rate of every velocity [1/s].
    pub damping: f64,
    /// Largest speed of a vertex [m/s]; 0 means no limit.
    pub speed_cap: f64,
    /// Substeps between two looks for contact.
    pub contact_interval: usize,
    /// Stiffness with which the stencil holds a vertex down [N/m].
    pub press_stiffness: f64,
}

impl Default for PhysicsConfig {
    fn default() -> Self {
        Self {
            solver: Solver::Yarn,
            bending: Bending::Yarns,
            bending_stiffness: BendingStiffness::NewtonMetre(2e-4),
            compression: Compression::Material,
            shear: true,
            friction: true,
            self_collision: SelfCollision::Off,
            gravity: 9.81,
            damping: 50.0,
            speed_cap: 4.0,
            contact_interval: 20,
            press_stiffness: 300.0,
        }
    }
}

/// A value of the physics that cannot be simulated.
#[derive(Debug, thiserror::Error)]
#[error("`physics.{key}` is {found}, expected {expected}")]
pub struct PhysicsError {
    pub(super) key: &'static str,
    pub(super) found: String,
    pub(super) expected: &'static str,
}

impl PhysicsConfig {
    /// Checks every value; the error names key, found and expected.
    pub fn check(&self) -> Result<(), PhysicsError> {
        let fail = |key, found: String, expected| {
            Err(PhysicsError {
                key,
                found,
                expected,
            })
        };
        // Its square must neither overflow nor vanish in f32.
        if self.speed_cap != 0.0 && !(1e-6..=1e6).contains(&self.speed_cap) {
            let expected = "0 for none, or a number from 1e-6 to 1e6";
            return fail("speed_cap", self.speed_cap.to_string(), expected);
        }
        if self.contact_interval == 0 {
            return fail("contact_interval", "0".into(), "a number > 0");
        }
        let non_negative = [
            ("damping", self.damping),
            ("press_stiffness", self.press_stiffness),
        ];
        for (key, value) in non_negative {
            if !(value >= 0.0 && value.is_finite()) {
                return fail(key, value.to_string(), "a number >= 0");
            }
        }
        self.self_collision.check_value()?;
        if !self.gravity.is_finite() {
            return fail("gravity", self.gravity.to_string(), "a finite number");
        }
        if let BendingStiffness::NewtonMetre(d) = self.bending_stiffness
            && !(d >= 0.0 && d.is_finite())
        {
            return fail("bending_stiffness", d.to_string(), "a number >= 0");
        }
        Ok(())
    }
}

/// Compliance of an edge [m/N] for each sign of its strain.
#[derive(Clone, Copy, Debug)]
pub(super) struct EdgeLaw {
    pub tension: f64,
    pub compression: f64,
}

/// Edges of which no two share a vertex.
#[derive(Clone, Debug)]
pub(super) struct EdgeClass {
    pub vertices: Vec<[u32; 2]>,
    pub rest_length: Vec<f64>,
    pub law: Vec<EdgeLaw>,
}

/// A yarn for the direct solve.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    pub vertices: Vec<u32>,
    /// Its edges among those of all yarns.
    pub edges: std::ops::Range<usize>,
    pub rest_length: f64,
    pub law: EdgeLaw,
}

/// Three neighbours on a yarn. C = x0 - 2 x1 + x2 [m], energy = |C|^2 / (2 compliance).
#[derive(Clone, Copy, Debug)]
pub(super) struct BendTriple {
    pub vertices: [u32; 3],
    /// [m/N]
    pub compliance: f64,
}

/// A hinge between two triangles. C = dihedral angle [rad].
#[derive(Clone, Copy, Debug)]
pub(super) struct BendHinge {
    pub vertices: [u32; 4],
    /// [rad^2/J]
    pub compliance: f64,
}

/// One verb of the substep.
#[derive(Clone, Debug)]
pub(super) enum Pass {
    /// Direct solve of chains which share no vertex.
    Yarns(Vec<Chain>),
    /// Edges, one colour.
    Edges(EdgeClass),
    /// Three-node bending, one colour.
    Triples(Vec<BendTriple>),
    /// Dihedral bending, one colour.
    Hinges(Vec<BendHinge>),
    /// Triangles whose sides are no yarns, one colour.
    Membrane(Vec<Element>),
}

/// All that is fixed between resets: masses and the list of passes which a scene asks for.
#[derive(Clone, Debug)]
pub struct Model {
    /// 1/m of each vertex [1/kg].
    pub inverse_mass: Vec<f64>,
    pub(super) passes: Vec<Pass>,
    pub(super) physics: PhysicsConfig,
    /// Static and dynamic coefficient.
    pub(super) friction: Option<[f64; 2]>,
    pub(super) layers: Option<Layers>,
    /// Vertices of the longest yarn: the size of the scratch space of the direct solve.
    pub(super) longest_chain: usize,
    /// Edges of all yarns.
    pub(super) yarn_edge_count: usize,
}

impl Model {
    /// Builds the passes for a lamina under `physics`, which must have been checked.
    pub fn new(lamina: &Lamina, physics: &PhysicsConfig) -> Self {
        let passes = [
            length_passes(lamina, physics),
            elements(lamina, physics)
                .into_iter()
                .map(Pass::Membrane)
                .collect(),
            shear_passes(lamina, physics),
            bending_passes(lamina, physics),
        ];
        // What only the direct solve needs costs nothing without it.
        let friction = physics.friction.then(|| lamina.material.friction());
        let direct = physics.solver == Solver::Yarn;
        let yarn_edges = lamina.yarns.iter().map(|yarn| yarn.vertices.len() - 1);
        Self {
            inverse_mass: lamina.mass.iter().map(|m| 1.0 / m).collect(),
            passes: passes.concat(),
            layers: Layers::new(lamina, physics.self_collision, friction),
            friction,
            longest_chain: if direct {
                lamina.rows.max(lamina.columns)
            } else {
                0
            },
            yarn_edge_count: if direct { yarn_edges.sum() } else { 0 },
            physics: physics.clone(),
        }
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

/// Edge stiffness k = E h (b / a) of a yarn of width b and edge length a (Table 2).
fn yarn_law(lamina: &Lamina, physics: &PhysicsConfig, family: Family, b: f64, a: f64) -> EdgeLaw {
    let law = lamina.material.yarn(family);
    let per_modulus = lamina.material.thickness() * b / a;
    let tension = 1.0 / (law.tension.modulus() * per_modulus);
    let compression = match physics.compression {
        Compression::Material => 1.0 / (law.compression.modulus() * per_modulus),
        Compression::AsTension => tension,
    };
    EdgeLaw {
        tension,
        compression,
    }
}

fn length_passes(lamina: &Lamina, physics: &PhysicsConfig) -> Vec<Pass> {
    let mut edge_count = 0;
    let chains = lamina.yarns.iter().map(|yarn| Chain {
        edges: {
            let first = edge_count;
            edge_count += yarn.vertices.len() - 1;
            first..edge_count
        },
        vertices: yarn.vertices.clone(),
        rest_length: yarn.rest_length,
        law: yarn_law(lamina, physics, yarn.family, yarn.width, yarn.rest_length),
    });
    match physics.solver {
        Solver::Yarn => {
            let (warps, wefts) = chains
                .zip(&lamina.yarns)
                .partition::<Vec<_>, _>(|(_, yarn)| yarn.family == Family::Warp);
            [warps, wefts]
                .map(|chains| Pass::Yarns(chains.into_iter().map(|(chain, _)| chain).collect()))
                .into()
        }
        Solver::GaussSeidel => edge_passes(
            lamina,
            chains.flat_map(|chain| {
                let edges: Vec<_> = chain
                    .vertices
                    .windows(2)
                    .map(|v| ([v[0], v[1]], chain.rest_length, chain.law))
                    .collect();
                edges
            }),
        ),
    }
}

/// The diagonal of a cell under shear gamma grows by a gamma / sqrt 2, so a spring of
/// 2 G h (b / a for cells that are not square) stores the energy of the shear law.
fn shear_passes(lamina: &Lamina, physics: &PhysicsConfig) -> Vec<Pass> {
    if !physics.shear {
        return Vec::new();
    }
    let shear = &lamina.material.shear;
    let compliance = |modulus: f64| 1.0 / (2.0 * modulus * lamina.material.thickness());
    let law = EdgeLaw {
        tension: compliance(shear.positive.modulus()),
        compression: compliance(shear.negative.modulus()),
    };
    let diagonals = lamina.diagonals.iter();
    edge_passes(lamina, diagonals.map(|d| (d.vertices, d.rest_length, law)))
}

fn edge_passes(
    lamina: &Lamina,
    edges: impl Iterator<Item = ([u32; 2], f64, EdgeLaw)>,
) -> Vec<Pass> {
    let edges: Vec<_> = edges.collect();
    let vertices: Vec<[u32; 2]> = edges.iter().map(|e| e.0).collect();
    color(lamina.vertex_count(), &vertices)
        .into_iter()
        .map(|class| {
            let of = |&i: &u32| edges[i as usize];
            Pass::Edges(EdgeClass {
                vertices: class.iter().map(|i| of(i).0).collect(),
                rest_length: class.iter().map(|i| of(i).1).collect(),
                law: class.iter().map(|i| of(i).2).collect(),
            })
        })
        .collect()
}

fn bending_passes(lamina: &Lamina, physics: &PhysicsConfig) -> Vec<Pass> {
    match physics.bending {
        Bending::Off => Vec::new(),
        // Curvature is C / l^2, a vertex stands for the length l: energy = D b |C|^2 / 2 l^3.
        Bending::Yarns => {
            let triples: Vec<BendTriple> = lamina
                .yarns
                .iter()
                .flat_map(|yarn| {
                    let triple = |v: &[u32]| BendTriple {
                        vertices: [v[0], v[1], v[2]],
                        compliance: yarn.rest_length.powi(3)
                            / (stiffness(lamina, physics, yarn.family) * yarn.width),
                    };
                    yarn.vertices.windows(3).map(triple).collect::<Vec<_>>()
                })
                .filter(|triple| triple.compliance.is_finite())
                .collect();
            let vertices: Vec<_> = triples.iter().map(|t| t.vertices).collect();
            let mut passes: Vec<Pass> =
                classes_of(&triples, color(lamina.vertex_count(), &vertices))
                    .map(Pass::Triples)
                    .collect();
            // Along and beside membranes there is no yarn to bend.
            passes.extend(hinge_passes(lamina, physics, &lamina.membrane_hinges()));
            passes
        }
        Bending::Dihedral => hinge_passes(lamina, physics, &lamina.hinges()),
    }
}

fn stiffness(lamina: &Lamina, physics: &PhysicsConfig, family: Family) -> f64 {
    match physics.bending_stiffness {
        BendingStiffness::Material => lamina.material.bending_stiffness(family),
        BendingStiffness::NewtonMetre(d) => d,
    }
}

fn hinge_passes(lamina: &Lamina, physics: &PhysicsConfig, hinges: &[Hinge]) -> Vec<Pass> {
    let of = |family| stiffness(lamina, physics, family);
    let mean = 0.5 * (of(Family::Warp) + of(Family::Weft));
    let hinges: Vec<BendHinge> = hinges
        .iter()
        .map(|hinge| BendHinge {
            vertices: hinge.vertices,
            compliance: 1.0 / (mean * hinge.weight),
        })
        .filter(|hinge| hinge.compliance.is_finite())
        .collect();
    let vertices: Vec<_> = hinges.iter().map(|h| h.vertices).collect();
    classes_of(&hinges, color(lamina.vertex_count(), &vertices))
        .map(Pass::Hinges)
        .collect()
}

fn classes_of<T: Copy>(all: &[T], classes: Vec<Vec<u32>>) -> impl Iterator<Item = Vec<T>> {
    classes
        .into_iter()
        .map(|class| class.iter().map(|&i| all[i as usize]).collect())
}

#[cfg(test)]
mod tests;
