use super::*;
use drape_cloth::fabric::BlankConfig;

/// 18 mm are three cells of the paper's mesh; coarser meshes keep three.
#[test]
fn stencils_cover_three_cells() {
    let side = |vertices: usize| {
        let blank = BlankConfig {
            vertices: [vertices; 2],
            ..BlankConfig::default()
        };
        let material = drape_cloth::fabric::Material::interglas_92125();
        stencil_mm(&Lamina::new(&blank, material).unwrap(), 18.0)
    };
    assert_eq!(side(65), 18.0);
    assert!((side(33) - 3.0 * 370.0 / 32.0).abs() < 1e-9);
}
