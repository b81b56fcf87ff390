//! Bisection of all elements around one edge at once, which is what leaves a mesh conforming.

use super::{Bisection, LAST_GENERATION, NONE, Refinement};

/// Lists that bisections use again.
#[derive(Default)]
pub(super) struct Scratch {
    /// Elements that wait for the one above them.
    waiting: Vec<u32>,
    /// The elements around an edge, and on the surface from one side to the other.
    ring: Vec<u32>,
}

impl Bisection {
    /// Bisects one element. Where an element around its edge is to be bisected at another one, that comes first; it is
    /// of an earlier generation, so no more of them wait than there are generations.
    pub(super) fn bisect(&mut self, element: u32, max_tets: usize, scratch: &mut Scratch) -> Refinement {
        if self.generations[element as usize] >= LAST_GENERATION {
            return Refinement::TooFine;
        }
        scratch.waiting.clear();
        scratch.waiting.push(element);
        while let Some(&element) = scratch.waiting.last() {
            if let Some(earlier) = self.collect_ring(element, &mut scratch.ring) {
                debug_assert!(self.generations[earlier as usize] < self.generations[element as usize]);
                scratch.waiting.push(earlier);
                continue;
            }
            let count = self.tets.len() + scratch.ring.len();
            if count > max_tets.min(NONE as usize) || self.nodes.len() + 1 >= NONE as usize {
                return Refinement::Full;
            }
            self.bisect_ring(&scratch.ring);
            scratch.waiting.pop();
        }
        Refinement::Complete
    }

    /// The place d of the corner to which the edge that will be halved leads from the first one.
    fn place(&self, element: u32) -> usize {
        3 - usize::from(self.generations[element as usize] % 3)
    }

    /// Both ends of the edge that will be halved.
    fn edge(&self, element: u32) -> [u32; 2] {
        let tet = self.tets[element as usize];
        [tet[0], tet[self.place(element)]]
    }

    /// Collects the elements around the edge at which an element will be bisected, or else returns the first that will
    /// be bisected at another one.
    fn collect_ring(&self, element: u32, ring: &mut Vec<u32>) -> Option<u32> {
        let edge = self.edge(element);
        let tet = self.tets[element as usize];
        let [first, second] = others(tet, edge);
        ring.clear();
        ring.push(element);
        // Around, or to the surface; then from the start to the other side.
        for mut opposite in [first, second] {
            let mut at = element;
            loop {
                let tet = self.tets[at as usize];
                let face = corner(tet, opposite);
                // Behind the next element's face is the corner that both elements have beside the edge.
                let [a, b] = others(tet, edge);
                opposite = if a == opposite { b } else { a };
                at = self.neighbours[at as usize][face];
                if at == element {
                    return None;
                }
                if at == NONE {
                    break;
                }
                let [a, b] = self.edge(at);
                if [a, b] != edge && [b, a] != edge {
                    return Some(at);
                }
                ring.push(at);
            }
        }
        None
    }

    /// Bisects elements that are all to be bisected at the same edge and are all that have it.
    fn bisect_ring(&mut self, ring: &[u32]) {
        let middle = self.nodes.len() as u32;
        let split_off = self.tets.len() as u32;
        let [a, b] = self.edge(ring[0]);
        self.nodes.push(0.5 * (self.nodes[a as usize] + self.nodes[b as usize]));
        self.ends.push([a.min(b), a.max(b)]);
        for (number, &element) in (split_off..).zip(ring) {
            let d = self.place(element);
            let tet = self.tets[element as usize];
            let beyond = self.neighbours[element as usize];
            // Of the neighbour's children, the first keeps the neighbour's first corner, also if it already is there.
            let half = |neighbour: u32, with: u32| match ring.iter().position(|&other| other == neighbour) {
                Some(_) if self.tets[neighbour as usize][0] == with => neighbour,
                Some(place) => split_off + place as u32,
                None => NONE,
            };
            let (mut first, mut second) = (tet, tet);
            let mut beyond_first = beyond.map(|neighbour| half(neighbour, tet[0]));
            let mut beyond_second = beyond.map(|neighbour| half(neighbour, tet[d]));
            first[d] = middle;
            (beyond_first[0], beyond_first[d]) = (number, beyond[d]);
            // In the second the middle takes the first corner's place, and from there the place d.
            second[0] = middle;
            (beyond_second[0], beyond_second[d]) = (beyond[0], element);
            second[..=d].rotate_left(1);
            beyond_second[..=d].rotate_left(1);
            if let Some(neighbour) = self.neighbours.get_mut(beyond[0] as usize) {
                neighbour.iter_mut().filter(|other| **other == element).for_each(|other| *other = number);
            }
            self.tets[element as usize] = first;
            self.tets.push(second);
            self.neighbours[element as usize] = beyond_first;
            self.neighbours.push(beyond_second);
            self.generations[element as usize] += 1;
            self.generations.push(self.generations[element as usize]);
            self.parents.push(element);
        }
    }
}

