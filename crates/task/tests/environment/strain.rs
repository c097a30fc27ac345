//! What is stretched is not fixed.

use super::*;

/// A press brings a vertex to the tool with its yarns stretched: it is touched, but free.
#[test]
fn stretched_vertices_stay_free() {
    let draped = |drape_strain: f64| {
        let config = EnvConfig {
            drape_strain,
            ..small_region()
        };
        let mut env = Draping::new(COARSE.clone(), &config, 1).unwrap();
        let mut player = Player::new(3, 1);
        let mut refused = 0;
        for _ in 0..20 {
            let actions = player.choose(&env);
            env.step(&actions);
            let state = env.state(0);
            for v in state.pressed.touched.difference(&state.pressed.draped) {
                assert!(!state.fixed.contains(v));
                let near = COARSE.tool.distance(state.position[v]).0 <= 1e-3;
                refused += usize::from(near);
            }
        }
        (refused, env.state(0).pressed.draped.count_ones(..))
    };
    let (_, all) = draped(1e4);
    let (refused, some) = draped(1e-5);
    assert!(
        refused > 0 && some < all,
        "{refused} refused, {some} of {all}"
    );
}
