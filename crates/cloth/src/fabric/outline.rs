use std::path::Path;

use crate::file::{ReadError, plain, read_bytes};

/// Coordinates of an outline are at most this large [mm].
const MAX_MM: f64 = 1e5;

/// Most points: each edge may have to be held against every other.
const MOST_POINTS: usize = 32_768;

/// A point of the plane.
pub(super) type Point = [f64; 2];

/// Closed loops that bound a blank: the outer one first, then its holes. None crosses or
/// touches another or itself.
///
/// The file has one point a line, x and y [mm], apart by a comma, semicolon or white space.
/// Blank lines separate loops, `#` begins a comment. Loops may run either way round, and may
/// repeat their first point at the end.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    /// [m]
    loops: Vec<Vec<Point>>,
}

/// Points of a loop as they were read, and the line of each.
type Loop = (Vec<Point>, Vec<usize>);

/// An edge of a loop, which loop that is, and the number of its first point there.
type Edge = ([Point; 2], usize, usize);

impl Outline {
    /// A rectangle of `size` [m] around the origin.
    pub fn rectangle(size: [f64; 2]) -> Self {
        let [x, y] = size.map(|s| 0.5 * s);
        Self {
            loops: vec![vec![[-x, -y], [x, -y], [x, y], [-x, y]]],
        }
    }

    /// Reads an outline; the error names file, line, found and expected.
    pub fn read(path: &Path) -> Result<Self, ReadError> {
        let bytes = read_bytes(path, 16)?;
        let text = plain(&bytes).map_err(|fault| ReadError::fault(path, fault))?;
        // What is not text is quoted as the line that cannot be understood.
        Self::parse(&String::from_utf8_lossy(&text)).map_err(|(line, fault)| ReadError::Fault {
            path: path.into(),
            place: format!(":{line}"),
            fault,
        })
    }

    /// Reads an outline from the text of its file; the error is the line that is wrong, and why.
    pub(super) fn parse(text: &str) -> Result<Self, (usize, String)> {
        let lines: Vec<(usize, &str)> = (1..).zip(text.lines()).collect();
        let read = |&(number, line): &(usize, &str)| {
            let content = line.split('#').next().unwrap_or_default().trim();
            let point = point(content).ok_or_else(|| {
                let found: String = content.chars().take(40).collect();
                let expected = "two numbers within +-100000: x, y [mm]";
                (number, format!("found {found:?}, expected {expected}"))
            });
            (!content.is_empty()).then(|| Ok((point?, number)))
        };
        let parts = lines.split(|(_, line)| line.trim().is_empty());
        let loops = parts.map(|part| part.iter().filter_map(read).collect());
        let mut loops: Vec<Loop> = loops.collect::<Result<_, _>>()?;
        loops.retain(|(points, _)| !points.is_empty());
        for (points, lines) in &mut loops {
            if points.len() > 1 && points.first() == points.last() {
                points.pop();
            }
            if points.len() < 3 {
                let count = points.len();
                let fault = format!("loop of {count} points, expected at least 3");
                return Err((lines[0], fault));
            }
            if let Some(i) = points.windows(2).position(|pair| pair[0] == pair[1]) {
                let line = lines[i];
                let fault = format!("point is that of line {line} again, expected another");
                return Err((lines[i + 1], fault));
            }
        }
        let counts = loops.iter().map(|(points, _)| points.len());
        let found: usize = counts.sum();
        if found > MOST_POINTS {
            let fault = format!("{found} points, expected at most {MOST_POINTS}");
            return Err((1, fault));
        }
        check_crossings(&loops)?;
        let Some(((outer, _), holes)) = loops.split_first() else {
            return Err((1, "no points, expected a closed loop of at least 3".into()));
        };
        for (hole, lines) in holes {
            if !encloses(outer, hole[0]) {
                let fault = "hole lies outside the outer loop, expected it inside";
                return Err((lines[0], fault.into()));
            }
            let is_around = |(other, _): &&Loop| other != hole && encloses(other, hole[0]);
            if let Some((_, around)) = holes.iter().find(is_around) {
                let line = around[0];
                let fault = format!("hole lies in the hole of line {line}, expected it apart");
                return Err((lines[0], fault));
            }
        }
        let metres = |(points, _): &Loop| points.iter().map(|p| p.map(|c| 1e-3 * c)).collect();
        let loops = loops.iter().map(metres).collect();
        Ok(Self { loops })
    }

