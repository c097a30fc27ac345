//! Arms from URDF: one chain of six turning joints, shapes as convex hulls.

use std::path::{Path, PathBuf};

use nalgebra::{Point3, Rotation3, Translation3, Unit, Vector3};
use roxmltree::{Document, Node};

use super::arm::{Arm, ArmError, Joint};
use super::place::Pose;

/// Names by which descriptions call the flange, the last first.
const FLANGES: [&str; 3] = ["tool0", "flange", "tool"];
/// Files of shapes [bytes], and corners that they may have.
const MAX_BYTES: u64 = 64 << 20;
/// Links that a description may have.
const MAX_LINKS: usize = 256;

/// A joint between two links.
struct Edge<'a> {
    node: Node<'a, 'a>,
    name: &'a str,
    kind: &'a str,
    parent: &'a str,
    child: &'a str,
}

impl Arm {
    /// Reads an arm from the text of the URDF file at `file`. The chain leads from the root to a link called tool0, flange
    /// or tool, or else to the end of the last of six joints that turn; fixed joints between are folded in, links beside
    /// it do not count. Shapes are the convex hulls of collision meshes (STL), boxes, cylinders and balls.
    ///
    /// # Errors
    /// If it describes no such arm, or a mesh is not there: with line and column, what was found and what was expected.
    pub fn from_urdf(text: &str, file: &Path) -> Result<Self, ArmError> {
        let at = |place: String, fault: String| ArmError {
            file: file.into(),
            place,
            fault,
        };
        let document = Document::parse(text).map_err(|error| {
            let place = error.pos();
            at(
                format!(":{}:{}", place.row, place.col),
                format!("no XML: {}", error.to_string().escape_debug()),
            )
        })?;
        let fail = |node: Node, fault: String| {
            let place = document.text_pos_at(node.range().start);
            at(format!(":{}:{}", place.row, place.col), fault)
        };
        let robot = document.root_element();
        if !robot.has_tag_name("robot") {
            let found = robot.tag_name().name();
            return Err(fail(
                robot,
                format!("the root is <{found}>, expected <robot>"),
            ));
        }
        let named = |tag: &'static str| robot.children().filter(move |node| node.has_tag_name(tag));
        let mut links: Vec<(&str, Node)> = Vec::new();
        for node in named("link") {
            let name = node
                .attribute("name")
                .ok_or_else(|| fail(node, "a link has no name, expected one".into()))?;
            if links.iter().any(|(known, _)| *known == name) {
                return Err(fail(
                    node,
                    format!("link {name:?} is there twice, expected names of their own"),
                ));
            }
            links.push((name, node));
        }
        if links.len() > MAX_LINKS {
            return Err(fail(
                robot,
                format!("{} links, expected at most {MAX_LINKS}", links.len()),
            ));
        }
        let mut edges: Vec<Edge> = Vec::new();
        for node in named("joint") {
            let own = |key: &str| node.attribute(key).unwrap_or_default();
            let of = |tag: &str| {
                let child = node.children().find(|child| child.has_tag_name(tag));
                child
                    .and_then(|child| child.attribute("link"))
                    .unwrap_or_default()
            };
            let edge = Edge {
                node,
                name: own("name"),
                kind: own("type"),
                parent: of("parent"),
                child: of("child"),
            };
            for (what, link) in [("parent", edge.parent), ("child", edge.child)] {
                if !links.iter().any(|(known, _)| *known == link) {
                    let fault = format!(
                        "joint {:?}: its {what} is {link:?}, expected a link",
                        edge.name
                    );
                    return Err(fail(node, fault));
                }
            }
            if let Some(other) = edges.iter().find(|other| other.child == edge.child) {
                let fault = format!(
                    "link {:?} hangs on joints {:?} and {:?}, expected one: a tree without loops",
                    edge.child, other.name, edge.name
                );
                return Err(fail(node, fault));
            }
            edges.push(edge);
        }
        let mut roots = links
            .iter()
            .filter(|(name, _)| edges.iter().all(|edge| edge.child != *name));
        let (root, others) = (roots.next(), roots.count());
        let Some((root, _)) = root.filter(|_| others == 0) else {
            let found = root.map_or(0, |_| 1 + others);
            return Err(fail(
                robot,
                format!("{found} links hang on no joint, expected one: the base"),
            ));
        };
        // From the tip to the root.
        let tip = FLANGES
            .iter()
            .find(|name| links.iter().any(|(known, _)| known == *name));
        let tip = tip.copied().unwrap_or_else(|| deepest(&edges, root));
        let mut chain: Vec<&Edge> = Vec::new();
        let mut link = tip;
        while let Some(edge) = edges.iter().find(|edge| edge.child == link) {
            chain.push(edge);
            link = edge.parent;
            // Loops that the root is no part of.
            if chain.len() > edges.len() {
                return Err(fail(
                    edge.node,
                    format!("link {link:?} hangs on itself, expected a tree"),
                ));
            }
        }
        chain.reverse();
        if link != *root {
            return Err(fail(
                robot,
                format!("link {tip:?} does not hang on {root:?}, expected one tree"),
            ));
        }
        let mut joints: Vec<Joint> = Vec::new();
        let mut hulls: Vec<Vec<Vector3<f64>>> = vec![Vec::new()];
        // What fixed joints have moved since the last one that turns.
        let mut moved = Pose::identity();
        let shape = |link: &str, moved: &Pose| -> Result<Vec<Vector3<f64>>, ArmError> {
            let (_, node) = links
                .iter()
                .find(|(known, _)| *known == link)
                .expect("checked above");
            corners(*node, moved, file)
                .map_err(|(node, fault)| fail(node, format!("link {link:?}: {fault}")))
        };
        hulls[0].extend(shape(root, &moved)?);
        for edge in chain {
            let wrong = |fault: String| fail(edge.node, format!("joint {:?}: {fault}", edge.name));
            if edge
                .node
                .children()
                .any(|child| child.has_tag_name("mimic"))
            {
                return Err(wrong(
                    "it mimics another, expected six that turn by themselves".into(),
                ));
            }
            let origin = moved * origin(edge.node).map_err(&wrong)?;
            match edge.kind {
                "fixed" => moved = origin,
                "revolute" | "continuous" => {
                    joints.push(turning(edge, origin).map_err(wrong)?);
                    hulls.push(Vec::new());
                    moved = Pose::identity();
                }
                kind => {
                    let expected = "expected revolute, continuous or fixed";
                    return Err(wrong(format!("its type is {kind:?}, {expected}")));
                }
            }
            let own = shape(edge.child, &moved)?;
            hulls.last_mut().expect("the base's at least").extend(own);
        }
        let found = joints.len();
        let joints = <[Joint; 6]>::try_from(joints).map_err(|_| {
            fail(
                robot,
                format!("{found} joints turn between {root:?} and {tip:?}, expected 6"),
            )
        })?;
        let arm = Self {
            name: robot.attribute("name").unwrap_or("arm").into(),
            joints,
            flange: moved,
            hulls: hulls
                .try_into()
                .expect("one for each of six joints and the base"),
        };
        arm.checked().map_err(|fault| at(String::new(), fault))
    }
}

