//! Scans of cloth that was pressed, as several commands are given them.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use serde::{Deserialize, Serialize};

use super::Failure;
use super::failure::OrInvalid;
use super::setup::warn;
use drape_cloth::file::{ValueError, read_toml};
use drape_cloth::scene::{Mark, Placement, ScanFrame, Scene, Unit};
use drape_scan::Seen;

/// Where a scan lies, as the keys of a placement say it of a blank that was laid.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct ScanArgs {
    /// Unit of the scan, whose file does not say it: mm, cm, in or m
    #[arg(long, value_name = "UNIT", value_parser = unit)]
    pub unit: Option<Unit>,

    /// What the scan counts from: scanner, which is found by marks or by the cloth and the tool, or scene
    #[arg(long, value_name = "FRAME", value_parser = frame, default_value = "scanner", requires = "unit")]
    frame: ScanFrame,

    /// TOML file of what the scanner saw of tool or blank, `[[scan_marks]]` as in a placement
    #[arg(long, value_name = "FILE.toml", requires = "unit")]
    marks: Option<PathBuf>,
}

/// A file of marks.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Marks {
    scan_marks: Vec<Mark>,
}

fn unit(name: &str) -> Result<Unit, String> {
    let named = |unit: &Unit| unit.name() == name;
    let found = Unit::ALL.into_iter().find(named);
    found.ok_or("expected mm, cm, in or m".into())
}

fn frame(name: &str) -> Result<ScanFrame, String> {
    match name {
        "scanner" => Ok(ScanFrame::Scanner),
        "scene" => Ok(ScanFrame::Scene),
        _ => Err("expected scanner or scene".into()),
    }
}

impl ScanArgs {
    /// The scan in `file` of the blank of `scene` where that lies now.
    pub fn seen(&self, file: &Path, scene: &Scene) -> Result<Seen, Failure> {
        let marks = self.marks.as_deref().map(read_toml::<Marks>);
        let marks = marks.transpose().or_invalid()?;
        if let (Some(file), Some(marks)) = (&self.marks, &marks) {
            let (place, count) = (file.display(), marks.scan_marks.len());
            ValueError::unless(count > 2, "scan_marks", count, "three or more")
                .or_invalid_in(&place)?;
            let is_sought = self.frame == ScanFrame::Scanner;
            let expected = "scanner where there are marks";
            ValueError::unless(is_sought, "--frame", "scene", expected).or_invalid_in(&place)?;
        }
        let mut scene = scene.clone();
        scene.config.placement = Placement {
            scan: Some(file.into()),
            scan_unit: self.unit,
            scan_frame: self.frame,
            scan_marks: marks.map_or(Vec::new(), |marks| marks.scan_marks),
            ..scene.config.placement
        };
        let seen = drape_scan::seen(&scene).map_err(|error| {
            // What is wrong with marks stands in the file that they are from.
            let of_marks = self.marks.as_deref().and_then(|file| {
                let text = format!(": {error}");
                let fault = text.split_once(": `placement.scan_marks")?.1;
                Some(anyhow!("{}: `scan_marks{fault}", file.display()))
            });
            Failure::invalid(of_marks.unwrap_or_else(|| error.into()))
        })?;
        let dropped = (seen.dropped_count > 0).then(|| {
            let count = seen.dropped_count;
            format!("{count} of its points are left out, as their coordinates are no numbers")
        });
        let others = (seen.other_places > 0).then(|| {
            let count = seen.other_places;
            format!("turned or tilted otherwise it lies as well in {count} more ways, expected one: give --marks")
        });
        warn(
            dropped.into_iter().chain(others),
            &file.display().to_string(),
        );
        Ok(seen)
    }
}
