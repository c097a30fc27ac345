use std::sync::OnceLock;

use cubecl::client::Client;
use cubecl::prelude::*;

use super::adapter::Adapter;
use super::buffer::Buffer;
use super::cloth::{ClothBuffersLaunch, GpuFrameLaunch, SheetBuffersLaunch};
use super::look::look;
use super::measure::{NUMBERS, weigh};
use super::own::{FIELDS, SPEED, fields};
use super::plan::{MOST_UNITS, NOTHING, Plan, Tables};
use super::press::{drape, lay_stencil};
use super::substep::{advance, per_launch};
use super::traffic::Traffic;
use super::transfer::{carry, count_diverged, packed};
use crate::math::bits;
use crate::measure::Measures;
use crate::sim::backend::{Backend, Observed, World};
use crate::sim::device_error::DeviceError;
use crate::sim::frame::Frame;
use crate::sim::observations::{Column, Observations};
use crate::sim::parameters::{Aim, Own};
use crate::sim::press::Press;
use crate::sim::scales::Scales;
use crate::sim::state::{DRAPED, Pressed, STENCIL, Snapshot, TOUCHED};
use crate::sim::stepping::Control;

/// Fewest threads of a workgroup, of which there is a multiple.
const FEWEST_UNITS: usize = 32;

/// Environments of a world on a GPU. An environment's bits are the same in any company.
pub struct Gpu {
    world: World,
    adapter: Adapter,
    client: Client,
    plan: Plan,
    /// Threads of a workgroup.
    units: u32,
    count: usize,
    sheet: [Buffer; 3],
    cloth: [Buffer; 10],
    /// What each environment has of its own, and how often it has been pressed.
    owns: Vec<Own>,
    counts: Vec<u32>,
    /// The former as kernels see it.
    own: OnceLock<Buffer>,
    /// [environment][vertex], see [`TOUCHED`].
    marks: Buffer,
    /// The states after a reset.
    starts: Vec<Buffer>,
    /// The slot of each force density of a snapshot.
    slots: Vec<usize>,
}

