//! How well a judge tells which path holds: the ranks of what it says beside those of the twin.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::statistics::{bootstrap, rank_correlation};
use crate::study::{Context, KeptPaths, Report, Study, StudyError};
use drape_cloth::scene::Scene;
use drape_cloth::sim::Stepping;
use drape_proof::Case;
use drape_report::{Chart, SERIES, Series, Table};
use drape_task::env::{EnvConfig, Quantity, mean_and_worst_quarter};

/// Tell how well few worlds and coarse steps say which path holds: the rank correlation with the
/// finite-element twin's mean over worlds
///
/// Presses paths that runs on one task have kept, in scattered worlds of the fast solver at several rates of
/// substeps and in others of the twin, or of the solver in its finest steps. Correlations are means over disjoint sets
/// of worlds, with 95 % intervals over paths.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = "Examples:
  drape study judge runs/a runs/b
  drape study judge runs/a runs/b runs/c --paths 30 --twin-worlds 6 --json > judge.json
  drape study judge runs/a --finest                  # how fine steps a mesh takes, in minutes")]
pub struct Judging {
    /// Run folders of one task and one scatter
    #[arg(required = true, value_name = "RUN")]
    runs: Vec<PathBuf>,

    /// Paths, as many of each run, rounded up, evenly from the proved one to the worst that it has kept
    #[arg(long, default_value_t = 30, value_name = "N", value_parser = clap::value_parser!(u16).range(4..=100))]
    paths: u16,

    /// Worlds of the twin
    #[arg(long, default_value_t = 6, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=100))]
    twin_worlds: u16,

    /// Instead of the twin ask 24 worlds of the fast solver, in 24000 substeps a second
    #[arg(long, conflicts_with_all = ["twin_worlds", "alone"])]
    finest: bool,

    /// Also let each quantity that scatters vary by itself, in as many worlds of both, for the best path of the
    /// first run
    #[arg(long)]
    alone: bool,
}

/// Substeps [1/s] of the judges.
const RATES: [f64; 6] = [600.0, 1200.0, 2400.0, 4800.0, 9600.0, 12_000.0];
/// Substeps [1/s] of what they are held against with `--finest`.
const FINEST: f64 = 24_000.0;
/// Worlds that they see.
const COUNTS: [usize; 5] = [1, 3, 6, 12, 24];

/// What a judge's worlds come to.
type Measure = fn(&[f64]) -> f64;
const MEASURES: [(&str, Measure); 3] = [
    ("mean", mean),
    ("worst quarter", worst_quarter),
    ("worst", worst),
];

fn mean(scores: &[f64]) -> f64 {
    mean_and_worst_quarter(scores)[0]
}

fn worst_quarter(scores: &[f64]) -> f64 {
    mean_and_worst_quarter(scores)[1]
}

fn worst(scores: &[f64]) -> f64 {
    scores.iter().copied().fold(f64::INFINITY, f64::min)
}

struct Judged {
    rate: f64,
    count: usize,
    /// Of each measure.
    correlations: [f64; 3],
    /// Of the worst quarter.
    interval: [f64; 2],
    /// CPU time for a path [s].
    cpu_s: f64,
}

impl Study for Judging {
    const NAME: &'static str = "judge";
    const TABLES: &'static [&'static str] = &["judges", "paths", "alone"];

    fn run(&self, context: &Context) -> Result<Report, StudyError> {
        let read = |path: &PathBuf| (context.read_kept)(path);
        let kept: Vec<KeptPaths> = self.runs.iter().map(read).collect::<Result<_, _>>()?;
        let first = &kept[0];
        let is_other = |one: &KeptPaths| {
            (&one.scene, &one.env, &one.scatter) != (&first.scene, &first.env, &first.scatter)
        };
        if let Some(k) = kept.iter().position(is_other) {
            let [other, own] = [&self.runs[k], &self.runs[0]].map(|run| run.display());
            let message = format!("{other} has another task or scatter, expected those of {own}");
            return Err(StudyError::Invalid(message));
        }
        if first.scatter.spreads.is_empty() {
            let run = self.runs[0].display();
            let message =
                format!("`[scatter]` of {run} lets nothing vary, expected worlds that differ");
            return Err(StudyError::Invalid(message));
        }
        let lists = self.chosen(&kept);
        let scene = Arc::new(Scene::new(&first.scene, |_| ())?);
        let case = Case {
            scene: &scene,
            env: &first.env,
            scatter: &first.scatter,
            seed: 0,
        };
        let refs: Vec<&[u32]> = lists.iter().map(|(_, list)| list.as_slice()).collect();
        let worlds = case.proving_worlds(context.listener())?;
        let (listener, most) = (context.listener(), COUNTS[COUNTS.len() - 1]);
        let (truth, asked) = if self.finest {
            let env = stepped(case, FINEST);
            let (scores, _) = case.scores(&refs, &worlds, most, env, listener)?;
            (scores, format!("{most} worlds at {FINEST}/s"))
        } else {
            let count = usize::from(self.twin_worlds);
            let scores = case.scores_in_twin(&refs, &worlds, count, listener)?;
            (scores, format!("{count} worlds of the twin"))
        };
        let means: Vec<f64> = truth.iter().map(|scores| mean(scores)).collect();
        let judges = judges(case, &refs, &means, context)?;
        let mut rows: Vec<(usize, &Path, usize)> = Vec::new();
        for (k, (run, list)) in lists.iter().enumerate() {
            rows.push((k, &self.runs[*run], list.len()));
        }
        let paths = Table::of("paths", format!("In {asked}"), &rows)
            .text("run", |(_, run, _)| run.display().to_string())
            .text("presses", |(.., presses)| *presses)
            .number("mean [%]", 1, |(k, ..)| 1e2 * means[*k])
            .number("worst [%]", 1, |(k, ..)| 1e2 * worst(&truth[*k]))
            .end();
        let title = format!(
            "Rank correlation with the mean of {asked}, {} paths",
            lists.len()
        );
        let mut tables = vec![table(&judges, title), paths];
        if self.alone {
            tables.push(self.alone(case, refs[0], context)?);
        }
        let mut report = Report::new(tables);
        report.image("judge.png", chart(&judges).image());
        Ok(report)
    }
}

