use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::anyhow;
use serde::Serialize;

use super::Failure;
use super::args::{png, positive};
use super::explained::{doubts, explained, factors, line, same_scan};
use super::failure::OrInvalid;
use super::loaded::{Loaded, Source};
use super::output::{check_outputs, print};
use super::setup::{read_scene_or_run, set_up};
use super::terminal::Told;
use crate::run::Parameter;
use drape_calibrate::{
    Calibrated, FittedCurve, Lab, ObservedCloth, calibrate, posterior, scaled, scatter_table,
    write_material,
};
use drape_cloth::fabric::{Drape, Material};
use drape_cloth::math::Vec3;
use drape_cloth::scene::Scene;
use drape_report::{Chart, Color, Image, SERIES, Series};
use drape_scan::Cloud;
use drape_task::env::{EnvConfig, Scatter};
use drape_task::path::read_json;

/// Make a material file and its scatter from standard tests, or from scans of cloth
///
/// Tests are CSV files whose header names quantities with units (docs/CALIBRATE.md). Scans are STL, PLY or text
/// files of points on cloth that lies, hangs or was pressed as a scene says, in its frame, or state files; they tell factors on the scene's friction, bending,
/// shear and tension, by the fast solver.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:
  drape calibrate --test cantilever.csv tension.csv bias.csv friction.csv mass.csv --out mine.toml
  drape calibrate --test cantilever.csv --material mine.toml --out new.toml --picture fit.png
  drape calibrate strip.toml --scan strip.ply --out new.toml
  drape calibrate runs/a --scan pressed.stl --json")]
pub struct CalibrateArgs {
    /// What was scanned: a scene file or run configuration, or a run folder, whose path is pressed. One for all
    /// scans, or one a scan
    #[arg(value_name = "SCENE", requires = "scan")]
    scenes: Vec<PathBuf>,

    /// Standard tests
    #[arg(long, value_name = "FILE.csv", num_args = 1.., conflicts_with = "scan", required_unless_present = "scan")]
    test: Vec<PathBuf>,

    /// Scans of cloth
    #[arg(long, value_name = "FILE", num_args = 1.., requires = "scenes")]
    scan: Vec<PathBuf>,

    /// Metres per unit of scans; 0.001 if not given
    #[arg(long, value_name = "METRES", value_parser = positive, requires = "scan")]
    scale: Option<f64>,

    /// What was pressed in a scene before it was scanned: points that `drape export` wrote as JSON
    #[arg(long, value_name = "FILE.json", requires = "scan")]
    presses: Option<PathBuf>,

    /// Material file that has what tests do not tell
    #[arg(long, value_name = "FILE.toml", conflicts_with = "scan")]
    material: Option<PathBuf>,

    /// Material file to write, with the scatter as a comment
    #[arg(long, value_name = "FILE.toml", required_unless_present = "scan")]
    out: Option<PathBuf>,

    /// PNG of the curves over what tests have measured
    #[arg(long, value_name = "FILE.png", value_parser = png, requires = "test")]
    picture: Option<PathBuf>,
}

/// What is printed.
#[derive(Serialize)]
struct Report {
    file: Option<Told>,
    picture: Option<Told>,
    parameters: Vec<Parameter>,
    scatter: Scatter,
    /// Keys that are those of `--material`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    kept: Vec<String>,
    notes: Vec<String>,
    #[serde(flatten)]
    fit: Option<Fit>,
}

/// How well simulated cloth lies in scans.
#[derive(Serialize)]
struct Fit {
    points: usize,
    rms_mm: f64,
    evaluations: usize,
}

/// Runs `drape calibrate`.
pub fn run(args: CalibrateArgs) -> Result<(), Failure> {
    let written = args.out.iter().chain(&args.picture).map(PathBuf::as_path);
    let read = [&args.test, &args.scan, &args.scenes].into_iter().flatten();
    let read = read.chain(&args.material).chain(&args.presses);
    check_outputs(written, read.map(PathBuf::as_path))?;
    let (material, report) = match args.scan.is_empty() {
        true => by_tests(&args)?,
        false => by_scans(&args)?,
    };
    if let Some(file) = &args.out {
        write_material(file, &material, &report.notes, &report.scatter)?;
    }
    print(&report, text)
}

