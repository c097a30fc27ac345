use super::arm::{Arm, Joints, Pose};
use super::roller::Roller;

/// What a controller is told, in order.
#[derive(Clone, Debug)]
pub struct Program<'a> {
    pub name: String,
    pub arm: &'a Arm,
    pub roller: Roller,
    pub speeds: Speeds,
    /// Where the arm begins and ends [rad].
    pub home: Joints,
    /// The angles of the turntable that are used; one where there is none.
    pub stations: Vec<Station>,
    pub strokes: Vec<ProgramStroke>,
}

/// How fast and how hard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Speeds {
    /// Of the contact along a stroke [m/s], and of the roller when it comes down and lifts.
    pub contact: f64,
    pub approach: f64,
    /// Share of the joints' greatest speeds in free ways.
    pub free: f64,
    /// With which the roller presses [N].
    pub force: f64,
    /// How long it stays on a point that is pressed without travel [s].
    pub press_s: f64,
}

/// An angle of the turntable.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Station {
    /// [rad]
    pub angle: f64,
    /// The frame in which the program's contacts are, that of the tool, in the robot's base: the work object.
    pub tool: Pose,
}

/// One stroke, or a single press, with the way to it.
#[derive(Clone, Debug)]
pub struct ProgramStroke {
    /// Index into the program's stations.
    pub station: usize,
    /// How far the arm leans about the roller's axis [rad], see [`Roller::contact`]; the same for the whole stroke.
    pub tilt: f64,
    /// Corners of the free way, straight in joints, from where the arm is to `approach`, both left out.
    pub transfer: Vec<Joints>,
    /// Off the surface, straight above the first contact.
    pub approach: Joints,
    /// One at least; between them the contact moves straight.
    pub contacts: Vec<Contact>,
    /// Off the surface, straight above the last contact.
    pub retreat: Joints,
}

/// The roller on a point of the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Index of the point in the path.
    pub point: usize,
    /// In the tool's frame: z into the surface, x along the travel forwards or backwards, y along the roller's axis, the
    /// origin in the middle of the line of contact.
    pub frame: Pose,
    pub joints: Joints,
    /// Least singular value of the Jacobian of the contact [m/rad and 1], and the distance to what might be hit [m].
    pub sigma_min: f64,
    pub clearance: f64,
}
