//! How well trainings learn over several seeds, and whether one configuration learns better than
//! another. Reads what runs have left; whoever runs the study trains them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::statistics::{bootstrap, extremes, interquartile_mean, probability_of_improvement};
use crate::study::{Context, Report, Study, StudyError};
use crate::trainings::{LearnedRun, LearningCurve, Trainings, Treatment};
use drape_report::{Band, Chart, SERIES, Series};
use drape_report::{Format::Digits, Table};

/// Train with several seeds and tell how well it is learned: interquartile means of scores with 95 %
/// bootstrap intervals, by configuration, and the probability that one learns better than the first
///
/// Runs stand in the folder of the study, CONFIG/seed-K. A 95 % interval of few runs is too narrow:
/// take ten or more before you believe it.
#[derive(Clone, Debug, clap::Args)]
#[command(after_help = "Examples:
  drape study learning --seeds 5
  drape study learning a.toml b.toml --seeds 10 --steps 50000 --jobs 2
  drape study learning a.toml b.toml --seeds 20 --resume runs/study-learning-DATE")]
pub struct Learning {
    #[command(flatten)]
    trainings: Trainings,

    /// Go on with the study in this folder: runs that are complete are kept
    #[arg(long, value_name = "DIR", conflicts_with = "out")]
    resume: Option<PathBuf>,
}

/// Mean explained variance of a third of a training, 0 to 2; none where it has less than three
/// iterations.
fn explained(run: &LearnedRun, third: usize) -> Option<f64> {
    let curve = &run.explained_variance;
    let length = curve.len() / 3;
    // What is left over is of the last.
    let end = [length, 2 * length, curve.len()][third];
    let values = curve[third * length..end].iter().map(|(_, value)| value);
    (length > 0).then(|| values.clone().sum::<f64>() / values.count() as f64)
}

fn last(curve: &LearningCurve) -> Option<f64> {
    Some(curve.last()?.1)
}

/// A figure of a run: its name with its unit, and how it is got.
type Figure = (&'static str, fn(&LearnedRun) -> Option<f64>);

/// How many of [`FIGURES`] are scores.
const SCORES: usize = 4;

const FIGURES: [Figure; 9] = [
    ("last 50 episodes [%]", |run| Some(1e2 * last(&run.mean)?)),
    ("greedy [%]", |run| Some(1e2 * last(&run.greedy)?)),
    ("best [%]", |run| Some(1e2 * last(&run.best)?)),
    ("proved [%]", |run| Some(1e2 * run.proved?)),
    ("undraped inner, proved", |run| run.undraped_inner),
    ("seconds", |run| run.seconds),
    ("explained variance, first third", |run| explained(run, 0)),
    ("middle third", |run| explained(run, 1)),
    ("last third", |run| explained(run, 2)),
];

/// A figure of those runs of an treatment that have it.
fn values(treatment: &Treatment, (_, of): Figure) -> Vec<f64> {
    treatment.runs.iter().filter_map(of).collect()
}

impl Study for Learning {
    const NAME: &'static str = "learning";
    const TABLES: &'static [&'static str] = &["figures", "improvement", "runs"];

    fn resumed(&self) -> Option<&Path> {
        self.resume.as_deref()
    }

    fn run(&self, context: &Context) -> Result<Report, StudyError> {
        let treatments = (context.train)(&self.trainings)?;
        let mut report = Report::new([figures(&treatments), runs(&treatments)]);
        if treatments.len() > 1 {
            report.tables.push(improvement(&treatments));
        }
        for (name, title, of) in CURVES {
            report.image(name, chart(&treatments, title, of).image());
        }
        Ok(report)
    }
}

fn figures(treatments: &[Treatment]) -> Table {
    let mut rows = Vec::new();
    for treatment in treatments {
        for figure in FIGURES {
            let values = values(treatment, figure);
            let interval = bootstrap([&values], |[values]| interquartile_mean(values));
            rows.push((treatment, figure.0, values, interval));
        }
    }
    let title = "Interquartile means over runs with their 95 % intervals (bootstrap)";
    Table::of("figures", title, &rows)
        .text("configuration", |(treatment, ..)| &*treatment.name)
        .text("figure", |(_, name, ..)| *name)
        .text("runs", |(.., values, _)| values.len())
        .number("mean", Digits(4), |(.., values, _)| {
            interquartile_mean(values)
        })
        .number("low", Digits(4), |(.., interval)| interval[0])
        .number("high", Digits(4), |(.., interval)| interval[1])
        .number("min", Digits(4), |(.., values, _)| extremes(values)[0])
        .number("max", Digits(4), |(.., values, _)| extremes(values)[1])
        .end()
}

/// Every run, for files.
fn runs(treatments: &[Treatment]) -> Table {
    let mut rows = Vec::new();
    for treatment in treatments {
        rows.extend(treatment.runs.iter().map(|run| (&*treatment.name, run)));
    }
    let mut table = Table::of("runs", "", &rows)
        .text("configuration", |(name, _)| *name)
        .text("seed", |(_, run)| run.seed);
    for (name, of) in FIGURES {
        table = table.number(name, 2, |(_, run)| of(run));
    }
    table.end()
}

