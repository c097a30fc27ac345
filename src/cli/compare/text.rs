use std::fmt::Write as _;

use super::Report;
use drape_cloth::mesh::compare::{ContourDeviation, Spread};
use drape_study::compare::{Measures, Parts};

/// The report for a reader; what is not applicable is left out and listed at the end.
pub(super) fn text(report: &Report) -> String {
    let comparison = &report.comparison;
    let mut text = format!(
        "A  {}\nB  {} (reference)\n",
        report.a_source.path.display(),
        report.b_source.path.display()
    );
    if let Some(source) = &report.tool_source {
        let _ = writeln!(text, "tool of {}", source.display());
    }
    parts(&mut text, &comparison.all, report.fibre_deg);
    let mut contour = |name: &str, found: &Option<ContourDeviation>| {
        if let Some(found) = found {
            let _ = writeln!(
                text,
                "{name:22} mean {:.3}, max {:.3} mm",
                found.mean, found.max
            );
        }
    };
    contour("contour A to B", &comparison.contour_a_to_b_mm);
    contour("contour B to A", &comparison.contour_b_to_a_mm);
    for (name, found) in [
        ("inside the region", &comparison.inside),
        ("outside the region", &comparison.outside),
    ] {
        if let Some(found) = found {
            let _ = writeln!(text, "{name}");
            parts(&mut text, found, report.fibre_deg);
        }
    }
    for (name, found) in [("A alone", &comparison.a), ("B alone", &comparison.b)] {
        let _ = writeln!(text, "{name}");
        measures(&mut text, found, report);
    }
    for missing in &comparison.not_applicable {
        let metrics = missing.metrics.join(", ");
        let _ = writeln!(text, "not applicable: {metrics} ({})", missing.why);
    }
    if let Some(picture) = &report.picture {
        let _ = writeln!(text, "picture in {}", picture.display());
    }
    text.trim_end().into()
}

fn parts(text: &mut String, parts: &Parts, fibre_deg: f64) {
    let mut spread = |name: &str, found: &Option<Spread>| {
        if let Some(found) = found {
            let Spread {
                mean,
                rms,
                p95,
                min,
                max,
            } = found;
            let _ = writeln!(
                text,
                "{name:22} mean {mean:.3}, rms {rms:.3}, p95 {p95:.3}, min {min:.3}, max {max:.3} mm"
            );
        }
    };
    spread("topology A to B", &parts.topology_a_to_b_mm);
    spread("topology B to A", &parts.topology_b_to_a_mm);
    spread("material points", &parts.material_points_mm);
    if let Some(found) = parts.hausdorff_mm {
        let _ = writeln!(text, "{:22} {found:.3} mm", "Hausdorff");
    }
    if let Some([warp, weft]) = &parts.fibre_angle_deg {
        let name = format!("fibres < {fibre_deg} deg");
        let _ = writeln!(
            text,
            "{name:22} warp {:.1} %, weft {:.1} % (p95 {:.2} and {:.2} deg)",
            100.0 * warp.share_below,
            100.0 * weft.share_below,
            warp.p95,
            weft.p95
        );
    }
}

fn measures(text: &mut String, found: &Measures, report: &Report) {
    let mut line = |name: &str, values: String| {
        let _ = writeln!(text, "  {name:20} {values}");
    };
    if let Some(w) = &found.wrinkles_mm {
        let values = format!(
            "{}, amplitude {:.3} mm, rms {:.3} mm",
            w.count, w.amplitude, w.rms
        );
        line("wrinkles", values);
    }
    if let Some(shear) = &found.shear_deg {
        let values = format!(
            "rms {:.2}, {:.2} to {:.2} deg; beyond {} deg {:.0} mm2",
            shear.rms, shear.min, shear.max, report.locking_deg, shear.locked_area_mm2
        );
        line("shear", values);
    }
    if let Some(strain) = &found.strain {
        let values = format!(
            "p95 {:.3} %, max {:.2} %; tension p95 {:.3} %, max {:.2} %",
            100.0 * strain.p95,
            100.0 * strain.max,
            100.0 * strain.tension_p95,
            100.0 * strain.tension_max
        );
        line("yarn strain", values);
    }
    if let Some(tool) = &found.tool {
        let values = format!(
            "gap > {} mm over {:.0} mm2 ({:.1} %); penetration {:.3} mm",
            report.gap_mm,
            tool.bridged_area_mm2,
            100.0 * tool.bridged_share,
            tool.penetration_mm
        );
        line("tool", values);
    }
}