impl Judging {
    /// What each quantity by itself does to a path.
    fn alone(&self, case: Case, path: &[u32], context: &Context) -> Result<Table, StudyError> {
        let (count, finest) = (usize::from(self.twin_worlds), case.scatter.finest(case.env));
        let mut rows: Vec<(Quantity, [Vec<f64>; 2])> = Vec::new();
        for &quantity in case.scatter.spreads.keys() {
            let scatter = &case.scatter.only(quantity);
            let one = Case { scatter, ..case };
            // The same draws in both.
            let listener = context.listener();
            let worlds = one.proving_worlds(listener)?;
            let (mut solver, _) = one.scores(&[path], &worlds, count, finest.clone(), listener)?;
            let mut twin = one.scores_in_twin(&[path], &worlds, count, listener)?;
            rows.push((quantity, [solver.remove(0), twin.remove(0)]));
        }
        rows.sort_by(|(_, [a, _]), (_, [b, _])| mean(a).total_cmp(&mean(b)));
        let title = format!("Each quantity by itself, {count} worlds: scores of the best path");
        Ok(Table::of("alone", title, &rows)
            .text("varies", |(quantity, _)| quantity.name())
            .number("solver, mean [%]", 1, |(_, [solver, _])| 1e2 * mean(solver))
            .number("worst [%]", 1, |(_, [solver, _])| 1e2 * worst(solver))
            .number("twin, mean [%]", 1, |(_, [_, twin])| 1e2 * mean(twin))
            .number("its worst [%]", 1, |(_, [_, twin])| 1e2 * worst(twin))
            .end())
    }

    /// Numbers of runs, and lists.
    fn chosen<'a>(&self, kept: &'a [KeptPaths]) -> Vec<(usize, &'a Vec<u32>)> {
        let each = usize::from(self.paths).div_ceil(kept.len());
        let of = |(run, kept): (usize, &'a KeptPaths)| {
            let all = &kept.lists;
            let count = each.min(all.len());
            let last = (count - 1).max(1);
            (0..count).map(move |k| (run, &all[k * (all.len() - 1) / last]))
        };
        kept.iter().enumerate().flat_map(of).collect()
    }
}

/// The task in so many substeps a second.
fn stepped(case: Case, substep_rate: f64) -> EnvConfig {
    let mut env = case.env.clone();
    env.set_stepping(Stepping::every(substep_rate, 5));
    env
}

fn judges(
    case: Case,
    lists: &[&[u32]],
    truth: &[f64],
    context: &Context,
) -> Result<Vec<Judged>, StudyError> {
    let most = COUNTS[COUNTS.len() - 1];
    let worlds = case.other_worlds(context.listener())?;
    let mut found = Vec::new();
    for rate in RATES {
        let env = stepped(case, rate);
        let (scores, seconds) = case.scores(lists, &worlds, most, env, context.listener())?;
        for count in COUNTS {
            // Over the lists of these numbers, mean over disjoint sets of worlds.
            let correlation = |of: Measure, numbers: &[usize]| {
                let own: Vec<f64> = numbers.iter().map(|&k| truth[k]).collect();
                let sets = (0..most / count).map(|set| {
                    let worlds = set * count..(set + 1) * count;
                    let judged = numbers.iter().map(|&k| of(&scores[k][worlds.clone()]));
                    rank_correlation(&judged.collect::<Vec<_>>(), &own)
                });
                sets.sum::<f64>() / (most / count) as f64
            };
            let all: Vec<usize> = (0..lists.len()).collect();
            let indices: Vec<f64> = all.iter().map(|&k| k as f64).collect();
            found.push(Judged {
                rate,
                count,
                correlations: MEASURES.map(|(_, of)| correlation(of, &all)),
                interval: bootstrap([&indices], |[drawn]| {
                    let drawn: Vec<usize> = drawn.iter().map(|&k| k as usize).collect();
                    correlation(worst_quarter, &drawn)
                }),
                cpu_s: count as f64 * seconds,
            });
        }
    }
    Ok(found)
}

fn table(judges: &[Judged], title: String) -> Table {
    let mut table = Table::of("judges", title, judges)
        .number("rate [1/s]", 0, |judged| judged.rate)
        .text("worlds", |judged| judged.count);
    for (k, (name, _)) in MEASURES.into_iter().enumerate() {
        table = table.number(name, 2, move |judged| judged.correlations[k]);
    }
    table
        .number("worst quarter, low", 2, |judged| judged.interval[0])
        .number("high", 2, |judged| judged.interval[1])
        .number("CPU a path [s]", 2, |judged| judged.cpu_s)
        .end()
}

fn chart(judges: &[Judged]) -> Chart {
    let series = RATES.iter().zip(SERIES).map(|(&rate, color)| {
        let own = judges.iter().filter(|judged| judged.rate == rate);
        let at = |judged: &Judged| [judged.count as f64, judged.correlations[1]];
        Series {
            label: format!("{rate} substeps a second"),
            points: own.map(at).collect(),
            color,
        }
    });
    Chart {
        title: "Judging by the worst quarter of worlds".into(),
        x_label: "worlds".into(),
        y_label: "rank correlation [-]".into(),
        series: series.collect(),
        ..Chart::default()
    }
}

#[cfg(test)]
mod tests;