/// The last link of the chain with most turning joints; of equals the first.
fn deepest<'a>(edges: &[Edge<'a>], root: &'a str) -> &'a str {
    let mut best = (0, root);
    let mut open = vec![(0, root)];
    // Each link hangs on one joint: none is seen twice.
    while let Some((turning, link)) = open.pop() {
        if turning > best.0 {
            best = (turning, link);
        }
        for edge in edges.iter().filter(|edge| edge.parent == link).rev() {
            open.push((turning + usize::from(edge.kind != "fixed"), edge.child));
        }
    }
    best.1
}

fn turning(edge: &Edge, origin: Pose) -> Result<Joint, String> {
    let child = |tag: &str| edge.node.children().find(|child| child.has_tag_name(tag));
    let axis = match child("axis") {
        Some(axis) => vector(axis, "xyz")?.unwrap_or(Vector3::x()),
        None => Vector3::x(),
    };
    let limit = child("limit");
    let number = |key: &str| -> Result<f64, String> {
        let text = limit.and_then(|limit| limit.attribute(key));
        let text = text
            .ok_or_else(|| format!("its limit has no {key:?}, expected a number [rad, rad/s]"))?;
        text.trim()
            .parse()
            .map_err(|_| format!("its limit's {key} is {text:?}, expected a number"))
    };
    let limits = match edge.kind {
        "continuous" => [-std::f64::consts::TAU, std::f64::consts::TAU],
        _ => [number("lower")?, number("upper")?],
    };
    Ok(Joint {
        origin,
        axis: Unit::new_unchecked(axis),
        limits,
        speed: number("velocity")?,
    })
}

