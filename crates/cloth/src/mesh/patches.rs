/// The connected patches of what is open, each in the order in which it is found from its first
/// member; nothing is open then. `neighbors` are those of a member.
pub fn patches<I: Iterator<Item = usize>>(
    open: &mut [bool],
    neighbors: impl Fn(usize) -> I,
) -> Vec<Vec<usize>> {
    let mut patches = Vec::new();
    for start in 0..open.len() {
        if !std::mem::take(&mut open[start]) {
            continue;
        }
        let mut patch = vec![start];
        let mut next = 0;
        while let Some(&member) = patch.get(next) {
            patch.extend(neighbors(member).filter(|&other| std::mem::take(&mut open[other])));
            next += 1;
        }
        patches.push(patch);
    }
    patches
}
