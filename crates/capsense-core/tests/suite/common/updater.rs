//! The part of a simulator that comes before the solver, and what must hold of it after every frame.

use capsense_core::material::Material;
use capsense_core::occupancy::{Contact, EdgeGeometry, Interface, Occupancy, Surfaces};
use capsense_core::sensor::Sensor;
use capsense_core::stiffness::{EdgeNetwork, StiffnessMatrix};
use std::collections::BTreeSet;

#[derive(Clone)]
pub struct Updater<'a> {
    /// None where surfaces of conductors cut edges.
    interface: Option<Interface>,
    pub sensor: &'a Sensor,
    pub network: EdgeNetwork,
    pub materials: Vec<Material>,
    pub occupancy: Occupancy,
    pub matrix: StiffnessMatrix,
}

/// Couplings, linked edges, the conductors of nodes, contacts, the values of K, permittivities and holders of elements.
type State<'a> =
    (Vec<[u64; 4]>, &'a [u32], &'a [u16], &'a [Contact], Vec<u64>, Option<(&'a [f64], &'a [u16])>);

impl<'a> Updater<'a> {
    pub fn new(sensor: &'a Sensor, materials: &[Material]) -> Self {
        Self::of(None, sensor, materials)
    }

    pub fn with_interface(interface: Interface, sensor: &'a Sensor, materials: &[Material]) -> Self {
        Self::of(Some(interface), sensor, materials)
    }

    fn of(interface: Option<Interface>, sensor: &'a Sensor, materials: &[Material]) -> Self {
        let nodes = sensor.mesh().nodes().len();
        let (network, occupancy) = match interface {
            None => {
                let network = EdgeNetwork::of_sensor(sensor);
                let occupancy = Occupancy::empty(nodes, network.edges().len()).with_weights(
                    sensor.mesh(),
                    network.edges(),
                    network.weights(),
                    materials.len() > 1,
                );
                let occupancy = occupancy.with_immersed_elements(sensor.mesh(), network.edges());
                (network, occupancy)
            }
            Some(interface) => {
                let network = EdgeNetwork::of_sensor_elements(sensor);
                let occupancy = Occupancy::with_interface(interface, sensor.mesh(), network.edges())
                    .with_weights(sensor.mesh(), network.edges(), network.weights(), true);
                (network, occupancy)
            }
        };
        let matrix = StiffnessMatrix::new(network.clone(), nodes);
        Self { interface, sensor, network, materials: materials.to_vec(), occupancy, matrix }
    }

    pub fn step(&mut self, surfaces: &dyn Surfaces) {
        let mesh = EdgeGeometry {
            nodes: self.sensor.mesh().nodes(),
            terminals: self.sensor.owners(),
            edges: self.network.edges(),
            permittivity: self.network.permittivity(),
        };
        self.occupancy.update(mesh, &self.materials, surfaces);
        self.matrix.update(&self.occupancy);
    }

    /// Takes a step; what it leaves is that of a fresh build, and what is said to have changed did.
    pub fn step_checked(&mut self, surfaces: &dyn Surfaces) {
        let before = self.clone();
        self.step(surfaces);
        self.assert_is_fresh(surfaces);
        self.assert_tells_changes_since(&before);
    }

    /// Everything that one frame leaves, in bits.
    fn state(&self) -> State<'_> {
        let couplings = self.occupancy.couplings().map(|c| {
            let objects = u64::from(c.object[0]) << 16 | u64::from(c.object[1]);
            [c.through.to_bits(), c.factor[0].to_bits(), c.factor[1].to_bits(), objects]
        });
        let matrix = self.matrix.to_csr().values().iter().map(|value| value.to_bits()).collect();
        let occupancy = &self.occupancy;
        let lists = (occupancy.linked_edges(), occupancy.conductors(), occupancy.contacts());
        (couplings.collect(), lists.0, lists.1, lists.2, matrix, occupancy.elements())
    }

    pub fn assert_is_fresh(&self, surfaces: &dyn Surfaces) {
        let mut fresh = Self::of(self.interface, self.sensor, &self.materials);
        fresh.step(surfaces);
        let pairs = (0..).zip(self.occupancy.couplings().zip(fresh.occupancy.couplings()));
        for (edge, (own, fresh)) in pairs.take(self.network.edges().len()) {
            let ends = self
                .network
                .edges()
                .ends(edge)
                .map(|ends| ends.map(|node| self.sensor.mesh().nodes()[node as usize]));
            assert_eq!(own, fresh, "edge {edge}: {ends:?}");
        }
        assert!(self.state() == fresh.state(), "differs from a fresh build");
        let linked = (0..).zip(self.occupancy.couplings()).filter(|(_, c)| c.is_linked());
        assert!(linked.map(|(edge, _)| edge).eq(self.occupancy.linked_edges().iter().copied()));
    }

    /// What is said to have changed since an earlier frame is what did.
    fn assert_tells_changes_since(&self, before: &Self) {
        let held = |updater: &Self, node: u32| updater.occupancy.conductors()[node as usize];
        let moved = |node: &u32| held(self, *node) != held(before, *node);
        let nodes = 0..self.sensor.mesh().nodes().len() as u32;
        assert!(nodes.filter(moved).eq(self.occupancy.changed_nodes().iter().copied()), "changed nodes");
        let ends = |edge: u32| self.network.edges().ends(edge as usize).into_iter().flatten();
        let other = |edge: &u32| {
            let [now, then] = [self, before].map(|u| u.occupancy.coupling(*edge as usize));
            now != then || ends(*edge).any(|node| moved(&node))
        };
        let edges = (0..self.network.edges().len() as u32).filter(other);
        assert!(edges.eq(self.occupancy.changed_edges().iter().copied()), "changed edges");
        self.assert_tells_rows_since(before);
    }

    fn assert_tells_rows_since(&self, before: &Self) {
        let (now, then) = (self.matrix.to_csr(), before.matrix.to_csr());
        let differs = |row: &u32| {
            let row = *row as usize;
            now.row(row).values() != then.row(row).values()
                || self.matrix.link_weight(row) != before.matrix.link_weight(row)
        };
        let mut told = self.matrix.changed_rows().to_vec();
        told.sort_unstable();
        // Links may lead to another object and weigh the same, and several may weigh the same together.
        let mut relinked = BTreeSet::new();
        let scales_negative = self.occupancy.scales_negative_weights();
        let weights = self.network.weights().iter().enumerate();
        for (edge, _) in weights.filter(|(_, base)| **base > 0.0 || scales_negative) {
            let links = |u: &Self| {
                let of = u.occupancy.coupling(edge);
                [0, 1].map(|end| (of.object[end], of.factor[end].to_bits()))
            };
            let [now, then] = [self, before].map(links);
            let ends = self.network.edges().ends(edge).into_iter().flatten().zip([0, 1]);
            relinked.extend(ends.filter(|(_, end)| now[*end] != then[*end]).map(|(node, _)| node));
        }
        let nodes = 0..self.sensor.mesh().nodes().len() as u32;
        assert!(nodes.filter(|row| relinked.contains(row) || differs(row)).eq(told), "changed rows");
    }
}
