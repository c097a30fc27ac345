use std::fmt::Write as _;

use super::{Precision, Swept};
use drape_cloth::sim::Solver;

/// One row a cell, with the names and values of its axes. Numbers that do not exist are empty.
pub fn csv(swept: &[Swept]) -> String {
    let mut text = String::from(
        "sweep,x,x_value,y,y_value,solver,precision,outcome,error,strain_p95,strain_max,\
         speed_max_m_s,speed_end_m_s,penetration_mm,simulated_s,substeps,seconds,note\n",
    );
    for Swept { sweep, cells } in swept {
        for cell in cells {
            let [x, y] = [0, 1].map(|k| (&sweep.axes[k], &sweep.axes[k].ticks[cell.at[k]]));
            let _ = write!(
                text,
                "{},{},{},{},{},{},{},{}",
                sweep.name,
                quoted(x.0.name),
                quoted(&x.1.label),
                quoted(y.0.name),
                quoted(&y.1.label),
                solver_name(cell.solver),
                precision_name(cell.precision),
                cell.outcome.name(),
            );
            let f = &cell.figures;
            for number in [
                f.error,
                f.strain_p95,
                f.strain_max,
                f.speed_max,
                f.speed_end,
                f.penetration_mm,
                f.simulated_s,
            ] {
                text.push(',');
                if number.is_finite() {
                    let _ = write!(text, "{number:.6e}");
                }
            }
            let _ = writeln!(
                text,
                ",{},{:.4},{}",
                f.substeps,
                cell.seconds,
                quoted(&cell.note)
            );
        }
    }
    text
}

/// As in configurations.
pub(super) fn solver_name(solver: Solver) -> &'static str {
    match solver {
        Solver::Yarn => "yarn",
        Solver::GaussSeidel => "gauss_seidel",
    }
}

pub(super) fn precision_name(precision: Precision) -> &'static str {
    match precision {
        Precision::F64 => "f64",
        Precision::F32 => "f32",
    }
}

/// A field as CSV wants it (RFC 4180).
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn fields_are_quoted_where_they_must() {
        assert_eq!(quoted("a b"), "a b");
        assert_eq!(quoted("a, \"b\""), "\"a, \"\"b\"\"\"");
    }
}
