//! Files that are damaged, hostile or unlucky are refused in a line, or used whole. For hours by hand:
//! `DRAPE_DAMAGED=1000000 DRAPE_SEED=2 cargo test --release --test readers`.

mod damage;

use std::fs;
use std::path::Path;
use std::sync::{Mutex, MutexGuard};

use damage::{dialects, folder, survives};
use drape_cloth::fabric::{BlankConfig, Lamina, Material};
use drape_cloth::file::in_words;
use drape_cloth::mesh::{TriMesh, read_mesh};
use drape_cloth::scene::{Scene, SceneConfig};
use drape_cloth::tool::{GridConfig, Shape, Tool};

/// Memory is counted for the whole process: one at a time.
fn alone() -> MutexGuard<'static, ()> {
    static LOCK: Mutex<()> = Mutex::new(());
    LOCK.lock().unwrap_or_else(|error| error.into_inner())
}

/// An error and its causes, as the command line puts them.
fn line(error: impl std::error::Error) -> String {
    let mut line = error.to_string();
    let mut source = error.source();
    while let Some(error) = source {
        line += &format!(": {error}");
        source = error.source();
    }
    line
}

/// A tool whose grid is coarse, whatever its size.
fn tool(mesh: TriMesh) -> Result<(), String> {
    let (low, high) = mesh.bounds();
    let spacing_mm = (1e2 * (high - low).max()).max(1e-6);
    let grid = GridConfig {
        spacing_mm: Some(spacing_mm),
        margin_mm: spacing_mm,
    };
    let tool = Tool::from_mesh(mesh, &grid).map_err(line)?;
    assert!(tool.distance([0.0, 0.0, 0.1]).0.is_finite());
    Ok(())
}

const ASCII: &str = "solid a\n facet normal 0 0 nan\n  outer loop\n   vertex 0 0 0\n   \
    vertex 0 10 0\n   vertex 1e1 0 0\n  endloop\n endfacet\n facet normal 0 0 1\n  outer loop\n   \
    vertex 0 0 0\n   vertex 10 0 0\n   vertex 0 0 10\n  endloop\n endfacet\nendsolid a\n";

fn binary() -> Vec<u8> {
    let corners = [
        [[0, 0, 0], [0, 10, 0], [10, 0, 0]],
        [[0, 0, 0], [10, 0, 0], [0, 0, 10]],
    ];
    let facet = |corners: &[[i32; 3]; 3]| {
        let numbers = [0; 3].into_iter().chain(corners.iter().flatten().copied());
        let floats = numbers.flat_map(|x| (x as f32).to_le_bytes());
        floats.chain([0; 2]).collect::<Vec<u8>>()
    };
    let facets: Vec<u8> = corners.iter().flat_map(facet).collect();
    [&[b' '; 80][..], &2u32.to_le_bytes(), &facets].concat()
}

#[test]
fn stl() {
    let _alone = alone();
    let mut corpus = vec![binary(), ASCII.into(), ASCII.repeat(2).into()];
    // Findings: a single coordinate beyond belief, and all of them too small to square.
    corpus.push(ASCII.replace("1e1", "1e10").into());
    corpus.push(
        ASCII
            .replace("1e1", "1e-200")
            .replace("10", "1e-200")
            .into(),
    );
    corpus.extend(dialects(ASCII));
    corpus.push(
        ASCII
            .replace("\n  ", " ")
            .replace("\n endfacet", " endfacet")
            .into(),
    );
    corpus.push(ASCII.replace('\n', " ").into());
    survives("a.stl", &corpus, 3000, |path| {
        tool(read_mesh(path, 1e-3).map_err(line)?.mesh)
    });
}

