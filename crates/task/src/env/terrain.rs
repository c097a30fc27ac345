use drape_cloth::math::Vec3;
use drape_cloth::scene::Scene;
use drape_cloth::sim::View;
use fixedbitset::FixedBitSet;

/// What a task shows that never changes: the tool below the fabric as it lies at the start. One
/// entry a pixel, row by row; nothing where the agent sees no vertex.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Terrain {
    /// There is a vertex of the focus region.
    pub inside: FixedBitSet,
    /// Height of the tool above its lowest place that is shown [m].
    pub height: Vec<f32>,
    /// Components of the tool's outward unit normal along rows and along columns of the image.
    pub slope: Vec<[f32; 2]>,
}

impl Terrain {
    /// The terrain under what a view shows.
    pub(super) fn new(scene: &Scene, view: &View) -> Self {
        let pixel_count = view.pixel_count;
        let [along, down] = axes(scene);
        let mut terrain = Self {
            inside: FixedBitSet::with_capacity(pixel_count),
            height: vec![0.0; pixel_count],
            slope: vec![[0.0; 2]; pixel_count],
        };
        let mut heights = Vec::new();
        for (&pixel, &vertex) in view.pixels.iter().zip(&view.vertices) {
            let pixel = pixel as usize;
            let x = Vec3::from(scene.initial.position[vertex as usize]);
            let foot = scene.tool.surface.project(x);
            terrain.inside.insert(pixel);
            terrain.slope[pixel] = [along, down].map(|axis| foot.normal.dot(&axis) as f32);
            heights.push((pixel, foot.position.z));
        }
        let lowest = heights
            .iter()
            .map(|&(_, z)| z)
            .fold(f64::INFINITY, f64::min);
        for (pixel, z) in heights {
            terrain.height[pixel] = (z - lowest) as f32;
        }
        terrain
    }
}

/// Where rows and columns of the blank run as it lies at the start: unit vectors in the mean over
/// all yarns, from the first place of a row to its last, and of a column.
fn axes(scene: &Scene) -> [Vec3; 2] {
    let (lamina, x) = (&scene.lamina, &scene.initial.position);
    let towards = |down: usize, right: usize| {
        let ways = (0..lamina.vertex_count() as u32).filter_map(|vertex| {
            let [row, column] = lamina.place(vertex);
            let (row, column) = (row + down, column + right);
            let exists = row < lamina.rows && column < lamina.columns;
            let next = exists.then(|| lamina.vertex_at(row, column))??;
            Some(Vec3::from(x[next as usize]) - Vec3::from(x[vertex as usize]))
        });
        ways.sum::<Vec3>().normalize()
    };
    [towards(0, 1), towards(1, 0)]
}
