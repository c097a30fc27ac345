//! What an arm may hit: itself, the tool, the table, the clamping frame.

use std::fmt;

use nalgebra::{UnitQuaternion, Vector3};
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math;
use parry3d_f64::query::{ClosestPoints, PointQuery, closest_points};
use parry3d_f64::shape::{Capsule, Cuboid, Cylinder, Shape, SharedShape, TriMesh};

use super::arm::{Arm, Joints};
use super::cell::CellConfig;
use super::place::Pose;
use super::place::metres;

/// A surface that stands in the cell, in the scene's frame: corners [m] and triangles.
#[derive(Clone, Debug)]
pub struct ObstacleSurface {
    pub corners: Vec<Vector3<f64>>,
    pub triangles: Vec<[u32; 3]>,
}

/// Two parts that come too near to each other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Pair(pub String, pub String);

impl fmt::Display for Pair {
    fn fmt(&self, to: &mut fmt::Formatter) -> fmt::Result {
        write!(to, "{} and {}", self.0, self.1)
    }
}

/// Whether the roller may touch the tool.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Touch {
    Free,
    Pressing,
}

/// How near an arm comes to what it might hit.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Clearance {
    /// [m]; no more than was asked for, 0 where two parts overlap.
    pub distance: f64,
    /// Which parts are that near.
    pub pair: Option<Pair>,
}

/// The shapes of a cell.
#[derive(Clone)]
pub(crate) struct Obstacles {
    /// Of the arm: links from the base on, then what is at the flange, the roller last.
    moving: Vec<Part>,
    standing: Vec<Standing>,
    /// Pairs of moving parts that can meet.
    own: Vec<[usize; 2]>,
}

#[derive(Clone)]
struct Part {
    name: String,
    shape: SharedShape,
    /// The link that carries it; 7 is the flange.
    frame: usize,
    /// In the frame of that link.
    at: Pose,
    /// A ball around it in the frame of the link.
    centre: Vector3<f64>,
    radius: f64,
}

#[derive(Clone)]
struct Standing {
    name: String,
    shape: SharedShape,
    /// In the scene.
    at: Pose,
    turns: bool,
    /// In its own frame.
    around: Aabb,
}

/// The tool's name in reports.
pub(crate) const TOOL: &str = "tool";

impl Obstacles {
    /// What the arm of a cell may hit; `tool` is in the scene at the table's angle 0.
    pub fn new(arm: &Arm, config: &CellConfig, tool: &ObstacleSurface) -> Self {
        let mut moving = Vec::new();
        for (k, hull) in arm.hulls.iter().enumerate() {
            let corners: Vec<_> = hull.iter().map(vector).collect();
            if let Some(shape) = SharedShape::convex_hull(&corners) {
                let name = match k {
                    0 => "base".into(),
                    _ => format!("link {k}"),
                };
                moving.push(Part::new(name, shape, k, Pose::identity()));
            }
        }
        for capsule in &config.roller.body {
            let ends = [capsule.from_mm, capsule.to_mm].map(|end| vector(&metres(end)));
            let shape = SharedShape::new(Capsule::new(ends[0], ends[1], 1e-3 * capsule.radius_mm));
            moving.push(Part::new(
                "roller's holder".into(),
                shape,
                FLANGE,
                Pose::identity(),
            ));
        }
        let roller = config.roller.roller();
        let cylinder = Cylinder::new(0.5 * roller.width, roller.radius);
        moving.push(Part::new(
            "roller".into(),
            SharedShape::new(cylinder),
            FLANGE,
            roller.middle,
        ));
        let corners = tool.corners.iter().map(vector).collect();
        let mesh = TriMesh::new(corners, tool.triangles.clone()).expect("a tool has triangles");
        let mut standing = vec![Standing::new(
            TOOL,
            SharedShape::new(mesh),
            Pose::identity(),
        )];
        for block in &config.obstacles {
            let half = 0.5 * metres(block.size_mm);
            let shape = SharedShape::new(Cuboid::new(vector(&half)));
            standing.push(Standing {
                turns: block.turns,
                ..Standing::new(&block.name, shape, block.pose())
            });
        }
        // Neighbours overlap at their joint.
        let link = |part: &Part| part.frame.min(6);
        let count = moving.len();
        let pairs = (0..count).flat_map(|a| (a + 1..count).map(move |b| [a, b]));
        let own = pairs.filter(|&[a, b]| link(&moving[b]) > link(&moving[a]) + 1);
        let own = own.collect();
        let mut obstacles = Self {
            moving,
            standing,
            own,
        };
        obstacles.drop_what_always_overlaps(arm);
        obstacles
    }

    /// Hulls are larger than links: those that overlap however the arm stands do not hit each other.
    fn drop_what_always_overlaps(&mut self, arm: &Arm) {
        let poses: Vec<[Pose; 8]> = (0..32)
            .map(|k| {
                let q = Arm::spread(k, &arm.joints.each_ref().map(|joint| joint.limits));
                frames(arm, &q, &Pose::identity())
            })
            .collect();
        let moving = &self.moving;
        self.own.retain(|&[a, b]| {
            let overlap = |frames: &[Pose; 8]| distance(&moving[a], &moving[b], frames, 0.0) == 0.0;
            !poses.iter().all(overlap)
        });
    }