#[test]
fn ply() {
    let _alone = alone();
    let head = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty \
             float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
        )
    };
    let text = head("ascii") + "0 0 0\n10 0 0\n10 10 0\n0 10 0\n3 0 1 2\n3 0 2 3\n";
    let corners = [
        [0f32, 0.0, 0.0],
        [10.0, 0.0, 0.0],
        [10.0, 10.0, 0.0],
        [0.0, 10.0, 0.0],
    ];
    let mut bytes = head("binary_little_endian").into_bytes();
    bytes.extend(corners.iter().flatten().flat_map(|c| c.to_le_bytes()));
    for face in [[0i32, 1, 2], [0, 2, 3]] {
        bytes.push(3);
        bytes.extend(face.iter().flat_map(|v| v.to_le_bytes()));
    }
    // Whatever a scanner adds, in every type, the other byte order and faces of four corners.
    let rich = |format: &str| {
        format!(
            "ply\r\nformat {format} 1.0\ncomment by hand\nobj_info 1\nelement vertex 4\nproperty short x\n\
             property double y\nproperty int z\nproperty uchar red\nelement edge 1\nproperty char a\n\
             element face 1\nproperty list ushort uint vertex_index\nend_header\n"
        )
    };
    let rich_text = rich("ascii") + "0 0 0 9\n10 0 0 9\n10 10 0 9\n0 10 0 9\n-7\n4 0 1 2 3\n";
    let mut big = rich("binary_big_endian").into_bytes();
    for [x, y] in [[0i16, 0], [10, 0], [10, 10], [0, 10]] {
        big.extend(x.to_be_bytes());
        big.extend(f64::from(y).to_be_bytes());
        big.extend([0, 0, 0, 0, 9]);
    }
    big.extend([0xf9, 0, 4]);
    big.extend([0u32, 1, 2, 3].iter().flat_map(|v| v.to_be_bytes()));
    // Strips before their vertices, and faces of many corners: concave, cut open to a hole, crossed.
    let strips = "ply\nformat ascii 1.0\nelement tristrips 1\nproperty list int int vertex_indices\n\
        element vertex 4\nproperty float x\nproperty float y\nproperty float z\nend_header\n\
        7 0 1 3 -1 1 2 3\n0 0 0\n10 0 0\n10 10 0\n0 10 0\n";
    let polygons = "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\n\
        property float z\nelement face 3\nproperty list uchar int vertex_indices\nend_header\n\
        0 0 0\n40 0 0\n40 40 0\n0 40 0\n10 10 0\n10 30 0\n30 30 0\n30 10 0\n10 0 1 2 3 0 4 5 6 7 4\n\
        5 4 5 6 0 1\n4 0 2 1 3\n";
    let cut = polygons.replace("\n4 0 2 1 3", "\n4 4 7 6 5");
    let mut corpus = vec![text.clone().into(), bytes, rich_text.into(), big];
    corpus.extend([strips, polygons, &cut].map(Into::into));
    corpus.extend(dialects(&text).into_iter().chain(dialects(strips)));
    survives("a.ply", &corpus, 3000, |path| {
        tool(read_mesh(path, 1e-3).map_err(line)?.mesh)
    });
}

#[test]
fn outlines() {
    let _alone = alone();
    let plate = include_bytes!("../../../../assets/outlines/plate-with-hole.csv");
    let square = "0,0\n400;0 # corner\n400 400\n0,400\n0,0\n\n100,100\n300\t100\n300,300\n";
    let mut corpus = vec![plate.to_vec(), square.into()];
    corpus.extend(dialects(square));
    survives("a.csv", &corpus, 2000, |path| {
        let config = BlankConfig {
            outline: Some(path.into()),
            cell_mm: Some(50.0),
            ..BlankConfig::default()
        };
        let lamina = Lamina::new(&config, Material::interglas_92125()).map_err(line)?;
        assert!(lamina.area() > 0.0 && lamina.mass.iter().all(|m| *m > 0.0));
        Ok(())
    });
}