/// The frame of a joint or a shape in that of its parent.
fn origin(node: Node) -> Result<Pose, String> {
    let Some(origin) = node.children().find(|child| child.has_tag_name("origin")) else {
        return Ok(Pose::identity());
    };
    let at = vector(origin, "xyz")?.unwrap_or_default();
    let turned = vector(origin, "rpy")?.unwrap_or_default();
    let turned = Rotation3::from_euler_angles(turned.x, turned.y, turned.z);
    Ok(Pose::from_parts(Translation3::from(at), turned))
}

fn vector(node: Node, key: &str) -> Result<Option<Vector3<f64>>, String> {
    let Some(text) = node.attribute(key) else {
        return Ok(None);
    };
    let numbers: Result<Vec<f64>, _> = text.split_whitespace().map(str::parse).collect();
    let numbers = numbers
        .ok()
        .filter(|numbers| numbers.len() == 3 && numbers.iter().all(|x| x.is_finite()));
    let wrong = || format!("{key} is {text:?}, expected three numbers");
    numbers
        .map(|numbers| Some(Vector3::from_row_slice(&numbers)))
        .ok_or_else(wrong)
}

/// Corners of a link's shapes in the frame of its joint, which it is `moved` from.
fn corners<'a>(
    link: Node<'a, 'a>,
    moved: &Pose,
    file: &Path,
) -> Result<Vec<Vector3<f64>>, (Node<'a, 'a>, String)> {
    let mut all = Vec::new();
    for shape in link
        .children()
        .filter(|child| child.has_tag_name("collision"))
    {
        let at = moved * origin(shape).map_err(|fault| (shape, fault))?;
        let geometry = shape
            .children()
            .find(|child| child.has_tag_name("geometry"));
        let kind = geometry.and_then(|geometry| geometry.children().find(Node::is_element));
        let Some(kind) = kind else {
            return Err((
                shape,
                "a shape without geometry, expected mesh, box, cylinder or sphere".into(),
            ));
        };
        let number = |key: &str| {
            let text = kind.attribute(key).unwrap_or_default();
            let found = text
                .trim()
                .parse()
                .ok()
                .filter(|x: &f64| x.is_finite() && *x > 0.0);
            found.ok_or_else(|| {
                (
                    kind,
                    format!("{key} is {text:?}, expected a number above 0"),
                )
            })
        };
        let own = match kind.tag_name().name() {
            "box" => {
                let size = vector(kind, "size").map_err(|fault| (kind, fault))?;
                let size = size
                    .ok_or_else(|| (kind, "a box without size, expected three numbers".into()))?;
                let corner = |k: usize| {
                    let sign = |bit: usize| if k >> bit & 1 == 0 { -0.5 } else { 0.5 };
                    size.component_mul(&Vector3::new(sign(0), sign(1), sign(2)))
                };
                (0..8).map(corner).collect()
            }
            "cylinder" => {
                let (radius, half) = (number("radius")?, 0.5 * number("length")?);
                ring(radius)
                    .flat_map(|[x, y]| [-half, half].map(|z| Vector3::new(x, y, z)))
                    .collect()
            }
            "sphere" => {
                let radius = number("radius")?;
                let rows = [-0.9, -0.5, 0.0, 0.5, 0.9f64];
                let row = |z: f64| {
                    ring(radius * (1.0 - z * z).sqrt())
                        .map(move |[x, y]| Vector3::new(x, y, radius * z))
                };
                rows.into_iter().flat_map(row).collect()
            }
            "mesh" => {
                let name = kind.attribute("filename").unwrap_or_default();
                let scale = vector(kind, "scale").map_err(|fault| (kind, fault))?;
                let scale = scale.unwrap_or(Vector3::repeat(1.0));
                let points = mesh(name, file).map_err(|fault| (kind, fault))?;
                points
                    .iter()
                    .map(|p| p.component_mul(&scale))
                    .collect::<Vec<_>>()
            }
            other => {
                return Err((
                    kind,
                    format!("geometry {other:?}, expected mesh, box, cylinder or sphere"),
                ));
            }
        };
        all.extend(own.iter().map(|p| (at * Point3::from(*p)).coords));
    }
    Ok(hull(&all))
}

