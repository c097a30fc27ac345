use serde::Serialize;

use super::Failure;
use super::output::print;
use super::terminal::note;
use drape_cloth::math::Isa;

/// What is printed.
#[derive(Serialize)]
struct Report {
    devices: Vec<Listed>,
}

#[derive(Serialize)]
struct Listed {
    /// As in `--device`.
    device: String,
    /// `processor`, or `discrete`, `integrated`, `virtual` or `software` of GPUs.
    kind: &'static str,
    name: String,
    /// Bounds how many environments there can be [MiB].
    #[serde(skip_serializing_if = "Option::is_none")]
    largest_buffer_mib: Option<u64>,
}

/// Runs `drape devices`.
pub fn run() -> Result<(), Failure> {
    let threads = rayon::current_num_threads();
    let isa = format!("{:?}", Isa::best()).to_lowercase();
    let mut devices = vec![Listed {
        device: "flex".into(),
        kind: "processor",
        name: format!("{threads} threads, {isa}"),
        largest_buffer_mib: None,
    }];
    devices.extend(gpus());
    print(&Report { devices }, text)?;
    if cfg!(not(feature = "gpu")) {
        note("this build computes on no GPU: rebuild with `--features gpu` to see them");
    }
    Ok(())
}

fn text(report: &Report) -> String {
    let line = |listed: &Listed| {
        let buffer = listed.largest_buffer_mib;
        let buffer = buffer.map_or(String::new(), |mib| format!(", buffers up to {mib} MiB"));
        format!(
            "{:8} {:12} {}{buffer}",
            listed.device, listed.kind, listed.name
        )
    };
    report
        .devices
        .iter()
        .map(line)
        .collect::<Vec<_>>()
        .join("\n")
}

#[cfg(not(feature = "gpu"))]
fn gpus() -> Vec<Listed> {
    Vec::new()
}

#[cfg(feature = "gpu")]
fn gpus() -> Vec<Listed> {
    use drape_cloth::sim::{Adapter, AdapterKind, Device};
    let listed = |(number, adapter): (usize, Adapter)| Listed {
        device: Device::Gpu(number).to_string(),
        kind: match adapter.kind() {
            AdapterKind::Discrete(_) => "discrete",
            AdapterKind::Integrated(_) => "integrated",
            AdapterKind::Virtual(_) => "virtual",
            AdapterKind::Processor => "software",
        },
        name: adapter.name(),
        largest_buffer_mib: Some(adapter.largest_buffer() >> 20),
    };
    Adapter::all().into_iter().enumerate().map(listed).collect()
}
