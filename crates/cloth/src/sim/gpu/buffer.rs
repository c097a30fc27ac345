use std::fmt;
use std::ops::Range;

use cubecl::prelude::*;
use cubecl::server::Handle;

use super::adapter::Adapter;

/// Memory of a device and how many numbers of 4 bytes it holds. Copies share it.
#[derive(Clone)]
pub struct Buffer {
    adapter: Adapter,
    handle: Handle,
    count: usize,
}

/// Threads of a workgroup that copies.
const UNITS: u32 = 64;
/// Most workgroups that copy.
const MOST_GROUPS: usize = 4096;

impl Buffer {
    /// Numbers of 4 bytes, at least one.
    pub(super) fn filled(adapter: &Adapter, bytes: &[u8]) -> Self {
        Self {
            adapter: adapter.clone(),
            handle: adapter.client().create_from_slice(bytes),
            count: bytes.len() / 4,
        }
    }

    /// Room for `count` > 0 numbers whatever.
    pub(super) fn room(adapter: &Adapter, count: usize) -> Self {
        Self {
            adapter: adapter.clone(),
            handle: adapter.client().empty(4 * count),
            count,
        }
    }

    /// As an argument of a kernel.
    pub(super) fn arg(&self) -> BufferArg {
        // SAFETY: a handle is made with its count.
        unsafe { BufferArg::from_raw_parts(self.handle.clone(), self.count) }
    }

    /// Where it is.
    pub fn adapter(&self) -> &Adapter {
        &self.adapter
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

    /// Its bytes.
    ///
    /// # Panics
    /// If the device is lost or out of memory, as all that uses it does then.
    pub fn read(&self) -> Vec<u8> {
        match self.adapter.client().read(vec![self.handle.clone()]) {
            Ok(all) => all[0].to_vec(),
            Err(error) => panic!("wgpu error on {}: {error}", self.adapter.name()),
        }
    }

    /// The numbers at some places, in this order.
    pub(crate) fn pick(&self, places: &[u32]) -> Self {
        let picked = Self::room(&self.adapter, places.len());
        let places = Self::filled(&self.adapter, u32::as_bytes(places));
        let (groups, units) = size(picked.count);
        // SAFETY: a thread writes within what is picked; places are those of numbers.
        unsafe {
            let client = self.adapter.client();
            pick::launch_unchecked(
                &client,
                groups,
                units,
                self.arg(),
                places.arg(),
                picked.arg(),
            );
        }
        picked
    }

    /// Pieces of buffers of one device, one after the other.
    pub(crate) fn gather(pieces: &[(Self, Range<usize>)]) -> Self {
        let adapter = &pieces[0].0.adapter;
        let all = Self::room(adapter, pieces.iter().map(|(_, range)| range.len()).sum());
        let mut first = 0;
        for (from, range) in pieces {
            let (groups, units) = size(range.len());
            let (at, count) = (range.start as u32, range.len() as u32);
            // SAFETY: ranges lie within their buffers, and their sum is what there is room for.
            unsafe {
                let client = adapter.client();
                copy::launch_unchecked(
                    &client,
                    groups,
                    units,
                    from.arg(),
                    all.arg(),
                    at,
                    first as u32,
                    count,
                );
            }
            first += range.len();
        }
        all
    }
}

fn size(count: usize) -> (CubeCount, CubeDim) {
    let groups = count.div_ceil(UNITS as usize).clamp(1, MOST_GROUPS);
    (
        CubeCount::Static(groups as u32, 1, 1),
        CubeDim::new_1d(UNITS),
    )
}

#[cube(launch_unchecked)]
fn pick(from: &[u32], places: &[u32], picked: &mut [u32]) {
    let first = (CUBE_POS_X * CUBE_DIM_X + UNIT_POS_X) as usize;
    for i in range_stepped(first, picked.len(), (CUBE_COUNT_X * CUBE_DIM_X) as usize) {
        picked[i] = from[places[i] as usize];
    }
}

#[cube(launch_unchecked)]
fn copy(from: &[u32], to: &mut [u32], from_first: u32, to_first: u32, count: u32) {
    let first = (CUBE_POS_X * CUBE_DIM_X + UNIT_POS_X) as usize;
    for i in range_stepped(first, count as usize, (CUBE_COUNT_X * CUBE_DIM_X) as usize) {
        to[to_first as usize + i] = from[from_first as usize + i];
    }
}

impl fmt::Debug for Buffer {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{} numbers on {:?}", self.count, self.adapter)
    }
}
