//! Abaqus-style input decks, which CalculiX reads too.
//!
//! Units in a deck are mm, N, s, t and MPa. Nodes and elements count from 1.

mod draping;

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

pub use draping::{Dialect, DrapingDeck, FabricCard};

use drape_cloth::file::{WriteError, write_atomic};
use drape_cloth::math::Vec3;

const MM: f64 = 1e3;
/// Labels a line: far below the 16 that readers take, and within their line length.
const LABELS: usize = 10;

/// A deck, card by card in the order in which they are added.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Deck {
    text: String,
}

impl Deck {
    /// A deck that begins with a title of one line.
    pub fn new(title: &str) -> Self {
        let mut deck = Self::default();
        // A title may not begin like a card.
        let title = format!(" {}", title.replace('\n', " "));
        deck.card("HEADING").line(&title);
        deck
    }

    /// A keyword with its parameters, such as `STEP, NLGEOM`.
    pub fn card(&mut self, card: &str) -> &mut Self {
        self.line(&format!("*{card}"))
    }

    /// A remark.
    pub fn comment(&mut self, text: &str) -> &mut Self {
        self.line(&format!("** {text}"))
    }

    /// A data line as it is.
    pub fn line(&mut self, line: &str) -> &mut Self {
        self.text.push_str(line);
        self.text.push('\n');
        self
    }

    /// A data line of numbers.
    pub fn row(&mut self, numbers: &[f64]) -> &mut Self {
        let numbers: Vec<String> = numbers.iter().map(|x| number(*x)).collect();
        self.line(&numbers.join(", "))
    }

    /// Nodes at `points` [m], counted from `first`, as the set `name`.
    pub fn nodes(&mut self, name: &str, first: usize, points: &[Vec3]) -> &mut Self {
        self.card(&format!("NODE, NSET={name}"));
        for (i, point) in points.iter().enumerate() {
            let [x, y, z] = [point.x, point.y, point.z].map(|x| number(MM * x));
            let _ = writeln!(self.text, "{}, {x}, {y}, {z}", first + i);
        }
        self
    }

    /// Elements of `kind` with their labels as the set `name`; corners count from 0 at the node
    /// `first_node`.
    pub fn elements<const N: usize>(
        &mut self,
        kind: &str,
        name: &str,
        labels: impl IntoIterator<Item = usize>,
        first_node: usize,
        corners: &[[u32; N]],
    ) -> &mut Self {
        self.card(&format!("ELEMENT, TYPE={kind}, ELSET={name}"));
        for (label, corners) in labels.into_iter().zip(corners) {
            let _ = write!(self.text, "{label}");
            for corner in corners {
                let _ = write!(self.text, ", {}", first_node + *corner as usize);
            }
            self.text.push('\n');
        }
        self
    }

    /// The labels of a set of nodes or elements.
    pub fn labels(&mut self, labels: &[usize]) -> &mut Self {
        for labels in labels.chunks(LABELS) {
            let labels: Vec<String> = labels.iter().map(|label| label.to_string()).collect();
            self.line(&labels.join(", "));
        }
        self
    }

    /// The deck so far.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Writes the deck, atomically.
    pub fn write(&self, path: &Path) -> Result<(), WriteError> {
        write_atomic(path, |file| file.write_all(self.text.as_bytes()))
    }
}

/// Nine digits: positions to a hundredth of a micrometre. Fits the 20 characters of a field.
fn number(x: f64) -> String {
    format!("{x:.8e}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cards_have_the_form_that_readers_expect() {
        let mut deck = Deck::new("a\n*b");
        deck.comment("c")
            .nodes("N", 5, &[Vec3::new(0.001, -0.25, 0.0)])
            .elements("S3", "E", 7.., 5, &[[0, 1, 2]])
            .card("NSET, NSET=S")
            .labels(&(1..=12).collect::<Vec<_>>())
            .card("BOUNDARY")
            .line("S, 1, 3")
            .row(&[1.0, -9.81e3]);
        assert_eq!(
            deck.text(),
            "*HEADING\n a *b\n** c\n*NODE, NSET=N\n\
             5, 1.00000000e0, -2.50000000e2, 0.00000000e0\n\
             *ELEMENT, TYPE=S3, ELSET=E\n7, 5, 6, 7\n*NSET, NSET=S\n\
             1, 2, 3, 4, 5, 6, 7, 8, 9, 10\n11, 12\n\
             *BOUNDARY\nS, 1, 3\n1.00000000e0, -9.81000000e3\n"
        );
    }
}
