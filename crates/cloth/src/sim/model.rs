use super::line::Lines;
use super::membrane::{Element, elements};
use super::physics::{Bending, BendingStiffness, Compression, PhysicsConfig, Solver, Tension};
use super::self_contact::Layers;
use super::trellis::Trellis;
use crate::fabric::{Family, Hinge, Lamina, Yarn, color};

/// Compliance of an edge [m/N] for each sign of its strain.
#[derive(Clone, Copy, Debug)]
pub(super) struct EdgeLaw {
    pub tension: f64,
    pub compression: f64,
}

/// Compliance of a yarn beyond the strain limit, as a share of that in tension. At the limit's
/// force times ten it adds a hundredth of the limit. 0 would make the system of a yarn between
/// clamps singular.
pub(super) const LIMITED: f64 = 1e-3;

/// The law of an edge beyond a tension, its strain limit or the knee of the material's law:
/// C = offset + compliance * force.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limit {
    /// Tension at which it begins [N].
    pub force: f64,
    /// [m/N]
    pub compliance: f64,
    /// [m]; such that there the law is continuous.
    pub offset: f64,
}

impl Limit {
    /// Beyond a growth of an edge by `stretch` [m], `share` of the compliance that it has before.
    fn new(law: EdgeLaw, stretch: f64, share: f64) -> Self {
        Self {
            force: stretch / law.tension,
            compliance: share * law.tension,
            offset: stretch * (1.0 - share),
        }
    }

    /// Of the edges of a yarn, where the scene lists one. A strain limit takes the knee's place.
    pub fn of_yarn(
        law: EdgeLaw,
        lamina: &Lamina,
        physics: &PhysicsConfig,
        yarn: &Yarn,
    ) -> Option<Self> {
        if let Some(strain) = physics.strain_limit {
            return Some(Self::new(law, strain * yarn.rest_length, LIMITED));
        }
        match physics.tension {
            Tension::FirstBranch => None,
            Tension::Material => {
                let [strain, slope] = lamina.material.yarn(yarn.family).tension.knee()?;
                Some(Self::new(law, strain * yarn.rest_length, 1.0 / slope))
            }
        }
    }
}

/// Edges of which no two share a vertex.
#[derive(Clone, Debug)]
pub(super) struct EdgeClass {
    pub vertices: Vec<[u32; 2]>,
    pub rest_length: Vec<f64>,
    pub law: Vec<EdgeLaw>,
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

/// Constraints that are projected one after the other.
#[derive(Clone, Debug)]
pub(super) enum Pass {
    /// Edges, one colour.
    Edges(EdgeClass),
    /// Edges of yarns with a limit or knee each, one colour.
    LimitedEdges(EdgeClass, Vec<Limit>),
    /// Diagonals, one colour.
    Diagonals(EdgeClass, Trellis),
    /// Three-node bending, one colour.
    Triples(Vec<BendTriple>),
    /// Dihedral bending, one colour.
    Hinges(Vec<BendHinge>),
    /// Triangles whose sides are no yarns, one colour.
    Membrane(Vec<Element>),
}

impl Pass {
    /// The vertices that it moves, each once or more.
    pub fn vertices(&self) -> Vec<u32> {
        match self {
            Self::Edges(class) | Self::LimitedEdges(class, _) | Self::Diagonals(class, _) => {
                class.vertices.as_flattened().to_vec()
            }
            Self::Triples(all) => all.iter().flat_map(|t| t.vertices).collect(),
            Self::Hinges(all) => all.iter().flat_map(|h| h.vertices).collect(),
            Self::Membrane(all) => all.iter().flat_map(|e| e.vertices).collect(),
        }
    }
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
    /// Greatest pull of the tool's tack on each vertex [N].
    pub(super) tack: Option<Vec<f64>>,
    /// Velocity of the air, to which damping slows [m/s]; at rest if none.
    pub(super) wind: Option<[f64; 3]>,
    pub(super) layers: Option<Layers>,
    /// What is solved along whole lines; none under Gauss-Seidel.
    pub(super) lines: Option<Lines>,
}

impl Model {
    /// Builds the passes for a lamina under `physics`, which must have been checked.
    pub fn new(lamina: &Lamina, physics: &PhysicsConfig) -> Self {
        let shear = trellis(lamina, physics);
        let membranes = elements(lamina, physics);
        let membranes = membranes.into_iter().map(Pass::Membrane).collect();
        let (lines, passes) = match physics.solver {
            Solver::Yarn => {
                let passes = [membranes, hinges(lamina, physics)];
                (Some(Lines::new(lamina, physics, shear)), passes.concat())
            }
            Solver::GaussSeidel => {
                let passes = [
                    yarn_edges(lamina, physics),
                    membranes,
                    shear.map_or(Vec::new(), |trellis| diagonals(lamina, &trellis)),
                    triples(lamina, physics),
                    hinges(lamina, physics),
                ];
                (None, passes.concat())
            }
        };
        let friction = physics.friction.then(|| lamina.material.friction());
        Self {
            inverse_mass: lamina.mass.iter().map(|m| 1.0 / m).collect(),
            lines,
            passes,
            layers: Layers::new(lamina, physics.self_collision, friction),
            friction,
            tack: tack(lamina, physics),
            wind: None,
            physics: physics.clone(),
        }
    }

