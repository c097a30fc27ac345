//! Scanned tools that are made usable.

use std::collections::HashMap;
use std::path::Path;
use std::time::Instant;

use drape_cloth::math::Vec3;
use drape_cloth::mesh::{TriMesh, border, read_mesh, write_stl};
use drape_cloth::tool::{GridConfig, Tool};
use drape_scan::{Changes, repair};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Radius of the dome [m].
const RADIUS: f64 = 0.1;
/// Tolerance of the decimation [m].
const TOLERANCE: f64 = 2e-4;

/// A square of `count` x `count` vertices and a side of 2 `half` [m], under what `height` makes of it.
fn sheet(count: u32, half: f64, height: impl Fn(f64, f64) -> f64) -> TriMesh {
    let along = |i: u32| half * (2.0 * f64::from(i) / f64::from(count - 1) - 1.0);
    let at = |n: u32| [along(n % count), along(n / count)];
    let at = (0..count * count)
        .map(at)
        .map(|[x, y]| Vec3::new(x, y, height(x, y)));
    let first = (0..count - 1).flat_map(|j| (0..count - 1).map(move |i| j * count + i));
    let triangles = first.flat_map(|a| {
        let [b, c, d] = [a + 1, a + count + 1, a + count];
        [[a, b, c], [a, c, d]]
    });
    TriMesh {
        vertices: at.collect(),
        triangles: triangles.collect(),
    }
}

/// The cap of a sphere about the origin.
fn dome(count: u32) -> TriMesh {
    sheet(count, 0.06, |x, y| (RADIUS * RADIUS - x * x - y * y).sqrt())
}

/// Drops the facets within `radius` [m] of places (x, y) [m].
fn punch(mesh: &mut TriMesh, radius: f64, places: &[[f64; 2]]) {
    let x = std::mem::take(&mut mesh.vertices);
    mesh.triangles.retain(|t| {
        let middle = t.iter().map(|&v| x[v as usize]).sum::<Vec3>() / 3.0;
        places
            .iter()
            .all(|p| (middle.x - p[0]).hypot(middle.y - p[1]) > radius)
    });
    mesh.vertices = x;
}

/// Adds another mesh moved by `offset` [m].
fn add(mesh: &mut TriMesh, other: &TriMesh, offset: Vec3) {
    let first = mesh.vertices.len() as u32;
    mesh.vertices
        .extend(other.vertices.iter().map(|x| x + offset));
    mesh.triangles
        .extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
}

/// Turns facets over and doubles some, as chance has it.
fn confuse(mesh: &mut TriMesh, share: f64) {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    for facet in &mut mesh.triangles {
        if random.random_bool(share) {
            facet.swap(0, 1);
        }
    }
    let doubled: Vec<[u32; 3]> = mesh
        .triangles
        .iter()
        .step_by(997)
        .map(|&[a, b, c]| [c, a, b])
        .collect();
    mesh.triangles.extend(doubled);
}

/// As a file has it, whose vertices are numbered anew.
fn reread(mesh: &TriMesh, folder: &Path) -> TriMesh {
    let path = folder.join("a.stl");
    write_stl(&path, mesh, "").unwrap();
    read_mesh(&path, 1e-3).unwrap().mesh
}

/// Repairs, and checks that the result is not changed again.
fn repaired(mesh: &TriMesh, tolerance: f64) -> (TriMesh, Changes) {
    let (once, changes) = repair(mesh, tolerance).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let read = reread(&once, folder.path());
    let (twice, none) = repair(&read, tolerance).unwrap();
    assert_eq!(
        none,
        Changes {
            holes_left: changes.holes_left,
            ..Changes::default()
        },
        "after {changes:?}"
    );
    assert_eq!(twice, read);
    assert_eq!(twice.triangles.len(), once.triangles.len());
    (once, changes)
}

fn greatest(mesh: &TriMesh, error: impl Fn(Vec3) -> f64) -> f64 {
    // Corners, and places in the middle of edges and facets.
    let places = |t: usize| {
        let [a, b, c] = mesh.corners(t);
        [
            a,
            (a + b) / 2.0,
            (b + c) / 2.0,
            (c + a) / 2.0,
            (a + b + c) / 3.0,
        ]
    };
    let all = (0..mesh.triangles.len()).flat_map(places);
    all.map(|x| error(x).abs()).fold(0.0, f64::max)
}