    /// How near the arm, whose base stands at `base` in the scene, comes to itself and to what stands around it, no
    /// farther than `most` [m]. `turn` is what the turntable does to the scene.
    pub fn clearance(
        &self,
        arm: &Arm,
        base: &Pose,
        joints: &Joints,
        turn: &Pose,
        touch: Touch,
        most: f64,
    ) -> Clearance {
        let frames = frames(arm, joints, base);
        let mut found = Clearance {
            distance: most,
            pair: None,
        };
        for &[a, b] in &self.own {
            let (a, b) = (&self.moving[a], &self.moving[b]);
            let distance = distance(a, b, &frames, found.distance);
            if distance < found.distance {
                found = Clearance {
                    distance,
                    pair: Some(Pair(a.name.clone(), b.name.clone())),
                };
            }
        }
        // The base stands on something.
        let parts = self
            .moving
            .iter()
            .enumerate()
            .filter(|(_, part)| part.frame > 0);
        for (k, part) in parts {
            self.nearest(k, &frames[part.frame], turn, touch, |_| true, &mut found);
            if found.distance == 0.0 {
                break;
            }
        }
        found
    }

    /// How near what is at the flange comes to what turns with the tool, whatever arm holds it there: `flange` in the scene.
    pub(crate) fn clearance_of_holder(&self, flange: &Pose, turn: &Pose, most: f64) -> Clearance {
        let mut found = Clearance {
            distance: most,
            pair: None,
        };
        let parts = self
            .moving
            .iter()
            .enumerate()
            .filter(|(_, part)| part.frame == FLANGE);
        for (k, _) in parts {
            self.nearest(
                k,
                flange,
                turn,
                Touch::Pressing,
                |standing| standing.turns,
                &mut found,
            );
        }
        found
    }

    /// Brings `found` down to the distance of a moving part, whose link is at `frame`, to those that stand around.
    fn nearest(
        &self,
        part: usize,
        frame: &Pose,
        turn: &Pose,
        touch: Touch,
        which: impl Fn(&Standing) -> bool,
        found: &mut Clearance,
    ) {
        let is_roller = part + 1 == self.moving.len();
        let part = &self.moving[part];
        for standing in self.standing.iter().filter(|standing| which(standing)) {
            if touch == Touch::Pressing && is_roller && standing.name == TOOL {
                continue;
            }
            let at = match standing.turns {
                true => turn * standing.at,
                false => standing.at,
            };
            let centre = at.inverse() * frame * nalgebra::Point3::from(part.centre);
            let apart = standing
                .around
                .distance_to_local_point(vector(&centre.coords), true);
            if apart - part.radius >= found.distance {
                continue;
            }
            let from = isometry(&(frame * part.at));
            let between = closest_points(
                &from,
                &*part.shape,
                &isometry(&at),
                &*standing.shape,
                found.distance,
            );
            if let Some(distance) = within(between)
                && distance < found.distance
            {
                *found = Clearance {
                    distance,
                    pair: Some(Pair(part.name.clone(), standing.name.clone())),
                };
            }
        }
    }

    /// How deep a part of the arm but the roller, whose links are at `frames`, has one of these places in it [m], and which;
    /// none if no part has.
    pub fn deepest(&self, frames: &[Pose; 8], places: &[Vector3<f64>]) -> Option<(f64, &str)> {
        let (_, others) = self.moving.split_last()?;
        let mut found: Option<(f64, &str)> = None;
        for part in others {
            let centre = frames[part.frame] * nalgebra::Point3::from(part.centre);
            let into = (frames[part.frame] * part.at).inverse();
            for place in places {
                if (place - centre.coords).norm() > part.radius {
                    continue;
                }
                let local = vector(&(into * nalgebra::Point3::from(*place)).coords);
                let depth = -part.shape.distance_to_local_point(local, false);
                if depth > found.map_or(0.0, |(depth, _)| depth) {
                    found = Some((depth, &part.name));
                }
            }
        }
        found
    }

    /// What the base stands in, if it does.
    pub fn base_in(&self, base: &Pose) -> Option<&str> {
        let own = self.moving.first().filter(|part| part.frame == 0)?;
        let hit = |standing: &&Standing| {
            let shapes = (&*own.shape, &*standing.shape);
            let poses = (isometry(&(base * own.at)), isometry(&standing.at));
            let inside = || {
                let middle = standing.at.inverse() * base * nalgebra::Point3::from(own.centre);
                is_inside(&*standing.shape, vector(&middle.coords))
            };
            // A base may stand upon something, a millimetre deep.
            let depth = parry3d_f64::query::contact(&poses.0, shapes.0, &poses.1, shapes.1, 0.0);
            depth
                .ok()
                .flatten()
                .is_some_and(|contact| contact.dist < -1e-3)
                || inside()
        };
        self.standing
            .iter()
            .find(hit)
            .map(|standing| &*standing.name)
    }

