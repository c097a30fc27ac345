/// Where the vertices of a lamina stand in the rows and columns of its grid.
///
/// A node is a place of the grid, `row * columns + column`; a cut blank has no vertex at some of
/// them. Vertices are counted in the order of their nodes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Grid {
    pub columns: usize,
    pub rows: usize,
    /// Sides of a cell along a row and along a column [m].
    pub cell: [f64; 2],
    /// Node of each vertex, ascending.
    nodes: Vec<u32>,
    /// Vertex at each node.
    vertices: Vec<Option<u32>>,
}

impl Grid {
    /// A grid of `columns` x `rows` places of which `nodes`, ascending, have a vertex.
    pub fn new([columns, rows]: [usize; 2], cell: [f64; 2], nodes: Vec<u32>) -> Self {
        let mut vertices = vec![None; rows * columns];
        for (vertex, &node) in nodes.iter().enumerate() {
            vertices[node as usize] = Some(vertex as u32);
        }
        Self {
            columns,
            rows,
            cell,
            nodes,
            vertices,
        }
    }

    /// Nodes at the corners of a cell: the lower two from left to right, then the upper two.
    pub fn corners(&self, cell: usize) -> [usize; 4] {
        let first = cell / (self.columns - 1) * self.columns + cell % (self.columns - 1);
        [0, 1, self.columns, self.columns + 1].map(|step| first + step)
    }

    /// The vertex at a place; none where the blank has been cut away.
    pub fn vertex_at(&self, row: usize, column: usize) -> Option<u32> {
        self.vertices[row * self.columns + column]
    }

    /// Row and column of a vertex.
    pub fn place(&self, vertex: u32) -> [usize; 2] {
        let node = self.nodes[vertex as usize] as usize;
        [node / self.columns, node % self.columns]
    }

    /// The vertices up to `reach` rows and columns away from `vertex`, itself included,
    /// ascending.
    pub fn window(
        &self,
        vertex: u32,
        [rows, columns]: [usize; 2],
    ) -> impl Iterator<Item = u32> + '_ {
        let [row, column] = self.place(vertex);
        let columns = column.saturating_sub(columns)..=(column + columns).min(self.columns - 1);
        (row.saturating_sub(rows)..=(row + rows).min(self.rows - 1)).flat_map(move |row| {
            let columns = columns.clone();
            columns.filter_map(move |column| self.vertex_at(row, column))
        })
    }
}
