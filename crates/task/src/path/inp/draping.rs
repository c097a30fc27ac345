use std::collections::BTreeMap;

use super::{Deck, MM, number};
use crate::path::Frame;
use drape_cloth::math::Vec3;
use drape_cloth::mesh::TriMesh;

/// Transverse shear stiffness of the fabric, warp and weft [N/mm] (paper, Table 2).
const TRANSVERSE_SHEAR: f64 = 27.2;
/// Height of the tool's wedges in CalculiX [m]; nothing moves in them.
const TOOL_HEIGHT: f64 = 5e-3;
/// How deep the pressure of a press goes into the tool in CalculiX [mm].
const DEPTH: f64 = 0.05;
/// Tension at which contact in CalculiX gives way [MPa]: a thirtieth of a light fabric's weight. What it
/// takes by default holds cloth to the tool.
const TENSION: f64 = 1e-7;
/// Stiffness against sticking slip over that of contact in CalculiX [-].
const STICK: f64 = 0.1;
/// Time in which the cloth settles before the first press in Abaqus [s].
const SETTLING: f64 = 0.5;
/// Label of the tool's reference node in Abaqus.
const REFERENCE: usize = 9_000_000;

/// Which programme shall read the deck.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Dialect {
    /// Elastic orthotropic fabric on a fixed tool, weight and presses one after the other in one
    /// static step. In a step of its own each, contact is built up anew and the second fails.
    Calculix,
    /// Fabric by test data, rigid tool, explicit steps: the paper's model.
    Abaqus,
}

/// What a deck says about a fabric.
#[derive(Clone, Debug, PartialEq)]
pub struct FabricCard {
    /// [m]
    pub thickness: f64,
    /// [kg/m^2]
    pub areal_mass: f64,
    /// Points of strain and stress [MPa], from [0, 0] on, of warp and weft.
    pub tension: [Vec<[f64; 2]>; 2],
    /// Points of compressive strain and stress [MPa], both counted positive, of warp and weft.
    pub compression: [Vec<[f64; 2]>; 2],
    /// Points of change of the yarn angle [rad] and stress [MPa], for closing and opening.
    pub shear: [Vec<[f64; 2]>; 2],
    /// Bending stiffness per width of warp and weft [N m].
    pub bending: [f64; 2],
    /// Static and dynamic friction against the tool.
    pub friction: [f64; 2],
}

/// A lamina above or on the tool, and presses in their order.
#[derive(Clone, Debug)]
pub struct DrapingDeck<'a> {
    pub title: &'a str,
    /// In the order of the lamina's vertices [m]; what a solver takes for free of stress.
    pub lamina: &'a TriMesh,
    /// Directions of warp and weft in every triangle, of any length.
    pub yarns: &'a [[Vec3; 2]],
    /// Vertices that are held, and how far they move before the first press [m]; in Abaqus they
    /// do not.
    pub clamped: &'a [(u32, Vec3)],
    pub tool: &'a TriMesh,
    pub fabric: &'a FabricCard,
    /// Triangles under the stencil, press by press.
    pub presses: &'a [Vec<u32>],
    /// From one press to the next in Abaqus [s].
    pub step_s: f64,
    /// Pressure on a triangle from its first press on [Pa].
    pub pressure: f64,
    /// Along -z of the scene [m/s^2].
    pub gravity: f64,
    /// What the deck's coordinates count from; all the above are of the scene.
    pub frame: Frame,
}