/// Corners round the z axis whose polygon holds the circle.
fn ring(radius: f64) -> impl Iterator<Item = [f64; 2]> {
    let out = radius / (std::f64::consts::PI / 16.0).cos();
    (0..16).map(move |k| {
        let (sin, cos) = (f64::from(k) * std::f64::consts::FRAC_PI_8).sin_cos();
        [out * cos, out * sin]
    })
}

/// The corners that a convex hull needs.
fn hull(points: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let points: Vec<_> = points
        .iter()
        .map(|p| parry3d_f64::math::Vector::new(p.x, p.y, p.z))
        .collect();
    let hull = parry3d_f64::shape::ConvexPolyhedron::from_convex_hull(&points);
    let kept = hull.map_or(points, |hull| hull.points().to_vec());
    kept.iter().map(|p| Vector3::new(p.x, p.y, p.z)).collect()
}

/// Corners of an STL file that a description names.
fn mesh(name: &str, file: &Path) -> Result<Vec<Vector3<f64>>, String> {
    let path = locate(name, file).ok_or_else(|| {
        format!("mesh {name:?} is not there, expected a file beside the description or in a folder above it")
    })?;
    let shown = path.display();
    let size = std::fs::metadata(&path)
        .map_err(|error| format!("mesh {shown}: {error}"))?
        .len();
    if size > MAX_BYTES {
        return Err(format!(
            "mesh {shown} has {size} bytes, expected at most {MAX_BYTES}"
        ));
    }
    let bytes = std::fs::read(&path).map_err(|error| format!("mesh {shown}: {error}"))?;
    let points = stl(&bytes)
        .filter(|points| !points.is_empty() && points.iter().flatten().all(|x| x.is_finite()));
    let points = points
        .ok_or_else(|| format!("mesh {shown} is no STL, expected triangles in binary or ASCII"))?;
    Ok(points.into_iter().map(Vector3::from).collect())
}

/// The file that a description means: `package://NAME/REST` is looked for in the folders above.
fn locate(name: &str, file: &Path) -> Option<PathBuf> {
    let folder = file.parent().unwrap_or(Path::new(""));
    let plain = name.strip_prefix("file://").unwrap_or(name);
    let Some(within) = name.strip_prefix("package://") else {
        return Some(folder.join(plain)).filter(|path| path.is_file());
    };
    let rest = within.split_once('/').map_or(within, |(_, rest)| rest);
    let folder = std::path::absolute(folder).ok()?;
    let above = folder
        .ancestors()
        .flat_map(|above| [above.join(within), above.join(rest)]);
    above.into_iter().find(|path| path.is_file())
}

/// Corners of the triangles of an STL file.
fn stl(bytes: &[u8]) -> Option<Vec<[f64; 3]>> {
    let count = bytes
        .get(80..84)
        .map(|count| u32::from_le_bytes(count.try_into().expect("four bytes")) as usize);
    if let Some(count) = count
        && bytes.len() - 84 == count.checked_mul(50)?
    {
        let number =
            |bytes: &[u8]| f64::from(f32::from_le_bytes(bytes.try_into().expect("four bytes")));
        let triangles = bytes[84..].chunks_exact(50).flat_map(|facet| {
            let corner = move |k: usize| {
                std::array::from_fn(|j| {
                    let at = 12 + 12 * k + 4 * j;
                    number(&facet[at..at + 4])
                })
            };
            (0..3).map(corner)
        });
        return Some(triangles.collect());
    }
    let text = std::str::from_utf8(bytes)
        .ok()
        .filter(|text| text.trim_start().starts_with("solid"))?;
    let vertices = text
        .lines()
        .filter_map(|line| line.trim().strip_prefix("vertex"));
    vertices
        .map(|line| {
            let numbers: Vec<f64> = line
                .split_whitespace()
                .filter_map(|x| x.parse().ok())
                .collect();
            <[f64; 3]>::try_from(numbers).ok()
        })
        .collect()
}