#[test]
fn scanned_dome_becomes_the_sphere_again() {
    let mut mesh = dome(151);
    punch(&mut mesh, 4e-3, &[[0.0, 0.0], [0.03, 0.02], [-0.04, 0.01]]);
    let facets = mesh.triangles.len();
    let stray = sheet(5, 2e-3, |_, _| 0.0);
    add(&mut mesh, &stray, Vec3::new(0.1, 0.1, 0.2));
    add(&mut mesh, &stray, Vec3::new(0.0, 0.0, 0.05));
    confuse(&mut mesh, 0.4);
    let (tool, changes) = repaired(&mesh, TOLERANCE);
    assert_eq!((changes.stray_parts, changes.stray_facets), (2, 64));
    assert_eq!((changes.closed_holes, changes.holes_left), (3, 0));
    assert!(changes.longest_hole_mm > 25.0 && changes.longest_hole_mm < 40.0);
    assert!(
        changes.doubled_facets > 40 && changes.turned_facets > facets / 3,
        "{changes:?}"
    );
    assert!(
        tool.triangles.len() < facets / 8,
        "{}",
        tool.triangles.len()
    );
    assert!(
        changes.mean_mm < changes.max_mm && changes.max_mm <= 1e3 * TOLERANCE,
        "{changes:?}"
    );
    let off = greatest(&tool, |x| x.norm() - RADIUS);
    assert!(off < TOLERANCE, "{off}");
    // The border of the sheet is where it was.
    let edges = border(&tool).unwrap();
    assert_eq!(edges.len(), 4 * 150);
    let tool = Tool::from_mesh(tool, &GridConfig::default()).unwrap();
    assert!(tool.surface.is_open() && !tool.flipped);
}

#[test]
fn plate_stays_open_and_keeps_its_border_only() {
    let mut mesh = sheet(41, 0.1, |_, _| 0.0);
    punch(&mut mesh, 0.02, &[[0.05, 0.05], [-0.05, 0.05]]);
    mesh.flip();
    let facets = mesh.triangles.len();
    let (plate, changes) = repaired(&mesh, TOLERANCE);
    assert_eq!((changes.closed_holes, changes.turned_facets), (2, facets));
    assert!(changes.max_mm < 1e-5, "{changes:?}");
    assert_eq!(border(&plate).unwrap().len(), 160);
    assert!((plate.area_vector() - Vec3::z() * 0.04).norm() < 1e-9);
    assert!(
        (plate.area() - 0.04).abs() < 1e-9,
        "no facet lies on another"
    );
    // No vertex but those of the border is needed, and few are left.
    assert!(plate.vertices.len() < 160 + 40, "{}", plate.vertices.len());
    // Without tolerance all vertices stay.
    let (fine, changes) = repaired(&mesh, 0.0);
    assert_eq!(changes.decimated_facets, 0);
    assert!(fine.triangles.len() > facets);
}

/// The sphere of a subdivided octahedron.
fn sphere(splits: u32) -> TriMesh {
    let axes = [
        [1, 0, 0],
        [0, 1, 0],
        [-1, 0, 0],
        [0, -1, 0],
        [0, 0, 1],
        [0, 0, -1],
    ];
    let mut x: Vec<Vec3> = axes
        .iter()
        .map(|a| Vec3::from(a.map(f64::from)) * RADIUS)
        .collect();
    let mut facets: Vec<[u32; 3]> = (0..4)
        .flat_map(|k| [[k, (k + 1) % 4, 4], [(k + 1) % 4, k, 5]])
        .collect();
    for _ in 0..splits {
        let mut middles = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                x.push((x[a as usize] + x[b as usize]).normalize() * RADIUS);
                x.len() as u32 - 1
            })
        };
        facets = (facets.into_iter())
            .flat_map(|[a, b, c]| {
                let [p, q, r] = [middle(a, b), middle(b, c), middle(c, a)];
                [[a, p, r], [p, b, q], [r, q, c], [p, q, r]]
            })
            .collect();
    }
    TriMesh {
        vertices: x,
        triangles: facets,
    }
}