impl DrapingDeck<'_> {
    /// The deck. A press that meets no new triangle has no step.
    pub fn deck(&self, dialect: Dialect) -> Deck {
        let mut deck = Deck::new(self.title);
        deck.comment("written by drape; mm, N, s, t, MPa");
        for remark in self.frame.remarks() {
            deck.comment(&remark);
        }
        deck.comment("LAMINA: nodes and elements in the order of drape's vertices and triangles")
            .nodes("LAMINA_NODES", 1, &self.placed(&self.lamina.vertices));
        let first_node = 1 + self.lamina.vertices.len();
        let first = 1 + self.lamina.triangles.len();
        let cells = self.cells(dialect);
        match dialect {
            Dialect::Calculix => {
                let shells = Shells::new(self.lamina, &cells);
                let first_tool = first_node + shells.middles.len();
                let thickness = self.fabric.elastic_thickness() / MM;
                let (nodes, wedges) = wedges(self.tool, 0.5 * thickness);
                deck.nodes("MIDDLE_NODES", first_node, &self.placed(&shells.middles));
                let (labels, corners) = &shells.of_cells;
                deck.elements("S8R", "LAMINA", labels.iter().copied(), 1, corners);
                let (labels, corners) = &shells.of_triangles;
                if !labels.is_empty() {
                    deck.elements("S6", "LAMINA", labels.iter().copied(), 1, corners);
                }
                deck.nodes("TOOL_NODES", first_tool, &self.placed(&nodes))
                    .elements("C3D6", "TOOL", first.., first_tool, &wedges);
            }
            Dialect::Abaqus => {
                deck.elements("S3", "LAMINA", 1.., 1, &self.lamina.triangles)
                    .nodes("TOOL_NODES", first_node, &self.placed(&self.tool.vertices))
                    .elements("R3D3", "TOOL", first.., first_node, &self.tool.triangles);
            }
        }
        if !self.clamped.is_empty() {
            let clamped = self.clamped.iter().map(|(v, _)| 1 + *v as usize);
            deck.card("NSET, NSET=CLAMPS")
                .labels(&clamped.collect::<Vec<_>>());
        }
        let presses = self.new_elements(&cells);
        for (k, triangles) in presses.iter().enumerate() {
            deck.card(&format!("ELSET, ELSET=PRESS_{}", k + 1))
                .labels(triangles);
        }
        self.orientation(&mut deck, dialect, &cells);
        self.section(&mut deck, dialect);
        self.contact(&mut deck, dialect);

        deck.card("BOUNDARY");
        match dialect {
            Dialect::Calculix => deck.line("TOOL_NODES, 1, 3"),
            Dialect::Abaqus => deck.line(&format!("{REFERENCE}, 1, 6")),
        };
        if !self.clamped.is_empty() {
            deck.line("CLAMPS, 1, 3");
        }
        // Both programmes count pressure on a shell along its normal, which points away from the
        // tool.
        let pressure = number(-1e-6 * self.pressure);
        let press = |k| format!("PRESS_{}, P, {pressure}", k + 1);
        let down = self.frame.direction(&-Vec3::z());
        // No sign on zero.
        let down: Vec<String> = down.iter().map(|x| number(x + 0.0)).collect();
        let strength = number(MM * self.gravity);
        let gravity = format!("LAMINA, GRAV, {strength}, {}", down.join(", "));
        let loads: Vec<String> = std::iter::once(gravity)
            .chain((0..presses.len()).map(press))
            .collect();
        match dialect {
            Dialect::Calculix => self.static_step(&mut deck, &loads),
            Dialect::Abaqus => {
                for (k, load) in loads.iter().enumerate() {
                    let seconds = if k == 0 { SETTLING } else { self.step_s };
                    explicit_step(&mut deck, seconds, load);
                }
            }
        }
        deck
    }

    /// Points of the scene in the deck's frame.
    fn placed(&self, points: &[Vec3]) -> Vec<Vec3> {
        points.iter().map(|x| self.frame.point(x)).collect()
    }

    /// The triangle by which the element of each is called: the first of two that are a
    /// parallelogram, which CalculiX has as one, or else itself.
    fn cells(&self, dialect: Dialect) -> Vec<usize> {
        let TriMesh {
            vertices,
            triangles,
        } = self.lamina;
        let mut cells: Vec<usize> = (0..triangles.len()).collect();
        if dialect == Dialect::Abaqus {
            return cells;
        }
        for t in 1..triangles.len() {
            let ([a, b, c], [p, q, d]) = (triangles[t - 1], triangles[t]);
            let at = |v: u32| vertices[v as usize];
            let off = (at(a) - at(b) + at(c) - at(d)).norm();
            let is_even = off < 1e-6 * (at(a) - at(c)).norm();
            if [p, q] == [a, c] && is_even && cells[t - 1] == t - 1 {
                cells[t] = t - 1;
            }
        }
        cells
    }

    /// Labels of the elements that each press meets first; none of a press are left out.
    fn new_elements(&self, cells: &[usize]) -> Vec<Vec<usize>> {
        let mut is_pressed = vec![false; cells.len()];
        let fresh = self.presses.iter().map(|triangles| -> Vec<usize> {
            let elements = triangles.iter().map(|&t| cells[t as usize]);
            let first = |&element: &usize| !std::mem::replace(&mut is_pressed[element], true);
            elements.filter(first).map(|element| 1 + element).collect()
        });
        fresh.filter(|elements| !elements.is_empty()).collect()
    }

    /// A local frame in every element, the first axis along the warp.
    fn orientation(&self, deck: &mut Deck, dialect: Dialect, cells: &[usize]) {
        match dialect {
            Dialect::Calculix => deck.card("DISTRIBUTION, NAME=YARN_DIRECTIONS"),
            Dialect::Abaqus => deck
                .card("DISTRIBUTION TABLE, NAME=YARN_TABLE")
                .line("COORD3D, COORD3D")
                .card("DISTRIBUTION, NAME=YARN_DIRECTIONS, LOCATION=ELEMENT, TABLE=YARN_TABLE"),
        };
        deck.line(", 1., 0., 0., 0., 1., 0.");
        let elements = self
            .yarns
            .iter()
            .enumerate()
            .filter(|(t, _)| cells[*t] == *t);
        for (t, [warp, weft]) in elements {
            let unit = |v: &Vec3, other: Vec3| {
                let unit = v.try_normalize(0.0).unwrap_or(other);
                self.frame.direction(&unit)
            };
            let (a, b) = (unit(warp, Vec3::x()), unit(weft, Vec3::y()));
            let numbers: Vec<String> = a.iter().chain(&b).map(|x| format!("{x:.6}")).collect();
            deck.line(&format!("{}, {}", t + 1, numbers.join(", ")));
        }
        let system = "SYSTEM=RECTANGULAR";
        match dialect {
            Dialect::Calculix => {
                deck.card(&format!("ORIENTATION, NAME=YARNS, {system}"))
                    .line("YARN_DIRECTIONS");
            }
            Dialect::Abaqus => {
                for (degrees, elements) in self.crossings() {
                    let name = crossing(degrees);
                    let (sin, cos) = (degrees as f64).to_radians().sin_cos();
                    deck.card(&format!("ELSET, ELSET={name}"))
                        .labels(&elements)
                        .card(&format!(
                            "ORIENTATION, NAME={name}, {system}, LOCAL DIRECTIONS=2"
                        ))
                        .line("YARN_DIRECTIONS")
                        .line("3, 0.")
                        .line("1., 0., 0.")
                        .line(&format!("{cos:.6}, {sin:.6}, 0."));
                }
            }
        }
    }

    /// Labels of the elements whose yarns cross at about so many whole degrees, by these.
    ///
    /// A distribution gives each element axes of its own in Abaqus, but orthogonal ones. How the yarns of sheared fabric lie
    /// between them, `LOCAL DIRECTIONS` says, once for all elements of an orientation.
    fn crossings(&self) -> BTreeMap<u32, Vec<usize>> {
        let mut crossings: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for (t, [warp, weft]) in self.yarns.iter().enumerate() {
            let angle = warp.angle(weft).to_degrees().round();
            // Never parallel; a yarn without length crosses at a right angle.
            let degrees = if angle > 0.0 {
                angle.clamp(1.0, 179.0)
            } else {
                90.0
            };
            crossings.entry(degrees as u32).or_default().push(t + 1);
        }
        crossings
    }

    /// One step for CalculiX in which load k grows evenly from time k to k + 1 and then stays.
    fn static_step(&self, deck: &mut Deck, loads: &[String]) {
        deck.card("TIME POINTS, NAME=ENDS, GENERATE");
        deck.line(&format!("1., {}., 1.", loads.len()));
        for k in 0..loads.len() {
            deck.card(&format!("AMPLITUDE, NAME=LOAD_{k}"))
                .line(&format!("{k}., 0., {}., 1.", k + 1));
        }
        deck.card("STEP, NLGEOM, INC=1000000").card("STATIC").row(&[
            0.01,
            loads.len() as f64,
            1e-9,
            0.2,
        ]);
        let moved = self.clamped.iter().filter(|(_, by)| *by != Vec3::zeros());
        for (v, by) in moved {
            deck.card("BOUNDARY, AMPLITUDE=LOAD_0");
            for (axis, by) in self.frame.direction(by).iter().enumerate() {
                let (node, axis) = (1 + v, axis + 1);
                deck.line(&format!("{node}, {axis}, {axis}, {}", number(MM * by)));
            }
        }
        for (k, load) in loads.iter().enumerate() {
            deck.card(&format!("DLOAD, AMPLITUDE=LOAD_{k}")).line(load);
        }
        deck.card("NODE FILE, TIME POINTS=ENDS")
            .line("U")
            .card("NODE PRINT, NSET=LAMINA_NODES, TIME POINTS=ENDS")
            .line("U")
            .card("END STEP");
    }

    /// Materials and sections of lamina and tool.
    fn section(&self, deck: &mut Deck, dialect: Dialect) {
        let fabric = self.fabric;
        let density = |thickness: f64| 1e-12 * fabric.areal_mass / (thickness / MM);
        let section = |elements: &str, orientation: &str| {
            format!("SHELL SECTION, ELSET={elements}, MATERIAL=FABRIC, ORIENTATION={orientation}")
        };
        deck.card("MATERIAL, NAME=FABRIC");
        match dialect {
            Dialect::Calculix => {
                let thickness = fabric.elastic_thickness();
                let share = MM * fabric.thickness / thickness;
                let [warp, weft] = fabric.tension.each_ref().map(|curve| share * slope(curve));
                let [closing, opening] = fabric.shear.each_ref().map(|curve| slope(curve));
                let shear = share * 0.5 * (closing + opening);
                let across = TRANSVERSE_SHEAR / thickness;
                deck.card("ELASTIC, TYPE=ENGINEERING CONSTANTS")
                    .row(&[warp, weft, weft, 0.0, 0.0, 0.0, shear, across])
                    .row(&[across])
                    .card("DENSITY")
                    .row(&[density(thickness)])
                    .card("MATERIAL, NAME=TOOL")
                    .card("ELASTIC")
                    .row(&[210e3, 0.3])
                    .card("DENSITY")
                    .row(&[7.85e-9])
                    .card(&section("LAMINA", "YARNS"))
                    .row(&[thickness])
                    .card("SOLID SECTION, ELSET=TOOL, MATERIAL=TOOL");
            }
            Dialect::Abaqus => {
                let thickness = MM * fabric.thickness;
                deck.card("DENSITY")
                    .row(&[density(thickness)])
                    .card("FABRIC, STRESS FREE INITIAL SLACK=NO");
                let curves = [
                    ("1", &fabric.tension[0], &fabric.compression[0]),
                    ("2", &fabric.tension[1], &fabric.compression[1]),
                    ("SHEAR", &fabric.shear[0], &fabric.shear[1]),
                ];
                for (component, positive, negative) in curves {
                    deck.card(&format!("UNIAXIAL, COMPONENT={component}"))
                        .card("LOADING DATA, EXTRAPOLATION=LINEAR");
                    let negative = negative.iter().skip(1).rev();
                    for [strain, stress] in negative.map(|p| p.map(|x| -x)) {
                        deck.row(&[stress, strain]);
                    }
                    for [strain, stress] in positive {
                        deck.row(&[*stress, *strain]);
                    }
                }
                for degrees in self.crossings().into_keys() {
                    let name = crossing(degrees);
                    deck.card(&section(&name, &name))
                        .row(&[thickness])
                        .card("TRANSVERSE SHEAR")
                        .row(&[TRANSVERSE_SHEAR, TRANSVERSE_SHEAR, 0.0]);
                }
                deck.card("NODE")
                    .line(&format!("{REFERENCE}, 0., 0., 0."))
                    .card(&format!("RIGID BODY, ELSET=TOOL, REF NODE={REFERENCE}"));
            }
        }
    }

    fn contact(&self, deck: &mut Deck, dialect: Dialect) {
        let [statics, dynamic] = self.fabric.friction;
        deck.card("SURFACE, NAME=LAMINA_BELOW")
            .line("LAMINA, SNEG")
            .card("SURFACE, NAME=TOOL_ABOVE")
            .line(match dialect {
                Dialect::Calculix => "TOOL, S2",
                Dialect::Abaqus => "TOOL, SPOS",
            })
            .card("SURFACE INTERACTION, NAME=CONTACT");
        match dialect {
            Dialect::Calculix => {
                let stiffness = 1e-6 * self.pressure / DEPTH;
                deck.card("SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR")
                    .row(&[stiffness, TENSION]);
                if statics + dynamic > 0.0 {
                    deck.card("FRICTION")
                        .row(&[0.5 * (statics + dynamic), STICK * stiffness]);
                }
                // Surface to surface takes everything for touching that is nearer than
                // 1 / stiffness, and so glues the sheet to the tool at first.
                deck.card("CONTACT PAIR, INTERACTION=CONTACT, TYPE=NODE TO SURFACE")
                    .line("LAMINA_BELOW, TOOL_ABOVE")
            }
            Dialect::Abaqus => deck
                .card("FRICTION, EXPONENTIAL DECAY")
                .row(&[statics, dynamic, 1.0])
                .card("CONTACT")
                .card("CONTACT INCLUSIONS")
                .line("LAMINA_BELOW, TOOL_ABOVE")
                .card("CONTACT PROPERTY ASSIGNMENT")
                .line("LAMINA_BELOW, TOOL_ABOVE, CONTACT"),
        };
    }
}