    /// Every loop with its points mapped by `to`.
    pub(super) fn mapped(&self, to: impl Fn(Point) -> Point) -> Vec<Vec<Point>> {
        let map = |one: &Vec<Point>| one.iter().map(|&p| to(p)).collect();
        self.loops.iter().map(map).collect()
    }
}

fn point(content: &str) -> Option<Point> {
    let separator = |c: char| c == ',' || c == ';' || c.is_whitespace();
    let mut fields = content.split(separator).filter(|field| !field.is_empty());
    let mut number = || {
        let number: f64 = fields.next()?.parse().ok()?;
        (number.abs() <= MAX_MM).then_some(number)
    };
    let point = [number()?, number()?];
    fields.next().is_none().then_some(point)
}

/// Refuses edges that meet others than at the point which they share with their neighbours.
/// Edges are swept in the order of their smallest x.
fn check_crossings(loops: &[Loop]) -> Result<(), (usize, String)> {
    let mut edges: Vec<Edge> = Vec::new();
    for (from, (points, _)) in loops.iter().enumerate() {
        let sides = sides(points).enumerate();
        edges.extend(sides.map(|(index, ends)| (ends, from, index)));
    }
    let range = |(ends, ..): &Edge, k: usize| {
        let [a, b] = ends.map(|p| p[k]);
        [a.min(b), a.max(b)]
    };
    edges.sort_by(|a, b| range(a, 0)[0].total_cmp(&range(b, 0)[0]));
    for (i, a) in edges.iter().enumerate() {
        let near = edges[i + 1..]
            .iter()
            .take_while(|b| range(b, 0)[0] <= range(a, 0)[1])
            .filter(|b| range(b, 1)[0] <= range(a, 1)[1] && range(a, 1)[0] <= range(b, 1)[1]);
        for b in near {
            if meet(a, b, loops) {
                let [a, b] = [a, b].map(|&(_, from, index)| loops[from].1[index]);
                let first = a.min(b);
                let expected = "expected loops that do not cross";
                let fault =
                    format!("edge from this point meets that from line {first}, {expected}");
                return Err((a.max(b), fault));
            }
        }
    }
    Ok(())
}

fn meet(a: &Edge, b: &Edge, loops: &[Loop]) -> bool {
    for ((first, from, index), (second, other, next)) in [(a, b), (b, a)] {
        if from == other && (index + 1) % loops[*from].0.len() == *next {
            // Neighbours share a point, and no more unless the second runs back.
            let ([p, q], [_, r]) = (*first, *second);
            let forward = (q[0] - p[0]) * (r[0] - q[0]) + (q[1] - p[1]) * (r[1] - q[1]);
            return turn(p, q, r) == 0.0 && forward < 0.0;
        }
    }
    let turns = |([p, q], ..): &Edge, (of, ..): &Edge| of.map(|r| turn(*p, *q, r));
    let apart = |[s, t]: [f64; 2]| (s > 0.0 && t > 0.0) || (s < 0.0 && t < 0.0);
    // On one line they meet because their ranges do.
    !apart(turns(a, b)) && !apart(turns(b, a))
}

/// Twice the area of the triangle p, q, r: positive if it turns to the left.
fn turn(p: Point, q: Point, r: Point) -> f64 {
    (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
}

/// Sides of a loop, from each of its points to the next.
pub(super) fn sides(points: &[Point]) -> impl Iterator<Item = [Point; 2]> + '_ {
    let next = points.iter().cycle().skip(1);
    points.iter().zip(next).map(|(&a, &b)| [a, b])
}

