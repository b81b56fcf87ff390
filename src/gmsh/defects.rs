//! What is wrong with a file and was mended in reading it.

/// How many there are, and the number in the file of the first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Found {
    /// How many.
    pub count: usize,
    /// Tag of the first; 0 if there is none.
    pub first: u64,
}

impl Found {
    pub(super) fn add(&mut self, tag: u64) {
        if self.count == 0 {
            self.first = tag;
        }
        self.count += 1;
    }
}

/// Defects of a file that do not keep it from being used.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Defects {
    /// Elements of second or higher order: only their corners are used.
    pub higher_order: Found,
    /// Nodes at the place of another, which took over their elements.
    pub joined_nodes: Found,
    /// Nodes in no tetrahedron, left out.
    pub unused_nodes: Found,
    /// Triangles and tetrahedra with one node twice, left out.
    pub collapsed: Found,
    /// Tetrahedra whose nodes were in the wrong order, turned over.
    pub inverted: Found,
    /// Tetrahedra with the nodes of another, left out; their groups went to the other.
    pub repeated_tets: Found,
    /// Triangles in a group that have nodes in no tetrahedron, left out: their tags, ascending.
    pub detached_triangles: Vec<u64>,
    /// Number of partitions the mesh is cut into; they are ignored.
    pub partitions: u64,
}

impl Defects {
    /// A sentence for each kind of defect there is, but for detached triangles, which are counted together with those
    /// between nodes of tetrahedra ([`SurfaceSummary`](super::SurfaceSummary)).
    pub fn messages(&self) -> Vec<String> {
        let mut messages = Vec::new();
        let mut tell = |found: Found, what: [&str; 2], is: [&str; 2], outcome: [&str; 2]| {
            let Found { count, first } = found;
            let which = usize::from(count > 1);
            match count {
                0 => {}
                1 => messages.push(format!("{} {first} {}; {}", what[0], is[0], outcome[0])),
                _ => messages.push(format!(
                    "{count} {}, such as {first}, {}; {}",
                    what[which], is[which], outcome[which]
                )),
            }
        };
        tell(
            self.higher_order,
            ["element", "elements"],
            ["is of second or higher order", "are of second or higher order"],
            ["only its corners are used", "only their corners are used"],
        );
        let left_out = ["it is left out", "they are left out"];
        tell(
            self.joined_nodes,
            ["node", "nodes"],
            ["lies where another does", "lie where others do"],
            ["the two are joined", "they are joined"],
        );
        tell(
            self.unused_nodes,
            ["node", "nodes"],
            ["is in no tetrahedron", "are in no tetrahedron"],
            left_out,
        );
        tell(
            self.collapsed,
            ["element", "elements"],
            ["has one node twice", "have one node twice"],
            left_out,
        );
        tell(
            self.inverted,
            ["tetrahedron", "tetrahedra"],
            ["is inverted", "are inverted"],
            ["it is turned over", "they are turned over"],
        );
        tell(
            self.repeated_tets,
            ["tetrahedron", "tetrahedra"],
            ["has the nodes of another", "have the nodes of others"],
            left_out,
        );
        if self.partitions > 0 {
            messages.push(format!("the mesh is cut into {} partitions; they are ignored", self.partitions));
        }
        messages
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_and_several_are_told_apart() {
        let mut defects = Defects { partitions: 3, ..Defects::default() };
        defects.inverted.add(7);
        defects.unused_nodes.add(4711);
        defects.unused_nodes.add(4712);
        let expected = [
            "2 nodes, such as 4711, are in no tetrahedron; they are left out",
            "tetrahedron 7 is inverted; it is turned over",
            "the mesh is cut into 3 partitions; they are ignored",
        ];
        assert_eq!(defects.messages(), expected);
        assert!(Defects::default().messages().is_empty());
    }
}