impl FabricCard {
    /// Thickness [mm] at which an elastic shell of the same stiffness in its plane bends as the
    /// fabric does: D = E h^3 / 12 at E h as measured gives h; the geometric mean of warp and
    /// weft. The fabric itself is thicker, but its yarns slide on each other.
    pub fn elastic_thickness(&self) -> f64 {
        let square = |family: usize| {
            let membrane = 1e6 * slope(&self.tension[family]) * self.thickness;
            12.0 * self.bending[family] / membrane
        };
        MM * (square(0) * square(1)).powf(0.25)
    }
}

/// What the elements whose yarns cross at so many degrees, and their orientation, are called.
fn crossing(degrees: u32) -> String {
    format!("YARNS_{degrees}")
}

/// Slope of a curve at its start.
fn slope(curve: &[[f64; 2]]) -> f64 {
    curve.get(1).map_or(0.0, |[strain, stress]| stress / strain)
}

/// Quadratic shells for CalculiX, with their labels: of eight nodes where two triangles make a
/// cell, of six where not. Those of six are too stiff for a cell: with them the pressed sheet of
/// `tests/calculix.rs` is off by half as much again.
#[derive(Default)]
struct Shells {
    /// Middles of sides, whose nodes count on from the vertices.
    middles: Vec<Vec3>,
    of_cells: (Vec<usize>, Vec<[u32; 8]>),
    of_triangles: (Vec<usize>, Vec<[u32; 6]>),
}