fn by_tests(args: &CalibrateArgs) -> Result<(Material, Report), Failure> {
    let mut lab = Lab::default();
    for file in &args.test {
        lab.read(file).or_invalid()?;
    }
    let base = args.material.as_deref().map(Material::read);
    let base = base.transpose().or_invalid()?;
    let name = args.out.as_deref().and_then(Path::file_stem);
    let name = name.unwrap_or_default().to_string_lossy();
    let tests: Vec<String> = args.test.iter().map(|f| f.display().to_string()).collect();
    let made = calibrate(&lab, base.as_ref(), &name).or_invalid_in(tests.join(", "))?;
    if let Some(file) = &args.picture {
        drawn(&made, file)?;
    }
    let Calibrated {
        material,
        scatter,
        parameters,
        kept,
        notes,
        ..
    } = made;
    let parameters = parameters.into_iter().map(|(name, found)| Parameter {
        name,
        value: found.value,
        low: found.interval.map(|ends| ends[0]),
        high: found.interval.map(|ends| ends[1]),
        specimens: Some(found.specimens),
        told: None,
    });
    let report = Report {
        file: args.out.clone().map(Told::from),
        picture: args.picture.clone().map(Told::from),
        parameters: parameters.collect(),
        scatter,
        kept,
        notes,
        fit: None,
    };
    Ok((material, report))
}

/// Draws the curves that were fitted, tension beside shear.
fn drawn(made: &Calibrated, file: &Path) -> Result<(), Failure> {
    let chart = |kind: &str, title: &str, x_label: &str| {
        let of_kind = |curve: &&FittedCurve| curve.key.contains(kind);
        let curves = made.curves.iter().filter(of_kind).zip(SERIES);
        let series: Vec<Series> = curves
            .flat_map(|(curve, color)| series(curve, color))
            .collect();
        let chart = Chart {
            title: title.into(),
            x_label: x_label.into(),
            y_label: "stress [MPa]".into(),
            series,
            ..Chart::default()
        };
        (!chart.series.is_empty()).then(|| chart.image())
    };
    let images: Vec<Image> = [
        chart("tension", "tension", "strain"),
        chart("shear", "shear", "change of the yarn angle [rad]"),
    ]
    .into_iter()
    .flatten()
    .collect();
    if images.is_empty() {
        return Err(Failure::invalid(anyhow!(
            "--picture has no curve to draw, expected a test of tension or shear"
        )));
    }
    Ok(Image::beside(&images).save_png(file)?)
}

/// Points, each a run of its own, and the curve through them.
fn series(curve: &FittedCurve, color: Color) -> [Series; 2] {
    let apart = |&point: &[f64; 2]| [point, [f64::NAN; 2]];
    let series = |label: &str, points| Series {
        label: label.into(),
        points,
        color,
    };
    [
        series("", curve.points.iter().flat_map(apart).collect()),
        series(&curve.key, curve.fit.clone()),
    ]
}

fn by_scans(args: &CalibrateArgs) -> Result<(Material, Report), Failure> {
    let (scenes, scans) = (&args.scenes, &args.scan);
    if scenes.len() != 1 && scenes.len() != scans.len() {
        return Err(Failure::invalid(anyhow!(
            "there are {} scenes and {} scans, expected one scene or as many as scans",
            scenes.len(),
            scans.len()
        )));
    }
    let scanned = scans
        .iter()
        .map(|scan| points(scan, args.scale.unwrap_or(1e-3)));
    let scanned = scanned.collect::<Result<Vec<_>, _>>()?;
    let seen = scenes.iter().map(|scene| Seen::read(scene, args));
    let seen = seen.collect::<Result<Vec<_>, _>>()?;
    let files: Vec<PathBuf> = seen
        .iter()
        .flat_map(|seen| seen.scene.config.files())
        .collect();
    check_outputs(args.out.as_deref(), files.iter().map(PathBuf::as_path))?;
    let first = &seen[0];
    for (other, path) in seen.iter().zip(scenes) {
        let fabric = |seen: &Seen| {
            let bending = seen.scene.model.physics().bending_stiffness;
            (seen.scene.lamina.material.clone(), bending)
        };
        if fabric(other) != fabric(first) {
            return Err(Failure::invalid(anyhow!(
                "{} has another material or physics.bending_stiffness than {}, expected one fabric",
                path.display(),
                scenes[0].display()
            )));
        }
    }
    let states: Vec<ObservedCloth> = scanned
        .iter()
        .enumerate()
        .map(|(k, points)| seen[k.min(seen.len() - 1)].observed(points))
        .collect();
    for (k, points) in scanned.iter().enumerate() {
        if let Some(first) = scanned[..k].iter().position(|other| other == points) {
            let twins = [&scans[k], &scans[first]].map(|scan| scan.display());
            return Err(same_scan(twins));
        }
    }
    let estimate = explained(&states, scans, &first.scatter)?;
    let (lamina, physics) = (&first.scene.lamina, first.scene.model.physics());
    if estimate.rms > lamina.cell_diagonal() {
        let names: Vec<String> = scans
            .iter()
            .map(|scan| scan.display().to_string())
            .collect();
        return Err(Failure::invalid(anyhow!(
            "{}: points are {:.1} mm off the simulated cloth, root mean square, expected less than the diagonal of a \
             cell, {:.1} mm: check --scale, and that they are in the scene's frame",
            names.join(", "),
            1e3 * estimate.rms,
            1e3 * lamina.cell_diagonal()
        )));
    }
    let (material, mut notes) = scaled(&lamina.material, physics, &estimate);
    notes.extend(doubts(&estimate));
    let report = Report {
        file: args.out.clone().map(Told::from),
        picture: None,
        parameters: factors(&estimate),
        scatter: posterior(&estimate),
        kept: Vec::new(),
        notes,
        fit: Some(Fit {
            points: estimate.residuals,
            rms_mm: 1e3 * estimate.rms,
            evaluations: estimate.evaluations,
        }),
    };
    Ok((material, report))
}

