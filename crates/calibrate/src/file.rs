use std::io::Write;
use std::path::Path;

use drape_cloth::fabric::Material;
use drape_cloth::file::{WriteError, write_atomic};
use drape_task::env::{Quantity, Scatter, Spread};

/// Writes a material file, atomically, with what has to be known and the scatter as comments: a material has no place
/// for either.
pub fn write_material(
    file: &Path,
    material: &Material,
    notes: &[String],
    scatter: &Scatter,
) -> Result<(), WriteError> {
    let table = scatter_table(scatter);
    let paste = (!scatter.spreads.is_empty()).then_some("For a run configuration:");
    let notes = notes.iter().map(String::as_str).chain(paste);
    let comments = notes.chain(table.lines()).map(|line| format!("# {line}\n"));
    let comments: String = comments.collect();
    let text = toml::to_string(material).expect("materials are tables");
    write_atomic(file, |to| write!(to, "{comments}\n{text}"))
}

/// The table `[scatter]` of a run configuration; nothing if nothing is known to vary.
pub fn scatter_table(scatter: &Scatter) -> String {
    let line = |(quantity, spread): (&Quantity, &Spread)| {
        let value = match spread {
            Spread::Deviation(deviation) => format!("{deviation:?}"),
            Spread::Range(range) => format!("{range:?}"),
        };
        format!("{} = {value}\n", quantity.name())
    };
    let lines: String = scatter.spreads.iter().map(line).collect();
    match lines.is_empty() {
        true => lines,
        false => format!("[scatter]\n{lines}"),
    }
}