    /// The same in a frame that moves evenly with `velocity` [m/s]. Only damping knows the
    /// difference: it slows what moves against the air, which rests in the world.
    pub fn seen_from(mut self, velocity: [f64; 3]) -> Self {
        self.wind = Some(velocity.map(|u| -u));
        self
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

/// Tack times the area of each vertex, which is to the blank's as their masses.
fn tack(lamina: &Lamina, physics: &PhysicsConfig) -> Option<Vec<f64>> {
    let mass: f64 = lamina.mass.iter().sum();
    let per_mass = 1e3 * physics.adhesion * lamina.area() / mass;
    let pull = lamina.mass.iter().map(|m| per_mass * m);
    (physics.adhesion > 0.0).then(|| pull.collect())
}

/// Edge stiffness k = E h (b / a) of a yarn of width b and edge length a (Table 2).
pub(super) fn yarn_law(lamina: &Lamina, physics: &PhysicsConfig, yarn: &Yarn) -> EdgeLaw {
    let law = lamina.material.yarn(yarn.family);
    let per_modulus = lamina.material.thickness() * yarn.width / yarn.rest_length;
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

/// The law of the diagonals: near rest a spring of 2 G h for square cells, as such a diagonal
/// grows by a gamma / sqrt 2.
fn trellis(lamina: &Lamina, physics: &PhysicsConfig) -> Option<Trellis> {
    let shear = &lamina.material.shear;
    let moduli = [shear.positive.modulus(), shear.negative.modulus()];
    physics.shear.then(|| Trellis::new(lamina, moduli))
}

/// Ends, length at rest [m] and law of an edge.
type Edge = ([u32; 2], f64, EdgeLaw);

fn yarn_edges(lamina: &Lamina, physics: &PhysicsConfig) -> Vec<Pass> {
    let mut plain: Vec<Edge> = Vec::new();
    let (mut limited, mut limits): (Vec<Edge>, Vec<Limit>) = Default::default();
    for yarn in &lamina.yarns {
        let law = yarn_law(lamina, physics, yarn);
        let limit = Limit::of_yarn(law, lamina, physics, yarn);
        for pair in yarn.vertices.windows(2) {
            let edge = ([pair[0], pair[1]], yarn.rest_length, law);
            match limit {
                None => plain.push(edge),
                Some(limit) => {
                    limited.push(edge);
                    limits.push(limit);
                }
            }
        }
    }
    let plain = edge_classes(lamina, &plain).map(|(_, class)| Pass::Edges(class));
    let limited = edge_classes(lamina, &limited).map(|(edges, class)| {
        let limits = edges.iter().map(|&i| limits[i as usize]);
        Pass::LimitedEdges(class, limits.collect())
    });
    plain.chain(limited).collect()
}

fn diagonals(lamina: &Lamina, trellis: &Trellis) -> Vec<Pass> {
    let law = trellis.at_rest;
    let diagonals = lamina.diagonals.iter();
    let edges: Vec<Edge> = diagonals
        .map(|d| (d.vertices, d.rest_length, law))
        .collect();
    edge_classes(lamina, &edges)
        .map(|(_, class)| Pass::Diagonals(class, trellis.clone()))
        .collect()
}

/// The `edges` in colours: which they are, and as passes need them.
fn edge_classes<'a>(
    lamina: &Lamina,
    edges: &'a [Edge],
) -> impl Iterator<Item = (Vec<u32>, EdgeClass)> + 'a {
    let vertices: Vec<[u32; 2]> = edges.iter().map(|e| e.0).collect();
    color(lamina.vertex_count(), &vertices)
        .into_iter()
        .map(move |class| {
            let of = |&i: &u32| edges[i as usize];
            let edges = EdgeClass {
                vertices: class.iter().map(|i| of(i).0).collect(),
                rest_length: class.iter().map(|i| of(i).1).collect(),
                law: class.iter().map(|i| of(i).2).collect(),
            };
            (class, edges)
        })
}

/// Bending stiffness per width of a family [N m].
pub(super) fn bending_stiffness(lamina: &Lamina, physics: &PhysicsConfig, family: Family) -> f64 {
    match physics.bending_stiffness {
        BendingStiffness::Material => lamina.material.bending_stiffness(family),
        BendingStiffness::NewtonMetre(d) => d,
    }
}

/// Curvature is C / l^2, a vertex stands for the length l: energy = D b |C|^2 / 2 l^3.
fn triples(lamina: &Lamina, physics: &PhysicsConfig) -> Vec<Pass> {
    if physics.bending != Bending::Yarns {
        return Vec::new();
    }
    let triples: Vec<BendTriple> = lamina
        .yarns
        .iter()
        .flat_map(|yarn| {
            let stiffness = bending_stiffness(lamina, physics, yarn.family) * yarn.width;
            let compliance = yarn.rest_length.powi(3) / stiffness;
            let triples = yarn.vertices.windows(3);
            triples.map(move |v| BendTriple {
                vertices: [v[0], v[1], v[2]],
                compliance,
            })
        })
        .filter(|triple| triple.compliance.is_finite())
        .collect();
    let vertices: Vec<_> = triples.iter().map(|t| t.vertices).collect();
    classes_of(&triples, color(lamina.vertex_count(), &vertices))
        .map(Pass::Triples)
        .collect()
}

/// Dihedral bending: everywhere if it is asked for, else along and beside membranes, where
/// there is no yarn to bend.
fn hinges(lamina: &Lamina, physics: &PhysicsConfig) -> Vec<Pass> {
    let hinges: Vec<Hinge> = match physics.bending {
        Bending::Off => Vec::new(),
        Bending::Yarns => lamina.membrane_hinges(),
        Bending::Dihedral => lamina.hinges(),
    };
    let of = |family| bending_stiffness(lamina, physics, family);
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
