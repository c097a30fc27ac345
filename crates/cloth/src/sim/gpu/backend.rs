use std::sync::OnceLock;

use cubecl::client::Client;
use cubecl::prelude::*;
use cubecl::server::Handle;
use fixedbitset::FixedBitSet;

use super::adapter::Adapter;
use super::cloth::{ClothBuffersLaunch, GpuFrameLaunch, SheetBuffersLaunch};
use super::plan::{MOST_UNITS, NOTHING, Plan, Tables};
use super::press::{drape, lay_stencil};
use super::substep::{advance, per_launch};
use super::traffic::Traffic;
use super::transfer::{carry, count_diverged, measure, packed};
use crate::sim::backend::{Backend, World};
use crate::sim::device_error::DeviceError;
use crate::sim::frame::Frame;
use crate::sim::press::Press;
use crate::sim::state::{DRAPED, Pressed, STENCIL, Snapshot, TOUCHED};
use crate::sim::stepping::Control;

/// Fewest threads of a workgroup, of which there is a multiple.
const FEWEST_UNITS: usize = 32;

/// Environments of a world on a GPU. An environment's bits are the same in any company.
pub struct Gpu {
    world: World,
    adapter: Adapter,
    pub(super) client: Client,
    pub(super) plan: Plan,
    /// Threads of a workgroup.
    pub(super) units: u32,
    count: usize,
    sheet: [Buffer; 3],
    cloth: [Buffer; 10],
    /// [environment][vertex], see [`TOUCHED`].
    marks: Buffer,
    /// The state after a reset.
    start: Buffer,
    /// The slot of each force density of a snapshot.
    slots: Vec<usize>,
    /// As read since the last change.
    pressed: OnceLock<Vec<Pressed>>,
}

/// Memory of the device and how many numbers of 4 bytes it holds.
#[derive(Clone)]
pub struct Buffer {
    handle: Handle,
    count: usize,
}

impl Buffer {
    /// As an argument of a kernel.
    pub fn arg(&self) -> BufferArg {
        // SAFETY: a handle is made with its count.
        unsafe { BufferArg::from_raw_parts(self.handle.clone(), self.count) }
    }

    /// The memory.
    pub fn handle(&self) -> &Handle {
        &self.handle
    }

    /// How many numbers it holds.
    #[expect(clippy::len_without_is_empty, reason = "buffers hold something")]
    pub fn len(&self) -> usize {
        self.count
    }
}

impl Gpu {
    /// `count` > 0 environments, each at its start.
    ///
    /// # Errors
    /// Names what of the world the GPU cannot compute, or that the environments are too many.
    pub fn new(world: &World, count: usize, adapter: &Adapter) -> Result<Self, DeviceError> {
        let Tables {
            plan,
            numbers,
            values,
            slots,
        } = Tables::new(world)?;
        let client = adapter.client();
        let n = plan.vertices;
        let sizes = [
            3 * n,
            3 * n,
            3 * n,
            3 * n,
            n,
            n,
            4 * n,
            plan.slots,
            plan.scratch,
            n + 1,
        ];
        let largest = 4 * count * sizes.iter().max().expect("not empty");
        let limit = adapter.largest_buffer();
        if largest as u64 > limit {
            let mib = |bytes: u64| bytes as f64 / f64::from(1 << 20);
            return Err(DeviceError::TooMany {
                environments: count,
                mib: mib(largest as u64),
                limit_mib: mib(limit),
                name: adapter.name(),
            });
        }
        let filled = |bytes: &[u8]| Buffer {
            handle: client.create_from_slice(bytes),
            count: bytes.len() / 4,
        };
        let (_, _, samples) = world.tool.only_grid().expect("checked").parts();
        let zeros = |size: usize| filled(u32::as_bytes(&vec![0; count * size]));
        let lines = plan.lines.iter().flatten().map(|line| line.lines).max();
        let units = lines
            .unwrap_or(n / 8)
            .next_multiple_of(FEWEST_UNITS)
            .clamp(FEWEST_UNITS, MOST_UNITS);
        let mut gpu = Self {
            world: world.clone(),
            adapter: adapter.clone(),
            units: units as u32,
            count,
            sheet: [
                filled(u32::as_bytes(&numbers)),
                filled(f32::as_bytes(&values)),
                filled(f32::as_bytes(samples)),
            ],
            cloth: sizes.map(zeros),
            marks: zeros(n),
            start: filled(&[0; 4]),
            slots,
            pressed: OnceLock::new(),
            client: client.clone(),
            plan,
        };
        gpu.start = gpu.pack(&world.start);
        for environment in 0..count {
            gpu.reset(environment);
        }
        Ok(gpu)
    }

    /// What a substep of a control step moves and computes.
    pub fn traffic(&self, control: &Control) -> Traffic {
        Traffic::new(&self.plan, control)
    }