impl Gpu {
    /// `count` > 0 environments, each at its start.
    ///
    /// # Errors
    /// Names what of the world the GPU cannot compute, or that the environments are too many.
    pub fn new(world: &World, count: usize, adapter: &Adapter) -> Result<Self, DeviceError> {
        let tables = Tables::new(world)?;
        let plan = tables.plan;
        let n = plan.vertices;
        let (slots, scratch) = (plan.slots, plan.scratch);
        let sizes = [3 * n, 3 * n, 3 * n, 3 * n, n, n, 4 * n, slots, scratch, n];
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
        let filled = |bytes: &[u8]| Buffer::filled(adapter, bytes);
        let zeros = |size: usize| filled(u32::as_bytes(&vec![0; count * size]));
        let lines = plan.lines.iter().flatten().map(|line| line.lines).max();
        let units = lines.unwrap_or(n / 8).next_multiple_of(FEWEST_UNITS);
        let units = units.clamp(FEWEST_UNITS, MOST_UNITS);
        let mut gpu = Self {
            world: world.clone(),
            adapter: adapter.clone(),
            units: units as u32,
            count,
            sheet: [
                filled(u32::as_bytes(&tables.numbers)),
                filled(f32::as_bytes(&tables.values)),
                filled(f32::as_bytes(&tables.samples)),
            ],
            cloth: sizes.map(zeros),
            owns: vec![Own::default(); count],
            counts: vec![0; count],
            own: OnceLock::new(),
            marks: zeros(n),
            starts: Vec::new(),
            slots: tables.slots,
            client: adapter.client(),
            plan,
        };
        gpu.starts = world.starts.iter().map(|start| gpu.pack(start)).collect();
        for environment in 0..count {
            gpu.reset(environment, &Own::default());
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

    fn cloth(&self) -> ClothBuffersLaunch {
        let upload = || self.upload(f32::as_bytes(self.fields().as_flattened()));
        let own = self.own.get_or_init(upload);
        let [a, b, c, d, e, f, g, h, i, j] = self.cloth.each_ref().map(Buffer::arg);
        ClothBuffersLaunch::new(a, b, c, d, e, f, g, h, i, j, own.arg())
    }

    /// What each environment has of its own, as kernels see it.
    fn fields(&self) -> Vec<[f32; FIELDS]> {
        let stencil = self.world.presses.as_ref().map(|(_, stencil)| stencil);
        self.owns.iter().map(|own| fields(own, stencil)).collect()
    }

    fn sheet(&self) -> SheetBuffersLaunch {
        let [numbers, values, samples] = self.sheet.each_ref().map(Buffer::arg);
        SheetBuffersLaunch::new(numbers, values, samples)
    }

    fn upload(&self, bytes: &[u8]) -> Buffer {
        Buffer::filled(&self.adapter, bytes)
    }

    fn room(&self, count: usize) -> Buffer {
        Buffer::room(&self.adapter, count)
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
            let is_free = !snapshot.fixed.contains(v);
            state[6 * n + v] = if is_free { free } else { 0.0 };
            let pressed = &snapshot.pressed;
            let bit = |is_set: bool, bit: u8| if is_set { bit } else { 0 };
            let mark = bit(pressed.touched.contains(v), TOUCHED)
                | bit(pressed.draped.contains(v), DRAPED)
                | bit(pressed.stencil.binary_search(&(v as u32)).is_ok(), STENCIL);
            state[7 * n + v] = mark.into();
        }
        for (density, &slot) in snapshot.force_density.iter().zip(&self.slots) {
            state[8 * n + slot] = *density as f32;
        }
        self.upload(f32::as_bytes(&state))
    }

    fn carry(&self, environment: usize, state: &Buffer, back: bool) {
        let mass = self.owns[environment].parameters.areal_mass as f32;
        let environment = environment as u32;
        launch!(
            self,
            1,
            carry(self.marks.arg(), state.arg(), environment, mass, back)
        );
    }

    /// Puts a state into an environment that has been pressed `count` times.
    fn put(&mut self, environment: usize, state: &Buffer, own: &Own, count: u32) {
        self.owns[environment] = own.clone();
        self.counts[environment] = count;
        self.own = OnceLock::new();
        self.carry(environment, state, false);
    }

    /// Moves all environments by a control step, under rollers if `pressed`.
    fn advance(&mut self, control: &Control, pressed: bool) {
        let model = &self.world.model;
        // Environments have factors of their own on it.
        let scales = Scales::<f64>::new();
        let frame = Frame::new(model.physics(), model.friction, &scales, control);
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
}

impl Backend for Gpu {
    fn count(&self) -> usize {
        self.count
    }

    fn load(&mut self, environment: usize, snapshot: &Snapshot) {
        let state = self.pack(snapshot);
        self.put(environment, &state, &snapshot.own, snapshot.pressed.count);
    }

    fn reset(&mut self, environment: usize, own: &Own) {
        let start = self.starts[usize::from(own.start)].clone();
        self.put(environment, &start, own, 0);
    }

    fn snapshot(&self, environment: usize) -> Snapshot {
        let n = self.plan.vertices;
        let packed = self.room(packed(&self.plan));
        self.carry(environment, &packed, true);
        let state = packed.read();
        let state = f32::from_bytes(&state);
        let vectors = |first: usize| {
            let of = |v: usize| [0, 1, 2].map(|k| f64::from(state[(first + k) * n + v]));
            (0..n).map(of).collect()
        };
        let marked = |bit: u8| (0..n).filter(move |v| state[7 * n + v] as u8 & bit != 0);
        let density = self.slots.iter().map(|slot| f64::from(state[8 * n + slot]));
        Snapshot {
            position: vectors(0),
            velocity: vectors(3),
            fixed: bits::set(n, (0..n).filter(|v| state[6 * n + v] == 0.0)),
            force_density: density.collect(),
            sides: Vec::new(),
            pressed: Pressed {
                touched: bits::set(n, marked(TOUCHED)),
                draped: bits::set(n, marked(DRAPED)),
                stencil: marked(STENCIL).map(|v| v as u32).collect(),
                count: self.counts[environment],
            },
            own: self.owns[environment].clone(),
        }
    }

    fn step(&mut self, control: &Control, presses: &[Press]) {
        if !presses.is_empty() {
            let n = self.plan.vertices;
            let mut forces = vec![0.0_f32; self.count * n];
            let mut own = self.fields();
            for press in presses {
                own[press.environment][SPEED] = press.speed as f32;
                let forces = &mut forces[press.environment * n..][..n];
                for &(v, force) in &press.forces {
                    forces[v as usize] = force as f32;
                }
            }
            self.cloth[9] = self.upload(f32::as_bytes(&forces));
            self.own = OnceLock::from(self.upload(f32::as_bytes(own.as_flattened())));
        }
        self.advance(control, !presses.is_empty());
        if !presses.is_empty() {
            self.own = OnceLock::new();
        }
    }

    fn press(&mut self, vertices: &[Option<u32>]) -> Column<f64> {
        assert_eq!(vertices.len(), self.count, "one entry an environment");
        let stencil = self.world.pressed().1.clone();
        let pressed: Vec<u32> = vertices.iter().map(|v| v.unwrap_or(NOTHING)).collect();
        let pressed = self.upload(u32::as_bytes(&pressed));
        let all = self.owns.iter().zip(&self.counts);
        let aims = all.flat_map(|(own, &count)| {
            let Aim { offset, tilt } = own.parameters.aim(count);
            offset.into_iter().chain(tilt.map(f64::tan))
        });
        let aims: Vec<f32> = aims.map(|x| x as f32).collect();
        let aims = self.upload(f32::as_bytes(&aims));
        let places = self.room(3 * self.count);
        launch!(
            self,
            self.count,
            lay_stencil(
                self.sheet(),
                self.marks.arg(),
                pressed.arg(),
                aims.arg(),
                places.arg()
            )
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
        for (count, vertex) in self.counts.iter_mut().zip(vertices) {
            *count += u32::from(vertex.is_some());
        }
        Column::on_device(places)
    }

    fn finite(&self) -> Vec<bool> {
        let diverged = self.room(self.count);
        launch!(self, self.count, count_diverged(diverged.arg()));
        let diverged = diverged.read();
        let counts = u32::from_bytes(&diverged).iter();
        counts.map(|&count| count == 0).collect()
    }

    fn observe(&self) -> Observed {
        let look_plan = self.plan.look.expect("a world with views");
        let shown = [0, 1].map(|_| self.room(self.count * look_plan.pixels));
        let told = self.room(2 * self.count);
        let [distance, marks] = &shown;
        launch!(
            self,
            self.count,
            look(
                self.sheet(),
                self.marks.arg(),
                distance.arg(),
                marks.arg(),
                told.arg()
            )
        );
        let told = told.read();
        let told = u32::from_bytes(&told).as_chunks().0;
        let [distance, marks] = shown;
        Observed {
            seen: Observations {
                views: self.owns.iter().map(|own| own.view).collect(),
                distance: Column::on_device(distance),
                marks: Column::on_device(marks),
                pixel_count: look_plan.pixels,
            },
            finite: told.iter().map(|&[_, astray]| astray == 0).collect(),
            left: told.iter().map(|&[left, _]| left as usize).collect(),
        }
    }

    fn measure(&self, environments: &[usize]) -> Vec<Measures> {
        if environments.is_empty() {
            return Vec::new();
        }
        let places: Vec<u32> = environments.iter().map(|&e| e as u32).collect();
        let places = self.upload(u32::as_bytes(&places));
        let found = self.room(environments.len() * NUMBERS);
        launch!(
            self,
            environments.len(),
            weigh(self.sheet(), places.arg(), found.arg())
        );
        let found = found.read();
        let all = f32::from_bytes(&found).as_chunks().0.iter();
        let of = |numbers: &[f32; NUMBERS]| {
            let [inside, all, crushed, all_crushed, strain, depth] = numbers.map(f64::from);
            Measures {
                distance: [inside, all],
                surplus: [crushed, all_crushed],
                strain,
                depth,
            }
        };
        all.map(of).collect()
    }
}
