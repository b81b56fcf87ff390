//! The order in which the solver keeps the nodes of a mesh.
//!
//! Meshes number their nodes as their makers found fit. Reverse Cuthill-McKee puts neighbours close together, so that
//! what a row gathers is still in the cache from the rows before, and blocks of rows have few neighbours outside.

/// The row of each node. `neighbours` visits those of a node.
pub(super) fn reverse_cuthill_mckee(nodes: usize, neighbours: impl Fn(usize, &mut Vec<u32>)) -> Vec<u32> {
    let mut around = Vec::new();
    let degree: Vec<u32> = (0..nodes)
        .map(|node| {
            around.clear();
            neighbours(node, &mut around);
            around.len() as u32
        })
        .collect();
    let mut order = Vec::with_capacity(nodes);
    let mut seen = vec![false; nodes];
    for start in 0..nodes {
        if seen[start] {
            continue;
        }
        // A walk from anywhere ends far out, where the walk that counts should begin.
        let before = order.len();
        let mut from = start as u32;
        for last in [false, true] {
            walk(from, &degree, &mut seen, &mut order, &neighbours);
            if !last {
                from = order.last().copied().unwrap_or(from);
                order.drain(before..).for_each(|node: u32| seen[node as usize] = false);
            }
        }
    }
    let mut row = vec![0; nodes];
    for (&node, at) in order.iter().rev().zip(0..) {
        row[node as usize] = at;
    }
    row
}

/// Appends a component of the mesh, breadth first, nodes with few neighbours first.
fn walk(
    from: u32,
    degree: &[u32],
    seen: &mut [bool],
    order: &mut Vec<u32>,
    neighbours: impl Fn(usize, &mut Vec<u32>),
) {
    let mut around = Vec::new();
    let mut next = order.len();
    seen[from as usize] = true;
    order.push(from);
    while let Some(&node) = order.get(next) {
        next += 1;
        around.clear();
        neighbours(node as usize, &mut around);
        around.retain(|&other| !std::mem::replace(&mut seen[other as usize], true));
        around.sort_unstable_by_key(|&other| (degree[other as usize], other));
        order.extend_from_slice(&around);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chain with scrambled numbers becomes a chain again, and every component is numbered.
    #[test]
    fn a_chain_is_numbered_along() {
        let scrambled = [3, 0, 4, 1, 2, 7, 5, 6];
        let chains = |node: usize, found: &mut Vec<u32>| {
            let at = scrambled.iter().position(|&other| other == node as u32).unwrap_or(0);
            for beside in [at.wrapping_sub(1), at + 1] {
                // Two chains: places 0 to 4 and 5 to 7.
                if beside < 8 && (at < 5) == (beside < 5) {
                    found.push(scrambled[beside]);
                }
            }
        };
        let row = reverse_cuthill_mckee(8, chains);
        for pair in [0..5, 5..8].iter().flat_map(|chain| scrambled[chain.clone()].windows(2)) {
            assert_eq!(row[pair[0] as usize].abs_diff(row[pair[1] as usize]), 1, "{row:?}");
        }
        let mut all = row.clone();
        all.sort_unstable();
        assert_eq!(all, (0..8).collect::<Vec<_>>());
    }
}