    /// How many launches a control step takes.
    pub fn launches(&self, control: &Control) -> usize {
        control.substeps.div_ceil(self.at_once(control))
    }

    /// Substeps of a launch.
    fn at_once(&self, control: &Control) -> usize {
        per_launch(&self.plan, control.sweeps, self.units as usize)
    }

    pub(super) fn cloth(&self) -> ClothBuffersLaunch {
        let [a, b, c, d, e, f, g, h, i, j] = self.cloth.each_ref().map(Buffer::arg);
        ClothBuffersLaunch::new(a, b, c, d, e, f, g, h, i, j)
    }

    pub(super) fn sheet(&self) -> SheetBuffersLaunch {
        let [numbers, values, samples] = self.sheet.each_ref().map(Buffer::arg);
        SheetBuffersLaunch::new(numbers, values, samples)
    }

    /// Where it computes.
    pub fn adapter(&self) -> &Adapter {
        &self.adapter
    }

    /// What kernels are launched with.
    pub fn client(&self) -> &Client {
        &self.client
    }

    /// Threads of a workgroup, at most 256.
    pub fn units(&self) -> u32 {
        self.units
    }

    /// What presses have done, [environment][vertex]: [`TOUCHED`] and its like.
    pub fn marks(&self) -> &Buffer {
        &self.marks
    }

    /// Numbers of 4 bytes as a buffer, at least one.
    pub fn upload(&self, bytes: &[u8]) -> Buffer {
        Buffer {
            handle: self.client.create_from_slice(bytes),
            count: bytes.len() / 4,
        }
    }

    /// A buffer of `count` > 0 numbers whatever.
    pub fn room(&self, count: usize) -> Buffer {
        Buffer {
            handle: self.client.empty(4 * count),
            count,
        }
    }

    /// The bytes of some buffers, in one wait for the device.
    ///
    /// # Panics
    /// If the device is lost or out of memory, as all that uses it does then.
    pub fn read(&self, buffers: &[&Buffer]) -> Vec<Vec<u8>> {
        let handles = buffers.iter().map(|buffer| buffer.handle.clone());
        match self.client.read(handles.collect()) {
            Ok(all) => all.iter().map(|bytes| bytes.to_vec()).collect(),
            Err(error) => panic!("wgpu error on {}: {error}", self.adapter.name()),
        }
    }

    fn read_values(&self, buffer: &Buffer) -> Vec<f32> {
        f32::from_bytes(&self.read(&[buffer])[0]).to_vec()
    }

    fn read_numbers(&self, buffer: &Buffer) -> Vec<u32> {
        u32::from_bytes(&self.read(&[buffer])[0]).to_vec()
    }

    /// How many coordinates of each environment are no numbers or beyond 100 m.
    pub fn diverged(&self) -> Buffer {
        let diverged = self.room(self.count);
        launch!(self, self.count, count_diverged(diverged.arg()));
        diverged
    }

    /// Distance to the tool [m] of some vertices, [environment][vertex].
    pub fn distances_of(&self, vertices: &Buffer) -> Buffer {
        let distances = self.room(self.count * vertices.len());
        launch!(
            self,
            self.count,
            measure(
                self.sheet(),
                vertices.arg(),
                distances.arg(),
                vertices.len() as u32
            )
        );
        distances
    }

    /// A state as it travels.
    fn pack(&self, snapshot: &Snapshot) -> Buffer {
        let n = self.plan.vertices;
        let mut state = vec![0.0; packed(&self.plan)];
        for v in 0..n {
            for k in 0..3 {
                state[k * n + v] = snapshot.position[v][k] as f32;
                state[(3 + k) * n + v] = snapshot.velocity[v][k] as f32;
            }
            let free = self.world.model.inverse_mass[v] as f32;
            state[6 * n + v] = if snapshot.fixed.contains(v) {
                0.0
            } else {
                free
            };
            let pressed = &snapshot.pressed;
            let bit = |is_set: bool, bit: u32| if is_set { bit } else { 0 };
            let mark = bit(pressed.touched.contains(v), TOUCHED)
                | bit(pressed.draped.contains(v), DRAPED)
                | bit(pressed.stencil.binary_search(&(v as u32)).is_ok(), STENCIL);
            state[7 * n + v] = mark as f32;
        }
        for (density, &slot) in snapshot.force_density.iter().zip(&self.slots) {
            state[8 * n + slot] = *density as f32;
        }
        self.upload(f32::as_bytes(&state))
    }

    fn carry(&self, environment: usize, state: &Buffer, back: bool) {
        launch!(
            self,
            1,
            carry(self.marks.arg(), state.arg(), environment as u32, back)
        );
    }