impl Shells {
    fn new(mesh: &TriMesh, cells: &[usize]) -> Self {
        let mut shells = Self::default();
        let mut known = BTreeMap::new();
        let mut middle = |p: u32, q: u32| {
            *known.entry([p.min(q), p.max(q)]).or_insert_with(|| {
                let [p, q] = [p, q].map(|v| mesh.vertices[v as usize]);
                shells.middles.push((p + q) * 0.5);
                (mesh.vertices.len() + shells.middles.len() - 1) as u32
            })
        };
        for (t, &[a, b, c]) in mesh.triangles.iter().enumerate() {
            if cells[t] != t {
                continue;
            }
            let [ab, bc] = [middle(a, b), middle(b, c)];
            if cells.get(t + 1) == Some(&t) {
                let d = mesh.triangles[t + 1][2];
                let [cd, da] = [middle(c, d), middle(d, a)];
                shells.of_cells.0.push(1 + t);
                shells.of_cells.1.push([a, b, c, d, ab, bc, cd, da]);
            } else {
                shells.of_triangles.0.push(1 + t);
                shells.of_triangles.1.push([a, b, c, ab, bc, middle(c, a)]);
            }
        }
        shells
    }
}

/// Nodes and wedges below what of the tool faces up. Their upper side lies `depth` [m] inside the
/// tool, so that the middle of a shell twice as thick lies on it.
fn wedges(tool: &TriMesh, depth: f64) -> (Vec<Vec3>, Vec<[u32; 6]>) {
    let upper = tool.vertices.iter().zip(tool.vertex_normals());
    let mut nodes: Vec<Vec3> = upper.map(|(x, normal)| x - normal * depth).collect();
    let count = nodes.len() as u32;
    let faces_up = |[a, b, c]: &&[u32; 3]| {
        let [a, b, c] = [a, b, c].map(|v| tool.vertices[*v as usize]);
        let normal = (b - a).cross(&(c - a));
        normal.z > 1e-3 * normal.norm()
    };
    let upwards = tool.triangles.iter().filter(faces_up);
    let wedges = upwards.map(|&[a, b, c]| [count + a, count + b, count + c, a, b, c]);
    let wedges = wedges.collect();
    nodes.extend_from_within(..);
    for node in &mut nodes[count as usize..] {
        node.z -= TOOL_HEIGHT;
    }
    (nodes, wedges)
}

/// One step for Abaqus with one load, which later steps keep.
fn explicit_step(deck: &mut Deck, seconds: f64, load: &str) {
    deck.card("STEP, NLGEOM=YES")
        .card("DYNAMIC, EXPLICIT")
        .line(&format!(", {}", number(seconds)))
        .card("DLOAD, OP=MOD")
        .line(load)
        .card("OUTPUT, FIELD, NUMBER INTERVAL=1")
        .card("NODE OUTPUT")
        .line("U")
        .card("END STEP");
}

#[cfg(test)]
mod tests;