/// Where a side crosses the line at height `y`, if it does: its x.
pub(super) fn crossing([a, b]: [Point; 2], y: f64) -> Option<f64> {
    ((a[1] <= y) != (b[1] <= y)).then(|| a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
}

/// Whether `p` lies inside a loop, by the parity of crossings.
fn encloses(points: &[Point], p: Point) -> bool {
    let crossings = sides(points).filter_map(|side| crossing(side, p[1]));
    crossings.filter(|&x| p[0] < x).count() % 2 == 1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fault(text: &str) -> (usize, String) {
        Outline::parse(text).unwrap_err()
    }

    #[test]
    fn loops_comments_and_separators_are_read() {
        let text = "# plate\n0, 0\n100 0\n100;50 # corner\n0,50\n0,0\n\n\n10,10\n\
                    20\t10\n# still the hole\n20,20\n\n";
        let outline = Outline::parse(text).unwrap();
        let corners = [[0.0, 0.0], [0.1, 0.0], [0.1, 0.05], [0.0, 0.05]];
        let hole = [[0.01, 0.01], [0.02, 0.01], [0.02, 0.02]];
        assert_eq!(outline.loops, [&corners[..], &hole[..]]);
        // Loops may run either way round.
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let returns = text.replace('\n', "\r");
        for bytes in [
            format!("\u{feff}{text}"),
            returns.clone(),
            format!("\u{feff}{returns}"),
        ] {
            std::fs::write(&path, bytes).unwrap();
            assert_eq!(Outline::read(&path).unwrap(), outline);
        }
        let turned = Outline::parse("0,0\n0,50\n100,50\n100,0\n\n10,10\n20,10\n20,20").unwrap();
        assert_eq!(turned.loops[1], hole);
    }

    #[test]
    fn faults_are_located() {
        let square = "0,0\n9,0\n9,9\n0,9\n";
        for (text, line, words) in [
            ("", 1, "no points"),
            ("# nothing\n\n", 1, "no points"),
            ("0,0\n1,0\n", 1, "loop of 2 points, expected at least 3"),
            ("0,0\n1,0\n0,0", 1, "loop of 2 points"),
            (
                "0,0\n1,nan\n1,1",
                2,
                "found \"1,nan\", expected two numbers",
            ),
            ("0,0\n1,inf\n1,1", 2, "found \"1,inf\""),
            ("0,0\n1\n1,1", 2, "found \"1\""),
            ("0,0\n1,2,3\n1,1", 2, "found \"1,2,3\""),
            ("0,0\n1,0\n1,0\n1,1", 3, "point is that of line 2 again"),
            ("0,0\n9,9\n9,0\n0,9", 3, "meets that from line 1"),
            // A spike, and a loop without area.
            ("0,0\n9,0\n9,9\n9,3\n0,3", 4, "meets that from line 2"),
            ("0,0\n9,0\n4,0", 3, "meets that from line 1"),
        ] {
            let (found, message) = fault(text);
            assert!(
                found == line && message.contains(words),
                "{found}: {message}"
            );
        }
        for (hole, line, words) in [
            ("20,20\n21,20\n20,21", 6, "outside the outer loop"),
            ("5,5\n12,5\n5,6", 6, "meets that from line 2"),
            (
                "2,2\n5,2\n2,5\n\n2.5,2.5\n3,2.5\n2.5,3",
                10,
                "hole of line 6",
            ),
            ("2,2\n5,2\n2,5\n\n1,1\n8,1\n1,8", 6, "hole of line 10"),
            // Touching the border from within.
            ("0,5\n3,5\n3,6", 6, "meets that from line 4"),
        ] {
            let (found, message) = fault(&format!("{square}\n{hole}"));
            assert!(
                found == line && message.contains(words),
                "{found}: {message}"
            );
        }
    }
}