    /// Triangles of what moves with each frame of the arm, in that frame [m]: the base, its links, the flange.
    pub fn shapes(&self) -> [Vec<[Vector3<f64>; 3]>; 8] {
        let mut shapes: [Vec<_>; 8] = Default::default();
        for part in &self.moving {
            shapes[part.frame].extend(triangles(&*part.shape, &part.at));
        }
        shapes
    }

    /// Triangles of what stands around but the tool: what stays where it is, and what turns with the table, at its angle 0.
    pub fn blocks(&self) -> [Vec<[Vector3<f64>; 3]>; 2] {
        let mut blocks = [Vec::new(), Vec::new()];
        for standing in self.standing.iter().filter(|one| one.name != TOOL) {
            let triangles = triangles(&*standing.shape, &standing.at);
            blocks[usize::from(standing.turns)].extend(triangles);
        }
        blocks
    }
}

/// Number of the flange among the frames of [`frames`].
const FLANGE: usize = 7;

/// Frames of all links and of the flange in the scene.
pub(crate) fn frames(arm: &Arm, joints: &Joints, base: &Pose) -> [Pose; 8] {
    let links = arm.forward(joints);
    std::array::from_fn(|k| match k {
        FLANGE => base * links[6] * arm.flange,
        _ => base * links[k],
    })
}

impl Part {
    fn new(name: String, shape: SharedShape, frame: usize, at: Pose) -> Self {
        let ball = shape.compute_local_bounding_sphere();
        let middle = at * nalgebra::Point3::from(from_vector(ball.center));
        Self {
            name,
            frame,
            at,
            centre: middle.coords,
            radius: ball.radius,
            shape,
        }
    }
}

impl Standing {
    /// One that turns with the table.
    fn new(name: &str, shape: SharedShape, at: Pose) -> Self {
        let around = shape.compute_local_aabb();
        Self {
            name: name.into(),
            shape,
            at,
            turns: true,
            around,
        }
    }
}

/// Between two parts, no farther than `most`.
fn distance(a: &Part, b: &Part, frames: &[Pose; 8], most: f64) -> f64 {
    let [from, to] = [a, b].map(|part| frames[part.frame] * nalgebra::Point3::from(part.centre));
    if most > 0.0 && (to - from).norm() - a.radius - b.radius >= most {
        return most;
    }
    let [from, to] = [a, b].map(|part| isometry(&(frames[part.frame] * part.at)));
    within(closest_points(
        &from,
        &*a.shape,
        &to,
        &*b.shape,
        most.max(1e-9),
    ))
    .unwrap_or(most.max(1e-9))
}

/// None if two shapes are farther apart than was asked.
fn within(between: Result<ClosestPoints, parry3d_f64::query::Unsupported>) -> Option<f64> {
    match between.expect("parry knows all pairs of these shapes") {
        ClosestPoints::Intersecting => Some(0.0),
        ClosestPoints::WithinMargin(a, b) => Some((b - a).length()),
        ClosestPoints::Disjoint => None,
    }
}

/// Whether a point lies within a closed surface: a ray leaves it through an odd number of triangles.
fn is_inside(shape: &dyn Shape, point: math::Vector) -> bool {
    let Some(mesh) = shape.as_trimesh() else {
        return shape.contains_local_point(point);
    };
    // Along no direction that meshes have edges in.
    let ray = Vector3::new(0.577, 0.211, 0.789);
    let crossed = mesh.triangles().filter(|triangle| {
        let [a, b, c] = [triangle.a, triangle.b, triangle.c].map(|p| from_vector(p - point));
        let volume = |a: &Vector3<f64>, b: &Vector3<f64>| ray.dot(&a.cross(b));
        let signs = [volume(&a, &b), volume(&b, &c), volume(&c, &a)].map(|v| v > 0.0);
        let normal = (b - a).cross(&(c - a));
        let ahead = a.dot(&normal) * ray.dot(&normal) > 0.0;
        ahead && signs.iter().all(|&s| s == signs[0])
    });
    crossed.count() % 2 == 1
}

fn triangles(shape: &dyn Shape, at: &Pose) -> Vec<[Vector3<f64>; 3]> {
    let (corners, faces) = if let Some(hull) = shape.as_convex_polyhedron() {
        hull.to_trimesh()
    } else if let Some(cuboid) = shape.as_cuboid() {
        cuboid.to_trimesh()
    } else if let Some(capsule) = shape.as_capsule() {
        capsule.to_trimesh(12, 4)
    } else if let Some(cylinder) = shape.as_cylinder() {
        cylinder.to_trimesh(24)
    } else {
        return Vec::new();
    };
    let corner = |k: u32| (at * nalgebra::Point3::from(from_vector(corners[k as usize]))).coords;
    faces.iter().map(|face| face.map(corner)).collect()
}

fn vector(v: &Vector3<f64>) -> math::Vector {
    math::Vector::new(v.x, v.y, v.z)
}

fn from_vector(v: math::Vector) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

fn isometry(pose: &Pose) -> math::Pose {
    let [x, y, z, w] = UnitQuaternion::from(pose.rotation).coords.into();
    math::Pose::from_parts(
        vector(&pose.translation.vector),
        math::Rotation::from_xyzw(x, y, z, w),
    )
}