#[test]
fn bodies_are_closed_and_face_outwards() {
    let mut mesh = sphere(6);
    punch(&mut mesh, 5e-3, &[[0.02, 0.02]]);
    mesh.flip();
    // A second body, which touches nothing, and a fin of one facet on an edge of two others.
    add(&mut mesh, &sphere(5), Vec3::x() * 0.25);
    let [a, b, _] = mesh.triangles[100];
    mesh.vertices.push(Vec3::zeros());
    mesh.triangles.push([a, b, mesh.vertices.len() as u32 - 1]);
    let (bodies, changes) = repaired(&mesh, 2.0 * TOLERANCE);
    // Above and below.
    assert_eq!((changes.closed_holes, changes.stray_parts), (2, 1));
    assert_eq!(border(&bodies), Ok(Vec::new()));
    let exact = 8.0 / 3.0 * std::f64::consts::PI * RADIUS.powi(3);
    assert!((bodies.signed_volume() / exact - 1.0).abs() < 0.01);
    assert!(
        bodies.triangles.len() < 20_000,
        "{}",
        bodies.triangles.len()
    );
    assert!(Tool::from_mesh(bodies, &GridConfig::default()).is_ok());
}

#[test]
fn sharp_edges_and_corners_stay() {
    // A block of 20 cells a side on every face, without its bottom.
    let mut block = sheet(21, 0.05, |_, _| 0.1);
    let side = sheet(21, 0.05, |_, _| 0.05);
    for quarter in 0..4 {
        let mut face = side.clone();
        for v in &mut face.vertices {
            let mut at = Vec3::new(v.z, v.x, v.y + 0.05);
            for _ in 0..quarter {
                at = Vec3::new(-at.y, at.x, at.z);
            }
            *v = at;
        }
        add(&mut block, &face, Vec3::zeros());
    }
    let folder = tempfile::tempdir().unwrap();
    let welded = reread(&block, folder.path());
    let (few, changes) = repaired(&welded, TOLERANCE);
    assert!(changes.max_mm < 1e-4, "{changes:?}");
    assert_eq!(border(&few).unwrap().len(), 80);
    assert!((few.area() - 0.05).abs() < 1e-8);
    assert!(few.triangles.len() < 200, "{}", few.triangles.len());
}

#[test]
fn moebius_strip_is_refused() {
    let mut mesh = TriMesh::default();
    let count = 40;
    for k in 0..count {
        let (sin, cos) = (std::f64::consts::TAU * f64::from(k) / f64::from(count)).sin_cos();
        let (half_sin, half_cos) =
            (std::f64::consts::PI * f64::from(k) / f64::from(count)).sin_cos();
        for side in [-0.02, 0.02] {
            let r = 0.1 + side * half_cos;
            mesh.vertices
                .push(Vec3::new(r * cos, r * sin, side * half_sin));
        }
        let [a, b] = [2 * k, 2 * k + 1].map(|v| v as u32);
        // Where the strip comes round, its sides are exchanged.
        let [c, d] = if k + 1 < count {
            [a + 2, a + 3]
        } else {
            [1, 0]
        };
        mesh.triangles.extend([[a, c, b], [b, c, d]]);
    }
    let error = repair(&mesh, TOLERANCE).unwrap_err().to_string();
    assert!(
        error.starts_with("its triangles disagree on which side is out"),
        "{error}"
    );
}

/// What a hole needs is found in the same way however long it is: the disc about the middle of a fine sheet.
#[test]
fn long_holes_are_closed_without_folds() {
    let mut mesh = sheet(161, 0.1, |_, _| 0.0);
    punch(&mut mesh, 0.085, &[[0.0, 0.0]]);
    let (plate, changes) = repaired(&mesh, 0.0);
    assert_eq!(changes.closed_holes, 1);
    assert_eq!(border(&plate).unwrap().len(), 640);
    assert!((plate.area() - 0.04).abs() < 1e-8, "{}", plate.area());
}

/// Facets without rhyme or reason, from a bumpy sheet to any three corners of few.
#[test]
fn any_facets_are_repaired_once_or_refused() {
    let mut refused = 0;
    for seed in 0..80 {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut mesh = sheet(4 + seed as u32 % 9, 0.05, |_, _| 0.0);
        for x in &mut mesh.vertices {
            *x = x.map(|x| x + 3e-3 * random.random::<f64>());
        }
        let count = mesh.vertices.len() as u32;
        for _ in 0..seed % 13 {
            let [a, b, c] = [0; 3].map(|_| random.random_range(0..count));
            if a != b && b != c && c != a {
                mesh.triangles.push([a, b, c]);
            }
            let facet = random.random_range(0..mesh.triangles.len());
            mesh.triangles.swap_remove(facet);
        }
        match repair(&mesh, TOLERANCE) {
            Ok(_) => drop(repaired(&mesh, 10.0 * TOLERANCE)),
            Err(_) => refused += 1,
        }
    }
    assert!(refused < 30, "{refused}");
}