    /// Moves all environments by a control step, under rollers if `pressed`.
    fn advance(&mut self, control: &Control, pressed: bool) {
        let model = &self.world.model;
        let frame = Frame::new(model.physics(), model.friction, control);
        let [stick, slide] = frame.friction.unwrap_or_default();
        let at_once = self.at_once(control);
        for first in (0..control.substeps).step_by(at_once) {
            launch!(
                self,
                self.count,
                advance(
                    self.sheet(),
                    GpuFrameLaunch::new(
                        frame.h as f32,
                        frame.fall as f32,
                        frame.rate as f32,
                        frame.speed_cap as f32,
                        stick as f32,
                        slide as f32,
                    ),
                    first as u32,
                    (first + at_once).min(control.substeps) as u32,
                    control.substeps as u32,
                    control.contact_interval as u32,
                    control.sweeps as u32,
                    pressed
                )
            );
        }
    }

    fn pressed_of(&self, marks: &[u32]) -> Pressed {
        let all = |bit: u32| {
            let set = marks
                .iter()
                .enumerate()
                .filter(move |(_, mark)| *mark & bit != 0);
            set.map(|(v, _)| v)
        };
        let bits = |bit: u32| {
            let mut bits = FixedBitSet::with_capacity(marks.len());
            bits.extend(all(bit));
            bits
        };
        Pressed {
            touched: bits(TOUCHED),
            draped: bits(DRAPED),
            stencil: all(STENCIL).map(|v| v as u32).collect(),
        }
    }
}

impl Backend for Gpu {
    fn count(&self) -> usize {
        self.count
    }

    fn load(&mut self, environment: usize, snapshot: &Snapshot) {
        self.carry(environment, &self.pack(snapshot), false);
        self.pressed = OnceLock::new();
    }

    fn reset(&mut self, environment: usize) {
        self.carry(environment, &self.start, false);
        self.pressed = OnceLock::new();
    }

    fn snapshot(&self, environment: usize) -> Snapshot {
        let n = self.plan.vertices;
        let packed = self.room(packed(&self.plan));
        self.carry(environment, &packed, true);
        let state = self.read_values(&packed);
        let vectors = |first: usize| {
            let of = |v: usize| [0, 1, 2].map(|k| f64::from(state[(first + k) * n + v]));
            (0..n).map(of).collect()
        };
        let mut fixed = FixedBitSet::with_capacity(n);
        fixed.extend((0..n).filter(|v| state[6 * n + v] == 0.0));
        let marks: Vec<u32> = state[7 * n..8 * n]
            .iter()
            .map(|&mark| mark as u32)
            .collect();
        let density = self.slots.iter().map(|slot| f64::from(state[8 * n + slot]));
        Snapshot {
            position: vectors(0),
            velocity: vectors(3),
            fixed,
            force_density: density.collect(),
            sides: Vec::new(),
            pressed: self.pressed_of(&marks),
        }
    }

    fn step(&mut self, control: &Control, presses: &[Press]) {
        if !presses.is_empty() {
            let n = self.plan.vertices;
            let mut forces = vec![0.0_f32; self.count * (n + 1)];
            for press in presses {
                let own = &mut forces[press.environment * (n + 1)..][..n + 1];
                own[n] = press.speed as f32;
                for &(v, force) in &press.forces {
                    own[v as usize] = force as f32;
                }
            }
            self.cloth[9] = self.upload(f32::as_bytes(&forces));
        }
        self.advance(control, !presses.is_empty());
    }

    fn press(&mut self, vertices: &[Option<u32>]) {
        assert_eq!(vertices.len(), self.count, "one entry an environment");
        let (_, stencil) = self.world.presses.clone().expect("a world with presses");
        let pressed: Vec<u32> = vertices.iter().map(|v| v.unwrap_or(NOTHING)).collect();
        let pressed = self.upload(u32::as_bytes(&pressed));
        launch!(
            self,
            self.count,
            lay_stencil(self.sheet(), self.marks.arg(), pressed.arg())
        );
        self.advance(&stencil.press, true);
        launch!(
            self,
            self.count,
            drape(self.sheet(), self.marks.arg(), pressed.arg())
        );
        if let Some(settle) = &stencil.settle {
            self.advance(settle, false);
        }
        self.pressed = OnceLock::new();
    }

    fn finite(&self) -> Vec<bool> {
        let diverged = self.read_numbers(&self.diverged());
        diverged.iter().map(|&count| count == 0).collect()
    }

    fn distances(&self, vertices: &[u32]) -> Vec<f64> {
        if vertices.is_empty() {
            return Vec::new();
        }
        let distances = self.distances_of(&self.upload(u32::as_bytes(vertices)));
        let distances = self.read_values(&distances).into_iter();
        distances.map(f64::from).collect()
    }

    fn on_gpu(&self) -> Option<&Gpu> {
        Some(self)
    }

    fn pressed(&self) -> &[Pressed] {
        self.pressed.get_or_init(|| {
            let marks = self.read_numbers(&self.marks);
            let of = |marks| self.pressed_of(marks);
            marks.chunks(self.plan.vertices).map(of).collect()
        })
    }
}