/// The two corners that are not on an edge.
fn others(tet: [u32; 4], edge: [u32; 2]) -> [u32; 2] {
    let mut others = [NONE; 2];
    let mut found = 0;
    for node in tet {
        if !edge.contains(&node) {
            others[found] = node;
            found += 1;
        }
    }
    others
}

/// Which corner a node is.
fn corner(tet: [u32; 4], node: u32) -> usize {
    tet.iter().take_while(|&&other| other != node).count()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::geometry::Aabb;
    use crate::mesh::Lattice;
    use glam::DVec3;
    use std::collections::BTreeMap;

    /// From the corners alone.
    fn neighbours(tets: &[[u32; 4]]) -> Vec<[u32; 4]> {
        let mut faces: BTreeMap<[u32; 3], Vec<(usize, usize)>> = BTreeMap::new();
        for (element, tet) in tets.iter().enumerate() {
            for skipped in 0..4 {
                let mut face = [1, 2, 3].map(|k| tet[(skipped + k) % 4]);
                face.sort_unstable();
                faces.entry(face).or_default().push((element, skipped));
            }
        }
        let mut neighbours = vec![[NONE; 4]; tets.len()];
        for at in faces.into_values() {
            assert!(at.len() <= 2);
            if let [(a, face_of_a), (b, face_of_b)] = at[..] {
                neighbours[a][face_of_a] = b as u32;
                neighbours[b][face_of_b] = a as u32;
            }
        }
        neighbours
    }

    #[test]
    fn neighbours_are_kept_as_the_corners_have_them() {
        let domain = Aabb { min: DVec3::ZERO, max: DVec3::new(1.0, 2.0, 3.0) };
        let mut mesh = Bisection::new(&Lattice::uniform(domain, [2, 3, 2]).unwrap()).unwrap();
        assert_eq!(mesh.neighbours, neighbours(&mesh.tets));
        for step in 0..200 {
            let element = step * 7919 % mesh.tet_count();
            assert_eq!(mesh.refine(&[element as u32], usize::MAX), Refinement::Complete);
            assert_eq!(mesh.neighbours, neighbours(&mesh.tets), "step {step}");
        }
    }

    #[test]
    fn elements_as_fine_as_coordinates_allow_are_left_alone() {
        let domain = Aabb { min: DVec3::ZERO, max: DVec3::ONE };
        let mut mesh = Bisection::new(&Lattice::uniform(domain, [1, 1, 1]).unwrap()).unwrap();
        let mut longest_wait = 0;
        let mut scratch = Scratch::default();
        while mesh.bisect(0, usize::MAX, &mut scratch) == Refinement::Complete {
            longest_wait = longest_wait.max(scratch.waiting.capacity());
        }
        assert_eq!(mesh.generations[0], LAST_GENERATION);
        assert!(longest_wait <= usize::from(LAST_GENERATION), "{longest_wait}");
        assert_eq!(mesh.refine(&[0], usize::MAX), Refinement::TooFine);
        mesh.into_tet_mesh().unwrap();
    }
}