fn improvement(treatments: &[Treatment]) -> Table {
    let mut rows = Vec::new();
    for treatment in &treatments[1..] {
        for figure in &FIGURES[..SCORES] {
            let values = [treatment, &treatments[0]].map(|treatment| values(treatment, *figure));
            let values = values.each_ref().map(Vec::as_slice);
            let found = probability_of_improvement(values);
            let interval = bootstrap(values, probability_of_improvement);
            rows.push((treatment, figure.0, found, interval));
        }
    }
    let title = format!(
        "Probability that a run scores more than one of {}, with its 95 % interval",
        treatments[0].name
    );
    Table::of("improvement", title, &rows)
        .text("configuration", |(treatment, ..)| &*treatment.name)
        .text("figure", |(_, name, ..)| *name)
        .number("probability", 2, |(_, _, found, _)| *found)
        .number("low", 2, |(.., interval)| interval[0])
        .number("high", 2, |(.., interval)| interval[1])
        .end()
}

/// One of the curves of a run.
type OfRun = fn(&LearnedRun) -> &LearningCurve;

/// Names of pictures, their titles, and whose curves they show.
const CURVES: [(&str, &str, OfRun); 3] = [
    ("mean.png", "Mean score of the last 50 episodes", |run| {
        &run.mean
    }),
    ("greedy.png", "Score of the greedy policy", |run| {
        &run.greedy
    }),
    ("best.png", "Best score so far", |run| &run.best),
];

/// Interquartile means over the runs of each treatment with their intervals, at the steps that all of
/// them have.
fn chart(treatments: &[Treatment], title: &str, of: OfRun) -> Chart {
    let mut chart = Chart {
        title: format!("{title}: interquartile means and 95 % intervals"),
        x_label: "environment steps".into(),
        y_label: "score [%]".into(),
        ..Chart::default()
    };
    for (treatment, color) in treatments.iter().zip(SERIES.into_iter().cycle()) {
        let mut steps = BTreeMap::<u64, Vec<f64>>::new();
        for &(step, score) in treatment.runs.iter().flat_map(of) {
            steps.entry(step).or_default().push(1e2 * score);
        }
        steps.retain(|_, scores| scores.len() == treatment.runs.len());
        let at = |(&step, scores): (&u64, &Vec<f64>)| [step as f64, interquartile_mean(scores)];
        chart.series.push(Series {
            label: treatment.name.clone(),
            points: steps.iter().map(at).collect(),
            color,
        });
        let around = |(&step, scores): (&u64, &Vec<f64>)| {
            let [low, high] = bootstrap([scores], |[scores]| interquartile_mean(scores));
            [step as f64, low, high]
        };
        let points = steps.iter().map(around).collect();
        chart.bands.push(Band { points, color });
    }
    chart
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(seed: u64, mean: f64) -> LearnedRun {
        LearnedRun {
            seed,
            mean: vec![(10, 0.1), (20, mean)],
            explained_variance: (0..7).map(|k| (k, k as f64)).collect(),
            ..LearnedRun::default()
        }
    }

    fn treatment(name: &str, scores: &[f64]) -> Treatment {
        let runs = scores
            .iter()
            .zip(1..)
            .map(|(&score, seed)| run(seed, score));
        Treatment {
            name: name.into(),
            runs: runs.collect(),
        }
    }

    #[test]
    fn figures_are_means_and_what_runs_lack_is_none() {
        let treatments = [
            treatment("a", &[0.25, 0.5, 0.75]),
            treatment("b", &[1.0, 1.0]),
        ];
        let rows = figures(&treatments).json();
        let rows = rows.as_array().unwrap();
        assert_eq!(rows.len(), 2 * FIGURES.len());
        assert_eq!(
            (&rows[0]["mean"], &rows[0]["runs"]),
            (&50.0.into(), &3.into())
        );
        assert_eq!(
            (&rows[0]["low"], &rows[0]["high"]),
            (&25.0.into(), &75.0.into())
        );
        // No greedy episode, no proof.
        for row in &rows[1..SCORES] {
            assert!(
                row["mean"].is_null() && row["low"].is_null() && row["min"].is_null(),
                "{row}"
            );
            assert_eq!(row["runs"], 0);
        }
        // The last third has what is left.
        let thirds: Vec<_> = rows[6..9].iter().map(|row| &row["mean"]).collect();
        assert_eq!(thirds, [0.5, 2.5, 5.0]);
        assert_eq!(explained(&LearnedRun::default(), 0), None);

        let text = figures(&treatments).text();
        let line = text.lines().find(|line| line.contains("greedy")).unwrap();
        assert!(line.split_whitespace().last() == Some("-"), "{line}");
    }

    #[test]
    fn arms_are_held_against_the_first() {
        let treatments = [treatment("a", &[0.25, 0.5]), treatment("b", &[0.5, 0.75])];
        let rows = improvement(&treatments).json();
        assert_eq!(rows[0]["probability"], 0.875);
        assert_eq!(
            (&rows[0]["low"], &rows[0]["high"]),
            (&0.5.into(), &1.0.into())
        );
        assert!(rows[1]["probability"].is_null());
    }

    #[test]
    fn curves_have_the_steps_that_all_runs_have() {
        let mut treatments = [treatment("a", &[0.25, 0.75])];
        treatments[0].runs[1].mean.push((30, 1.0));
        let chart = chart(&treatments, "", |run| &run.mean);
        assert_eq!(chart.series[0].points, [[10.0, 10.0], [20.0, 50.0]]);
        assert_eq!(
            chart.bands[0].points,
            [[10.0, 10.0, 10.0], [20.0, 25.0, 75.0]]
        );
    }
}
