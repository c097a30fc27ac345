use std::f64::consts::PI;

use super::*;

/// Area between the outer loop of an outline and its holes [m^2].
fn enclosed(outline: &Outline) -> f64 {
    let area = |points: &Vec<[f64; 2]>| {
        let twice = sides(points).map(|[a, b]| a[0] * b[1] - a[1] * b[0]);
        0.5 * twice.sum::<f64>().abs()
    };
    let areas: Vec<f64> = outline.mapped(|p| p).iter().map(area).collect();
    2.0 * areas[0] - areas.iter().sum::<f64>()
}

/// A disc of 100 mm across.
fn disc() -> Outline {
    ring(&[(50.0, 96)])
}

/// Circles of given radii [mm] and numbers of points, the outer one first.
fn ring(circles: &[(f64, usize)]) -> Outline {
    let mut text = String::new();
    for &(radius, count) in circles {
        for i in 0..count {
            let (sin, cos) = (2.0 * PI * i as f64 / count as f64).sin_cos();
            text += &format!("{},{}\n", radius * cos, radius * sin);
        }
        text += "\n";
    }
    Outline::parse(&text).unwrap()
}

fn polygon(points: &[[f64; 2]]) -> Outline {
    let lines: Vec<String> = points.iter().map(|[x, y]| format!("{x},{y}")).collect();
    Outline::parse(&lines.join("\n")).unwrap()
}

/// All triangles, whole cells' included.
fn triangles(cells: &Cells) -> Vec<[Point; 3]> {
    let columns = cells.grid.columns;
    let at = |row, column| cells.grid.vertex_at(row, column).unwrap();
    let mut all = Vec::new();
    for (index, cell) in cells.cells.iter().enumerate() {
        let (row, column) = (index / (columns - 1), index % (columns - 1));
        match cell {
            Cell::Whole => {
                let [a, b] = [at(row, column), at(row, column + 1)];
                let [c, d] = [at(row + 1, column), at(row + 1, column + 1)];
                all.extend([[a, b, d], [a, d, c]]);
            }
            Cell::Half(half) => all.push(*half),
            Cell::Cut(cut) => all.extend(cut),
        }
    }
    all.iter()
        .map(|t| t.map(|v| cells.rest[v as usize]))
        .collect()
}

fn area(cells: &Cells) -> f64 {
    let size = |[a, b, c]: [Point; 3]| {
        0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
    };
    triangles(cells).into_iter().map(size).sum()
}

/// Every shape at many angles: quality holds, the area is that of the outline but for the
/// segments between border vertices, and no vertex lies outside.
#[test]
fn triangles_are_sound_and_fill_the_outline() {
    let shapes = [
        ("disc", disc(), 0.012),
        ("ring", ring(&[(50.0, 96), (20.0, 48)]), 0.012),
        ("square", Outline::rectangle([0.1, 0.1]), 0.012),
        (
            "arrow",
            polygon(&[[-50.0, -40.0], [50.0, 0.0], [-50.0, 40.0], [-20.0, 0.0]]),
            0.03,
        ),
    ];
    for (name, outline, tolerance) in &shapes {
        let mut worst: f64 = 0.0;
        for angle in (0..=90).step_by(5) {
            let cells = Cells::new(outline, [0.005; 2], f64::from(angle).to_radians()).unwrap();
            let least = triangles(&cells)
                .into_iter()
                .map(quality)
                .fold(1.0, f64::min);
            assert!(least >= MIN_QUALITY - 1e-9, "{name} at {angle}: {least}");
            worst = worst.max((area(&cells) / enclosed(outline) - 1.0).abs());
        }
        assert!(worst < *tolerance, "{name}: area off by {worst}");
    }
}

/// A rectangle along the grid is what it always was.
#[test]
fn rectangle_along_its_yarns_has_whole_cells_only() {
    let size = [0.1, 0.08];
    let cut = Cells::new(&Outline::rectangle(size), [0.005; 2], 0.0).unwrap();
    assert!(cut.cells.iter().all(|cell| *cell == Cell::Whole));
    let plain = Cells::rectangle(size, [21, 17], [0.005; 2]);
    assert_eq!(cut.rest.len(), plain.rest.len());
    for (found, expected) in cut.rest.iter().zip(&plain.rest) {
        assert!((0..2).all(|k| (found[k] - expected[k]).abs() < 1e-12));
    }
}

/// The border lies on the outline: a disc's on its circle.
#[test]
fn border_of_a_disc_lies_on_its_circle() {
    let mut short = 0;
    let mut count = 0;
    for angle in 0..45 {
        let cells = Cells::new(&disc(), [0.005; 2], f64::from(angle).to_radians()).unwrap();
        let neighbors = |v: u32| cells.grid.window(v, [1, 1]).count();
        for v in (0..cells.rest.len() as u32).filter(|&v| neighbors(v) < 7) {
            let [x, y] = cells.rest[v as usize];
            let radius = x.hypot(y);
            assert!(radius < 0.05 + 1e-9);
            count += 1;
            short += usize::from(radius < 0.049_9);
        }
    }
    assert!(
        short * 20 < count,
        "{short} of {count} vertices are short of the circle"
    );
}

#[test]
fn coarse_cells_are_refused() {
    let fault = |outline: &Outline, cell: f64| {
        Cells::new(outline, [1e-3 * cell; 2], 0.3)
            .map(|_| ())
            .unwrap_err()
    };
    // A neck 2 mm wide between two squares.
    let neck = polygon(&[
        [0.0, 0.0],
        [40.0, 0.0],
        [40.0, 19.0],
        [80.0, 19.0],
        [80.0, 0.0],
        [120.0, 0.0],
        [120.0, 40.0],
        [80.0, 40.0],
        [80.0, 21.0],
        [40.0, 21.0],
        [40.0, 40.0],
        [0.0, 40.0],
    ]);
    assert_eq!(fault(&neck, 8.0), CutFault::Parts(2));
    Cells::new(&neck, [0.001; 2], 0.3).unwrap();
    let small = ring(&[(50.0, 48), (2.0, 12)]);
    let lost = CutFault::Loops {
        found: 1,
        expected: 2,
    };
    assert_eq!(fault(&small, 12.0), lost);
    assert_eq!(fault(&disc(), 400.0), CutFault::Empty);
    let CutFault::Fine(count) = fault(&disc(), 0.01) else {
        panic!("ten thousand vertices along a side");
    };
    assert!(count.abs_diff(10_000) < 10);
}