/// Sets a scene up with a fall of one frame, on few vertices and a coarse grid: what is asked is
/// that values of any size are simulated or refused, not for how long.
fn set_up(mut config: SceneConfig) -> Result<(), String> {
    config.check().map_err(line)?;
    let is_small = config.blank.vertices.iter().all(|&n| n <= 65) && config.blank.cell_mm.is_none();
    config.fall.fall_s = config.fall.fall_s.min(1.0 / 60.0);
    config.fall.settle_s = config.fall.settle_s.min(1.0 / 60.0);
    config.fall.substep_rate = config.fall.substep_rate.min(120.0);
    config.fall.contact_rate = config.fall.contact_rate.min(120.0);
    let grid = &mut config.tool.grid;
    grid.spacing_mm = Some(grid.spacing_mm.unwrap_or(0.0).max(50.0));
    grid.margin_mm = grid.margin_mm.min(100.0);
    if !is_small {
        return Ok(());
    }
    let scene = Scene::new(&config, |_| ()).map_err(line)?;
    assert!(scene.initial.is_finite());
    let summary = scene.summary(&scene.initial);
    assert!(summary.distance_m.is_finite());
    Ok(())
}

#[test]
fn scenes() {
    let _alone = alone();
    let rib = include_str!("../../../../configs/scenes/rib.toml").replace("[65, 65]", "[9, 9]");
    let fold = include_str!("../../../../configs/scenes/fold.toml").replace("[65, 65]", "[9, 9]");
    let hole = include_str!("../../../../configs/scenes/outline-with-hole.toml");
    let keys = "material = \"m.toml\"\ntool.source.stl = { path = \"b.stl\", scale = 1e-3 }\n\
        tool.pose = { rotation_deg = [0, 0, 90], translation_mm = [0, 0, 1] }\n\
        blank = { size_mm = [100, 90], vertices = [9, 8], mass = \"datasheet\", yarn_angle_deg = 5 }\n\
        physics = { bending = \"dihedral\", tension = \"material\", strain_limit = 0.1, adhesion = 1, \
        shear_locking = true, self_collision = { thickness_mm = 0.5 }, solver = \"gauss_seidel\" }\n";
    let shapes = Shape::KINDS.map(|kind| {
        format!(
            "[blank]\nvertices = [9, 9]\n[tool.source.shape]\nkind = \"{kind}\"\nbase_mm = 20\n"
        )
    });
    // Findings: tables given as lists of their values, and lists that are too long.
    let lists = "clamps = [[[0, 0], 1.0, [0, 0, 1e9]]]\n[tool]\ngrid = [4.0, 40.0]\n\
        pose.rotation_deg = [1, 2, 3, 4, 5]\n";
    fs::write(folder().join("b.stl"), binary()).unwrap();
    fs::write(folder().join("m.toml"), MATERIAL).unwrap();
    let texts = [&rib, &fold, hole, keys, lists]
        .into_iter()
        .chain(shapes.iter().map(|s| &**s));
    let mut corpus: Vec<Vec<u8>> = texts.map(|text: &str| text.into()).collect();
    corpus.extend(dialects(keys));
    // A path of Windows, taken for escapes.
    corpus.push(keys.replace("b.stl", "C:\\tools\\b.stl").into());
    survives("scene.toml", &corpus, 1500, |path| {
        set_up(SceneConfig::read(path).map_err(line)?)
    });
}

const MATERIAL: &str = include_str!("../../../../configs/materials/interglas-92125.toml");

#[test]
fn materials() {
    let _alone = alone();
    let listed = MATERIAL.replace("[0.0, 0.0]", "[0, 0, 0]");
    let mut corpus = vec![MATERIAL.into(), listed.into()];
    corpus.extend(dialects(MATERIAL));
    let scene = "material = \"material.toml\"\n[blank]\nvertices = [5, 5]\n[tool.source.shape]\n\
        kind = \"plate\"\n[physics]\ntension = \"material\"\nbending_stiffness = \"material\"\n\
        shear_locking = true\n";
    let config = folder().join("of-material.toml");
    fs::write(&config, scene).unwrap();
    let config = SceneConfig::read(&config).unwrap();
    survives("material.toml", &corpus, 500, |path: &Path| {
        Material::read(path).map_err(line)?;
        set_up(config.clone())
    });
}

/// The words of parsers themselves are tested where they are turned into ours.
#[test]
fn words_are_those_of_users() {
    let words = in_words("invalid type: map, expected struct Part with 2 elements");
    assert_eq!(
        words,
        "invalid type: a table, expected a table with 2 elements"
    );
}
