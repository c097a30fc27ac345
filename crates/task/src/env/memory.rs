//! How many environments memory holds.

use drape_cloth::file::ValueError;

/// What an environment keeps of a vertex: its state, the last observation, the end of the last
/// episode, and all of that again where a checkpoint is written [bytes].
const VERTEX_BYTES: f64 = 300.0;
/// Most memory of environments, and as much again for rollouts [MiB].
pub const MOST_MIB: f64 = 16_384.0;

/// How many environments [`MOST_MIB`] hold, each with a blank of `vertex_count`; one at least.
pub fn most_environments(vertex_count: usize) -> usize {
    let most = MOST_MIB * f64::from(1 << 20) / VERTEX_BYTES / vertex_count as f64;
    (most as usize).max(1)
}

/// Refuses more environments than [`MOST_MIB`] hold, each with a blank of `vertex_count`.
pub fn check_memory(count: usize, vertex_count: usize) -> Result<(), ValueError> {
    let mib = count as f64 * vertex_count as f64 * VERTEX_BYTES / f64::from(1 << 20);
    let found = format!("{count} of {vertex_count} vertices, {mib:.0} MiB");
    let expected = format!("at most {MOST_MIB} MiB");
    ValueError::unless(mib <= MOST_MIB, "environments", found, expected)
}
