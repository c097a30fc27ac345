//! The stencil on flat cloth, where its vertices can be counted by hand.

use drape_cloth::sim::{Parameters, Pressed};
use drape_cloth::tool::{Plate, Shape, Source};

use super::*;

/// A flat blank of 370 mm that lies on a plate, untouched.
fn flat(vertices: usize) -> Arc<Scene> {
    let mut config = SceneConfig::rib();
    config.tool.source = Source::Shape(Shape::Plate(Plate::default()));
    config.tool.grid.spacing_mm = Some(20.0);
    config.blank.vertices = [vertices; 2];
    config.placement.tilt_deg = 0.0;
    config.placement.height_mm = 0.0;
    config.fall.fall_s = 0.0;
    config.fall.settle_s = 0.0;
    config.clamps.clear();
    Arc::new(Scene::new(&config, |_| {}).unwrap())
}

/// Vertices touched, and actions allowed afterwards, by a press of 18 mm on `pressed`.
fn press(vertices: usize, pressed: [usize; 2]) -> [usize; 2] {
    let mut env = Draping::new(flat(vertices), &EnvConfig::default(), 1).unwrap();
    env.step(&[(pressed[0] * vertices + pressed[1]) as u32]);
    let Pressed {
        touched, draped, ..
    } = env.state(0).pressed;
    // A plate and a flat sheet: whatever is touched is draped.
    assert_eq!(touched, draped);
    [touched.count_ones(..), env.observation(0).allowed().count()]
}

/// Cells of 5.78 mm: 3 x 3 vertices within 9 mm of the centre, and 16 beside them.
#[test]
fn stencil_covers_nine_vertices_of_the_standard_blank() {
    assert_eq!(press(65, [32, 32]), [9, 16]);
    assert_eq!(press(65, [0, 32]), [6, 9]);
    assert_eq!(press(65, [64, 64]), [4, 5]);
}

/// Cells of 11.6 mm: one vertex alone.
#[test]
fn stencil_covers_one_vertex_of_a_coarse_blank() {
    assert_eq!(press(33, [16, 16]), [1, 8]);
}

/// Cells of 2.89 mm: 7 x 7 vertices, and 32 beside them.
#[test]
fn stencil_covers_more_of_a_finer_blank() {
    assert_eq!(press(129, [64, 64]), [49, 32]);
}

/// A press that misses touches nothing, one that lands touches its vertex.
#[test]
fn presses_that_miss_touch_nothing() {
    let parameters = Parameters {
        misses: 0.5,
        seed: 3,
        ..Parameters::default()
    };
    let config = EnvConfig {
        parameters: parameters.clone(),
        ..EnvConfig::default()
    };
    let mut env = Draping::new(flat(33), &config, 1).unwrap();
    let (mut touched, mut missed) = (0, 0);
    for press in 0..12 {
        let action = env.observation(0).allowed().next().unwrap();
        env.step(&[action]);
        let before = touched;
        touched = env.state(0).pressed.touched.count_ones(..);
        let misses = parameters.aim(press).misses();
        assert_eq!(touched > before, !misses, "press {press}");
        missed += usize::from(misses);
    }
    assert!((1..12).contains(&missed), "{missed}");
}
