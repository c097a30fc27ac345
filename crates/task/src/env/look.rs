//! What the agent sees, where the cloth is on a GPU: written there and left there.

use cubecl::prelude::*;
use drape_cloth::sim::{Adapter, Buffer, Gpu, STENCIL};

use super::rules::Task;
use super::task::{ALLOWED, DRAPED, Observation, TOUCHED};

/// Stands for no vertex.
const NOTHING: u32 = u32::MAX;
/// Most vertices next to another.
const NEIGHBORS: usize = 8;
/// Most threads of a workgroup.
const MOST_UNITS: usize = 256;

/// The observations of environments on a GPU. Nothing writes to them any more.
#[derive(Clone)]
pub struct Sight {
    /// Where they are.
    pub adapter: Adapter,
    /// Which of the terrains the vertices lie on.
    pub scene: u16,
    /// `[environment, pixel]`.
    pub shape: [usize; 2],
    /// Distance to the tool [m] `[environment, pixel]`.
    pub distance: Buffer,
    /// See [`Observation::marks`], `[environment, pixel]`.
    pub marks: Buffer,
}

/// Looks at the environments of a task.
pub(super) struct Look {
    /// `[pixel]`: the number of what is seen there.
    places: Buffer,
    /// `[number]`: its vertex.
    vertices: Buffer,
    /// `[neighbor][number]`.
    neighbors: Buffer,
    seen: usize,
    pixels: usize,
    vertex_count: usize,
}

impl Look {
    pub fn new(task: &Task, gpu: &Gpu) -> Self {
        let lamina = &task.scene.lamina;
        let (seen, pixels) = (task.seen.len(), task.shape().pixel_count());
        let mut places = vec![NOTHING; pixels];
        for (k, &pixel) in task.pixels.iter().enumerate() {
            places[pixel] = k as u32;
        }
        let mut neighbors = vec![NOTHING; NEIGHBORS * seen];
        for (k, &vertex) in task.seen.iter().enumerate() {
            for (i, other) in lamina.neighbors(vertex).enumerate() {
                neighbors[i * seen + k] = other;
            }
        }
        let upload = |numbers: &[u32]| gpu.upload(u32::as_bytes(numbers));
        Self {
            places: upload(&places),
            vertices: upload(&task.seen),
            neighbors: upload(&neighbors),
            seen,
            pixels,
            vertex_count: lamina.vertex_count(),
        }
    }

    /// What is to be seen now, and of each environment how many vertices of the region are untouched.
    pub fn at(&self, gpu: &Gpu, count: usize, scene: u16) -> (Sight, Buffer) {
        let sight = Sight {
            adapter: gpu.adapter().clone(),
            scene,
            shape: [count, self.pixels],
            distance: gpu.room(count * self.pixels),
            marks: gpu.room(count * self.pixels),
        };
        let untouched = gpu.room(count);
        // SAFETY: the buffers are as large as the sizes that are compiled in say.
        unsafe {
            look::launch_unchecked(
                gpu.client(),
                CubeCount::Static(count as u32, 1, 1),
                CubeDim::new_1d(gpu.units()),
                gpu.marks().arg(),
                gpu.distances_of(&self.vertices).arg(),
                self.places.arg(),
                self.vertices.arg(),
                self.neighbors.arg(),
                sight.distance.arg(),
                sight.marks.arg(),
                untouched.arg(),
                self.vertex_count,
                self.seen,
                self.pixels,
            );
        }
        (sight, untouched)
    }
}

impl Sight {
    /// The same on the host.
    pub(super) fn read(&self, gpu: &Gpu) -> Vec<Observation> {
        let all = gpu.read(&[&self.distance, &self.marks]);
        let distance = f32::from_bytes(&all[0]).chunks(self.shape[1]);
        let marks = u32::from_bytes(&all[1]).chunks(self.shape[1]);
        let of = |(distance, marks): (&[f32], &[u32])| {
            Observation::of_marks(self.scene, distance.to_vec(), marks)
        };
        distance.zip(marks).map(of).collect()
    }
}

/// The rules of [`Task::observe`] and [`Task::mask`], a workgroup an environment.
#[cube(launch_unchecked)]
#[expect(
    clippy::too_many_arguments,
    reason = "a kernel is given all that it reads"
)]
fn look(
    marks: &[u32],
    distances: &[f32],
    places: &[u32],
    vertices: &[u32],
    neighbors: &[u32],
    shown_distance: &mut [f32],
    shown_marks: &mut [u32],
    untouched: &mut [u32],
    #[comptime] vertex_count: usize,
    #[comptime] seen: usize,
    #[comptime] pixels: usize,
) {
    let environment = CUBE_POS_X as usize;
    let unit = UNIT_POS_X as usize;
    let units = CUBE_DIM_X as usize;
    let vertex_marks = environment * vertex_count;
    // Of this thread's pixels: untouched ones, and those of them beside the stencil.
    let mut left = 0u32;
    let mut beside = 0u32;
    for pixel in range_stepped(unit, pixels, units) {
        let place = places[pixel];
        let mut shown = 0u32;
        let mut distance = 0.0f32;
        if place != NOTHING {
            let k = place as usize;
            shown = marks[vertex_marks + vertices[k] as usize] & comptime!(TOUCHED | DRAPED);
            distance = distances[environment * seen + k].max(0.0f32);
            if shown & TOUCHED == 0 {
                left += 1;
                let mut is_beside = false;
                #[unroll]
                for i in 0..NEIGHBORS {
                    let other = neighbors[i * seen + k];
                    if other != NOTHING {
                        let mark = marks[vertex_marks + other as usize];
                        is_beside = is_beside || mark & STENCIL != 0;
                    }
                }
                if is_beside {
                    beside += 1;
                    shown |= ALLOWED;
                }
            }
        }
        shown_distance[environment * pixels + pixel] = distance;
        shown_marks[environment * pixels + pixel] = shown;
    }
    let mut counts = Shared::<[u32]>::new_slice(comptime!(2 * MOST_UNITS));
    counts[unit] = left;
    counts[MOST_UNITS + unit] = beside;
    sync_cube();
    let mut all_left = 0u32;
    let mut all_beside = 0u32;
    for other in 0..units {
        all_left += counts[other];
        all_beside += counts[MOST_UNITS + other];
    }
    if unit == 0 {
        untouched[environment] = all_left;
    }
    if all_beside == 0 {
        // The stroke is at its end.
        for pixel in range_stepped(unit, pixels, units) {
            let at = environment * pixels + pixel;
            if places[pixel] != NOTHING && shown_marks[at] & TOUCHED == 0 {
                shown_marks[at] |= ALLOWED;
            }
        }
    }
}
