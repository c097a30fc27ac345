use std::sync::Arc;

use super::shown::Shown;
use drape_task::env::Observation;

/// Observations, one a row, where the network that learns from them wants them.
#[derive(Clone, Debug)]
pub enum Seen {
    Host(Vec<Observation>),
    Device(Arc<Shown>),
}

/// Observations that a network is asked about.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "there is one at a time")]
pub enum Batch<'a> {
    Host(Vec<&'a Observation>),
    Device(Shown),
}

/// Pixels of a piece on the device: 64 MiB, half of what the smallest buffers hold.
const MOST_PIXELS: usize = 1 << 24;

/// Everything seen in a rollout, in order.
#[derive(Debug, Default)]
pub struct History {
    pieces: Vec<Seen>,
    /// `[piece]`: rows before its end.
    ends: Vec<usize>,
}

impl Seen {
    fn rows(&self) -> usize {
        match self {
            Self::Host(observations) => observations.len(),
            Self::Device(shown) => shown.scenes().len(),
        }
    }

    /// Some rows, in that order.
    pub fn pick(&self, rows: impl IntoIterator<Item = usize>) -> Batch<'_> {
        match self {
            Self::Host(all) => Batch::Host(rows.into_iter().map(|row| &all[row]).collect()),
            Self::Device(shown) => {
                Batch::Device(shown.select(&rows.into_iter().collect::<Vec<_>>()))
            }
        }
    }
}

impl From<Vec<Seen>> for History {
    /// On a device in few pieces, so that few operations choose among them.
    fn from(steps: Vec<Seen>) -> Self {
        let mut history = Self::default();
        let mut together = Vec::new();
        let mut pixels = 0;
        for seen in steps {
            match seen {
                Seen::Host(_) => history.push(seen),
                Seen::Device(shown) => {
                    if pixels + shown.size() > MOST_PIXELS {
                        history.join(&mut together);
                        pixels = 0;
                    }
                    pixels += shown.size();
                    together.push(Shown::clone(&shown));
                }
            }
        }
        history.join(&mut together);
        history
    }
}

impl History {
    pub(super) fn push(&mut self, piece: Seen) {
        let before = self.ends.last().copied().unwrap_or(0);
        self.ends.push(before + piece.rows());
        self.pieces.push(piece);
    }

    fn join(&mut self, together: &mut Vec<Shown>) {
        if !together.is_empty() {
            let joined = Shown::cat(std::mem::take(together));
            self.push(Seen::Device(Arc::new(joined)));
        }
    }

    /// The piece that has a row, and its number there.
    fn place(&self, row: usize) -> (usize, usize) {
        let piece = self.ends.partition_point(|&end| end <= row);
        (
            piece,
            row - piece.checked_sub(1).map_or(0, |before| self.ends[before]),
        )
    }

    /// Which of the terrains a row lies on.
    pub fn scene(&self, row: usize) -> u16 {
        let (piece, row) = self.place(row);
        match &self.pieces[piece] {
            Seen::Host(observations) => observations[row].scene,
            Seen::Device(shown) => shown.scenes()[row],
        }
    }

    /// Some rows, of which there are some, in that order.
    pub fn pick(&self, rows: &[usize]) -> Batch<'_> {
        let mut host = Vec::new();
        let mut there = vec![Vec::new(); self.pieces.len()];
        let mut order = vec![Vec::new(); self.pieces.len()];
        for (number, &row) in rows.iter().enumerate() {
            let (piece, row) = self.place(row);
            match &self.pieces[piece] {
                Seen::Host(observations) => host.push(&observations[row]),
                Seen::Device(_) => {
                    there[piece].push(row);
                    order[piece].push(number);
                }
            }
        }
        let of_piece = |(piece, rows): (&Seen, &Vec<usize>)| match piece {
            Seen::Device(shown) if !rows.is_empty() => Some(shown.select(rows)),
            _ => None,
        };
        let parts: Vec<Shown> = self
            .pieces
            .iter()
            .zip(&there)
            .filter_map(of_piece)
            .collect();
        match parts.len() {
            0 => Batch::Host(host),
            1 => Batch::Device(Shown::cat(parts)),
            _ => {
                let mut places = vec![0; rows.len()];
                for (place, number) in order.into_iter().flatten().enumerate() {
                    places[number] = place;
                }
                Batch::Device(Shown::cat(parts).select(&places))
            }
        }
    }
}

impl<'a> Batch<'a> {
    /// The same and more, which go where it is.
    pub fn with(self, more: impl Iterator<Item = &'a Observation>) -> Self {
        match self {
            Self::Host(mut observations) => {
                observations.extend(more);
                Self::Host(observations)
            }
            Self::Device(shown) => {
                let more: Vec<&Observation> = more.collect();
                let parts = match more.is_empty() {
                    true => vec![shown],
                    false => {
                        let more = Shown::upload(&more, &shown.device());
                        vec![shown, more]
                    }
                };
                Self::Device(Shown::cat(parts))
            }
        }
    }

    /// How many.
    pub fn rows(&self) -> usize {
        match self {
            Self::Host(observations) => observations.len(),
            Self::Device(shown) => shown.scenes().len(),
        }
    }
}