/// Prints what a scan of a million triangles takes: `cargo test --release --test repair -- --ignored --nocapture`.
#[test]
#[ignore = "a measurement of a minute"]
fn million() {
    println!("| Noise | Tolerance | Triangles | Left | Time | Mean | Greatest | Off the sphere |");
    println!("|---|---|---|---|---|---|---|---|");
    for (noise_mm, tolerance_mm) in [
        (0.0, 0.2),
        (0.0, 0.05),
        (0.02, 0.2),
        (0.05, 0.2),
        (0.05, 0.5),
    ] {
        let mut mesh = dome(709);
        let mut random = ChaCha8Rng::seed_from_u64(1);
        for x in &mut mesh.vertices {
            *x = x.map(|x| x + 1e-3 * noise_mm * gauss(&mut random));
        }
        punch(
            &mut mesh,
            2e-3,
            &[
                [0.0, 0.0],
                [0.03, 0.02],
                [-0.04, 0.01],
                [0.01, -0.04],
                [-0.02, -0.03],
            ],
        );
        add(
            &mut mesh,
            &sheet(21, 3e-3, |_, _| 0.0),
            Vec3::new(0.1, 0.1, 0.2),
        );
        confuse(&mut mesh, 0.1);
        let start = Instant::now();
        let (tool, changes) = repair(&mesh, 1e-3 * tolerance_mm).unwrap();
        let seconds = start.elapsed().as_secs_f64();
        println!(
            "| {noise_mm} mm | {tolerance_mm} mm | {} | {} | {seconds:.1} s | {:.3} mm | {:.3} mm | {:.3} mm |",
            mesh.triangles.len(),
            tool.triangles.len(),
            changes.mean_mm,
            changes.max_mm,
            1e3 * greatest(&tool, |x| x.norm() - RADIUS)
        );
    }
}

/// A normal number, of twelve uniform ones.
fn gauss(random: &mut ChaCha8Rng) -> f64 {
    (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}

/// A box between two corners [m], facing outwards or inwards.
fn block(low: [f64; 3], high: [f64; 3], inwards: bool) -> TriMesh {
    let corner = |n: usize| Vec3::from_fn(|k, _| if n >> k & 1 == 1 { high[k] } else { low[k] });
    let mut triangles = Vec::new();
    for [a, b, c, d] in [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ] {
        triangles.extend([[a, b, c], [a, c, d]]);
    }
    if inwards {
        triangles.iter_mut().for_each(|t| t.swap(0, 1));
    }
    TriMesh {
        vertices: (0..8).map(corner).collect(),
        triangles,
    }
}

/// Boxes that share a wall are one body without it, and a cavity stays one; a sheet that has all its facets twice, once for
/// each side, stays a sheet.
#[test]
fn sound_bodies_stay_what_they_are() {
    let mut both = block([0.0; 3], [0.1, 0.1, 0.1], false);
    add(
        &mut both,
        &block([0.1, 0.0, 0.0], [0.2, 0.1, 0.1], false),
        Vec3::zeros(),
    );
    let mut hollow = block([0.0; 3], [0.1; 3], false);
    add(
        &mut hollow,
        &block([0.02; 3], [0.08; 3], true),
        Vec3::zeros(),
    );
    let folder = tempfile::tempdir().unwrap();
    for (mesh, volume, facets) in [(both, 2e-3, 20), (hollow, 1e-3 - 2.16e-4, 24)] {
        let (repaired, changes) = repair(&reread(&mesh, folder.path()), 0.0).unwrap();
        assert!(
            (repaired.signed_volume() - volume).abs() < 1e-9,
            "{changes:?}"
        );
        assert_eq!(repaired.triangles.len(), facets);
        assert_eq!(changes.turned_facets, 0);
        assert!(border(&repaired).unwrap().is_empty());
    }
    let mut sheet = sheet(5, 0.1, |_, _| 0.0);
    let turned: Vec<[u32; 3]> = sheet.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
    sheet.triangles.extend(turned);
    let (repaired, changes) = repair(&sheet, 0.0).unwrap();
    assert_eq!((repaired.triangles.len(), changes.doubled_facets), (32, 32));
}
