/// Puts constraints, lists of vertices, into classes ("colours") within which no two share a
/// vertex, so that a class may be solved in any order, or at once. Greedy, in the order given.
/// Returns the indices of the constraints of each class, ascending.
pub fn color<const N: usize>(vertex_count: usize, constraints: &[[u32; N]]) -> Vec<Vec<u32>> {
    let mut taken = vec![0u64; vertex_count];
    let mut classes: Vec<Vec<u32>> = Vec::new();
    for (index, vertices) in constraints.iter().enumerate() {
        let used = vertices.iter().fold(0, |set, &v| set | taken[v as usize]);
        let class = used.trailing_ones() as usize;
        assert!(class < 64, "a vertex has more than 63 constraints");
        if class == classes.len() {
            classes.push(Vec::new());
        }
        classes[class].push(index as u32);
        for &v in vertices {
            taken[v as usize] |= 1 << class;
        }
    }
    classes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_partition_the_constraints_without_conflict() {
        // A ring of 7 with chords: needs more than two classes.
        let edges: Vec<[u32; 2]> = (0..7)
            .map(|i| [i, (i + 1) % 7])
            .chain((0..7).map(|i| [i, (i + 2) % 7]))
            .collect();
        let classes = color(7, &edges);
        let mut seen: Vec<u32> = classes.concat();
        seen.sort_unstable();
        assert_eq!(seen, (0..14).collect::<Vec<u32>>());
        for class in &classes {
            let mut vertices: Vec<u32> = class.iter().flat_map(|&e| edges[e as usize]).collect();
            let count = vertices.len();
            vertices.sort_unstable();
            vertices.dedup();
            assert_eq!(vertices.len(), count);
        }
    }
}