/// What a scan may be of.
struct Seen {
    scene: Arc<Scene>,
    env: EnvConfig,
    presses: Vec<u32>,
    scatter: Scatter,
}

impl Seen {
    fn read(path: &Path, args: &CalibrateArgs) -> Result<Self, Failure> {
        let place = path.display().to_string();
        if path.is_dir() {
            if args.presses.is_some() {
                let error =
                    "`--presses` is for scenes, expected none beside a run, whose path is pressed";
                return Err(Failure::invalid(anyhow!("{place}: {error}")));
            }
            let loaded = Loaded::open(path, Source::Path, None, None)?;
            let presses = loaded.play_path()?.0.recording.vertices();
            let config = &loaded.config;
            return Ok(Self {
                env: config.scatter.finest(&config.env),
                scatter: config.scatter.clone(),
                scene: loaded.scene.clone(),
                presses,
            });
        }
        let config = read_scene_or_run(path)?;
        let (env, scatter) = (config.env, config.scatter);
        let scene = Arc::new(set_up(&config.scene, &place)?);
        let mut presses = Vec::new();
        if let Some(file) = &args.presses {
            presses.extend(
                read_json(file)
                    .or_invalid()?
                    .iter()
                    .map(|point| point.vertex),
            );
            if presses.is_empty() {
                let fault = anyhow!("{}: has no points, expected one or more", file.display());
                return Err(Failure::invalid(fault));
            }
            let count = scene.lamina.vertex_count();
            if let Some(found) = presses.iter().find(|&&v| v as usize >= count) {
                return Err(Failure::invalid(anyhow!(
                    "{}: presses vertex {found}, expected one below {count} as in {place}",
                    file.display()
                )));
            }
        }
        if let (Some(scan), true) = (&scene.config.placement.scan, presses.is_empty()) {
            return Err(Failure::invalid(anyhow!(
                "{place}: `placement.scan` is {}, expected none where nothing is pressed: a blank that starts from a scan \
                 does not fall, and tells nothing of its fabric",
                scan.display()
            )));
        }
        Ok(Self {
            env: scatter.finest(&env),
            scene,
            presses,
            scatter,
        })
    }

    fn observed(&self, points: &[Vec3]) -> ObservedCloth {
        let (env, presses) = (self.env.clone(), self.presses.clone());
        ObservedCloth::new(self.scene.clone(), env, presses, points)
    }
}

/// The points of a scan or a state file [m].
fn points(path: &Path, scale: f64) -> Result<Vec<Vec3>, Failure> {
    let is_state = path
        .extension()
        .is_some_and(|end| end.eq_ignore_ascii_case("json"));
    Ok(match is_state {
        true => Drape::read(path).or_invalid()?.mesh().vertices,
        false => Cloud::read(path, scale).or_invalid()?.points,
    })
}

fn text(report: &Report) -> String {
    let mut lines: Vec<String> = Vec::new();
    lines.extend(report.parameters.iter().map(line));
    if let Some(fit) = &report.fit {
        lines.push(format!(
            "{} points, {:.3} mm off the simulated cloth rms, {} evaluations",
            fit.points, fit.rms_mm, fit.evaluations
        ));
    }
    if !report.kept.is_empty() {
        lines.push(format!("kept: {}", report.kept.join(", ")));
    }
    lines.extend(report.notes.iter().cloned());
    lines.extend(scatter_table(&report.scatter).lines().map(str::to_owned));
    for (what, file) in [("material", &report.file), ("picture", &report.picture)] {
        lines.extend(
            file.iter()
                .map(|file| format!("{what} in {}", file.display())),
        );
    }
    lines.join("\n")
}
