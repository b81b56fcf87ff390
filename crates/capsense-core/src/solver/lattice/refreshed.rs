//! Residuals of the nodes whose rows changed, and the state with them.
//!
//! They are computed in blocks of successive nodes, as where all fields are moved: a block takes less time than its nodes take
//! one by one, even if only one of them changed. What comes out for the others is what they had, but for rounding.

use super::charges::{Place, StoredPlace};
use super::increment::{self, Increment};
use super::layout::{BLOCK, Coloured, Layout, RED};
use super::level::Level;
use super::links::ObjectLinks;
use super::parts::places;
use super::potentials::Potentials;
use super::precision::{Leaking, Network};
use super::relaxation::Room;
use super::sums::{Equations, Nodes, PIECE, Partial, Sums, hold, total, turn_into_residuals};
use crate::instructions::EightLanes;
use crate::solver::operator::State;
use crate::workers::Workers;
use pulp::{Simd, WithSimd};

/// What changed rows change.
pub(super) struct Refreshed<'a> {
    pub(super) of_nodes: Layout,
    pub(super) potentials: &'a mut Potentials,
    pub(super) links: &'a ObjectLinks,
    pub(super) finest: &'a mut Level,
    pub(super) increment: &'a mut Increment,
    pub(super) of_free: &'a mut [f64],
    pub(super) state: &'a mut State,
    pub(super) blocks: &'a mut Blocks,
    pub(super) room: &'a mut Room,
}

/// So many groups of planes have their sums each, whatever the threads that share them.
const GROUPS: usize = 8;

/// Fewer blocks are not worth a group.
const BLOCKS_OF_A_GROUP: usize = 256;

/// Blocks of nodes, and room for those of each group of planes.
#[derive(Clone, Debug)]
pub(super) struct Blocks {
    /// Where those of each plane start, in the order in which they were found.
    starts: Vec<Vec<StoredPlace>>,
    /// By colour and place of the first node in whole blocks.
    is_listed: Coloured<bool>,
    rooms: Vec<GroupRoom>,
}

/// Room for one block, and by how much a group's sums changed.
#[derive(Clone, Debug)]
struct GroupRoom {
    of_block: Vec<OfColumn>,
    changes: Changes,
    of_increment: increment::Sums,
}

/// What the nodes of a block have in one column: potentials, the last change of the fields, and residuals and charges of that
/// change before and now.
#[derive(Clone, Debug, Default)]
pub(super) struct OfColumn {
    potential: Partial,
    pub(super) increment: [f32; BLOCK],
    pub(super) residual: [[f32; BLOCK]; 2],
    pub(super) charge: [[f32; BLOCK]; 2],
}

/// By how much sums changed.
#[derive(Clone, Debug)]
struct Changes {
    /// Σ x_s r_t over free rows for s <= t, and Σ r² of each column.
    products: Vec<Partial>,
    residual: Vec<Partial>,
    /// In single precision, so of few blocks.
    of_increment: increment::Sums<[f32; BLOCK]>,
}

impl Blocks {
    /// None, of nodes and vectors with such layouts.
    pub(super) fn new(of_nodes: &Layout, columns: usize) -> Self {
        let flags = || vec![false; of_nodes.len().div_ceil(BLOCK)];
        Self {
            starts: vec![Vec::new(); of_nodes.counts[2]],
            is_listed: [flags(), flags()],
            rooms: vec![GroupRoom::new(columns)],
        }
    }

    /// How many tasks need room for charges where threads share so many slabs.
    pub(super) fn tasks(slabs: usize) -> usize {
        if slabs == 1 { 1 } else { slabs.max(GROUPS) }
    }

    /// Lists the block that a node of plane k is in. Nodes in planes and rows that are fixed throughout are in none.
    #[inline]
    pub(super) fn list(&mut self, of_nodes: &Layout, Place { colour, at, first }: Place, k: usize) {
        let plane = of_nodes.plane(k);
        if !of_nodes.planes().contains(&k) || !plane.contains(&at) {
            return;
        }
        let within = (at - plane.start) % BLOCK;
        let (at, first) = (at - within, first - within);
        if !std::mem::replace(&mut self.is_listed[colour][at / BLOCK], true) {
            self.starts[k].push(Place { colour, at, first }.stored());
        }
    }

    /// Gives back the room that the first refresh took, in which every row changed.
    pub(super) fn settle(&mut self) {
        self.starts.fill(Vec::new());
        self.rooms.truncate(1);
        self.rooms.shrink_to_fit();
    }

    /// Forgets all blocks and changes.
    fn clear(&mut self) {
        for start in self.starts.iter_mut().flat_map(|starts| starts.drain(..)) {
            let Place { colour, at, .. } = start.get();
            self.is_listed[colour][at / BLOCK] = false;
        }
        for GroupRoom { changes: Changes { products, residual, .. }, of_increment, .. } in &mut self.rooms {
            products.iter_mut().chain(residual).for_each(|sum| *sum = Partial::default());
            of_increment.clear();
        }
    }
}

impl GroupRoom {
    fn new(columns: usize) -> Self {
        Self {
            of_block: vec![OfColumn::default(); columns],
            changes: Changes {
                products: vec![Partial::default(); columns * columns],
                residual: vec![Partial::default(); columns],
                of_increment: increment::Sums::new(columns),
            },
            of_increment: increment::Sums::new(columns),
        }
    }
}

impl Refreshed<'_> {
    /// Recomputes the residuals of the blocks that are listed, and what depends on them.
    pub(super) fn refresh(&mut self, workers: &Workers, arch: EightLanes) {
        let Self { of_nodes, potentials, links, finest, increment, of_free, state, blocks, .. } = self;
        let Level { stencil, layout, b, charges, .. } = &mut **finest;
        let (of_nodes, inverse, layout) = (*of_nodes, &stencil.centre, *layout);
        let Increment { fields, sums: of_increment, is_known, .. } = &mut **increment;
        match &mut **potentials {
            Potentials::Single { x, leak, sums } => {
                let network = Leaking { stencil, leak };
                let equations = Equations { network, of_nodes, layout, inverse, links };
                let charges = charges.each_mut().map(|charges| &mut charges[..]);
                let followed = is_known.then_some(Followed { fields, charges });
                blocks.take((workers, arch), &equations, (x, b), followed, sums);
            }
            Potentials::Double { x, stencil, sums, .. } => {
                let equations = Equations { network: &**stencil, of_nodes, layout, inverse, links };
                blocks.take((workers, arch), &equations, (x, b), None, sums);
            }
        }
        for GroupRoom { changes: Changes { products, residual, .. }, of_increment: of_group, .. } in
            &mut blocks.rooms
        {
            for (energy, product) in of_free.iter_mut().zip(products) {
                // Charges are minus residuals.
                *energy -= total(product);
            }
            state.residual.iter_mut().zip(residual).for_each(|(sum, part)| *sum += total(part));
            of_increment.add(of_group);
        }
        blocks.clear();
    }
}

impl Blocks {
    /// Has threads recompute the residuals of all blocks, and the charges of the last change of the fields where these are to follow.
    fn take<K: Network + Sync>(
        &mut self,
        (workers, arch): (&Workers, EightLanes),
        equations: &Equations<'_, K>,
        (x, r): (&Coloured<K::Value>, &mut Coloured<f32>),
        mut followed: Option<Followed<'_, K::Value>>,
        sums: &mut [Sums<K::Value>],
    ) {
        let Self { starts, rooms, .. } = self;
        let all: usize = starts.iter().map(Vec::len).sum();
        let of_group = all.div_ceil(GROUPS).max(BLOCKS_OF_A_GROUP);
        if let Some(columns) = rooms.first().map(|room| room.of_block.len()) {
            let groups = all.div_ceil(of_group).max(rooms.len());
            rooms.resize_with(groups, || GroupRoom::new(columns));
        }
        let (starts, mut first) = (&*starts, 0);
        let groups = std::iter::from_fn(move || {
            let (mut count, mut end) = (0, first);
            while end < starts.len() && count < of_group {
                count += starts[end].len();
                end += 1;
            }
            let planes = std::mem::replace(&mut first, end)..end;
            (!planes.is_empty()).then_some(planes)
        });
        let mut r = r.each_mut().map(|r| &mut r[..]);
        let tasks = groups.zip(rooms).map(move |(planes, room)| {
            let places = places(&equations.layout, planes.clone());
            let followed = followed.as_mut().map(|followed| followed.cut_off(places.len()));
            let r = cut_off(&mut r, places.len());
            BlocksOfGroup { equations, x, starts: &starts[planes], first: places.start, r, followed, room }
        });
        match sums {
            [sums] => tasks.for_each(|of| arch.dispatch(Blockwise { of, sums: &mut *sums })),
            _ => workers.for_each(tasks.zip(sums), |(of, sums)| arch.dispatch(Blockwise { of, sums })),
        }
    }
}

/// The last change of the fields where it is to follow, and its charges.
struct Followed<'a, T> {
    fields: &'a Coloured<T>,
    charges: [&'a mut [f32]; 2],
}

impl<'a, T> Followed<'a, T> {
    /// Takes so many charges of either colour off.
    fn cut_off(&mut self, count: usize) -> Self {
        Self { fields: self.fields, charges: cut_off(&mut self.charges, count) }
    }
}

/// Takes so many numbers of either colour off.
fn cut_off<'a>(of: &mut [&'a mut [f32]; 2], count: usize) -> [&'a mut [f32]; 2] {
    of.each_mut().map(|of| of.split_off_mut(..count).unwrap_or_default())
}

/// Residuals in blocks, and by how much sums changed.
struct Blockwise<'a, K: Network> {
    of: BlocksOfGroup<'a, K>,
    /// Room for charges.
    sums: &'a mut Sums<K::Value>,
}

/// The blocks of some planes.
struct BlocksOfGroup<'a, K: Network> {
    equations: &'a Equations<'a, K>,
    x: &'a Coloured<K::Value>,
    starts: &'a [Vec<StoredPlace>],
    /// The first place of what follows, which is of these planes.
    first: usize,
    r: [&'a mut [f32]; 2],
    followed: Option<Followed<'a, K::Value>>,
    room: &'a mut GroupRoom,
}

impl<K: Network> WithSimd for Blockwise<'_, K> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let few = PIECE / BLOCK;
        for starts in self.of.starts.iter().flat_map(|starts| starts.chunks(few)) {
            for start in starts {
                let Place { colour, at, first } = start.get();
                let nodes = Nodes { colour, places: at..at + BLOCK, first };
                self.take_residuals(simd, &nodes);
                self.take_charges(simd, &nodes);
            }
            if self.of.followed.is_some() {
                let GroupRoom { changes, of_increment, .. } = &mut *self.of.room;
                of_increment.take(&mut changes.of_increment);
            }
        }
    }
}

impl<K: Network> Blockwise<'_, K> {
    /// The residuals of a block.
    #[inline(always)]
    fn take_residuals<S: Simd>(&mut self, simd: S, nodes: &Nodes) {
        let Self { of: BlocksOfGroup { equations, x: [red, black], first, r, room, .. }, sums } = self;
        let GroupRoom { of_block, changes, .. } = &mut **room;
        sums.take_charges(simd, equations, [red, black], nodes);
        let (x, r) = (if nodes.colour == RED { red } else { black }, &mut *r[nodes.colour]);
        for (t, of_column) in of_block.iter_mut().enumerate() {
            let at = nodes.within(&equations.layout, t).start;
            let (x, r) = (&x[at..at + BLOCK], &mut r[at - *first..][..BLOCK]);
            let [before, now] = &mut of_column.residual;
            of_column.potential = widened(x);
            before.copy_from_slice(r);
            K::round(r, sums.of_column(&equations.layout, t, BLOCK));
            turn_into_residuals(simd, r, equations.inverse(nodes));
            now.copy_from_slice(r);
        }
        changes.add(simd, of_block);
    }

    /// The charges of the last change, if they are to follow.
    #[inline(always)]
    fn take_charges<S: Simd>(&mut self, simd: S, nodes: &Nodes) {
        let Self { of: BlocksOfGroup { equations, first, followed, room, .. }, sums } = self;
        let Some(followed) = followed else { return };
        let Followed { fields: [red, black], charges } = followed;
        let GroupRoom { of_block, changes, .. } = &mut **room;
        sums.apply(simd, equations, [red, black], nodes);
        let (d, q) = (if nodes.colour == RED { red } else { black }, &mut *charges[nodes.colour]);
        for (t, of_column) in of_block.iter_mut().enumerate() {
            let at = nodes.within(&equations.layout, t).start;
            let q = &mut q[at - *first..][..BLOCK];
            let [before, now] = &mut of_column.charge;
            K::round(&mut of_column.increment, &d[at..at + BLOCK]);
            before.copy_from_slice(q);
            K::round(q, sums.of_column(&equations.layout, t, BLOCK));
            hold(simd, q, equations.inverse(nodes));
            now.copy_from_slice(q);
        }
        changes.of_increment.change(simd, of_block);
    }
}

impl Changes {
    /// Adds by how much those of a block changed.
    #[inline(always)]
    fn add<S: Simd>(&mut self, simd: S, of_block: &[OfColumn]) {
        for (t, of_t) in of_block.iter().enumerate() {
            let [before, now] = &of_t.residual;
            let (mut change, mut sum) = (Partial::default(), Partial::default());
            for node in 0..BLOCK {
                let [before, now] = [f64::from(before[node]), f64::from(now[node])];
                change[node] = now - before;
                sum[node] = now + before;
            }
            add_product(simd, &mut self.residual[t], &sum, &change);
            for (s, of_s) in of_block[..=t].iter().enumerate() {
                let product = &mut self.products[s * of_block.len() + t];
                add_product(simd, product, &of_s.potential, &change);
            }
        }
    }
}

/// The sum is more by a b.
#[inline(always)]
fn add_product<S: Simd>(simd: S, sum: &mut Partial, a: &Partial, b: &Partial) {
    let (sum, a, b) = (S::as_mut_simd_f64s(sum).0, S::as_simd_f64s(a).0, S::as_simd_f64s(b).0);
    for ((sum, a), b) in sum.iter_mut().zip(a).zip(b) {
        *sum = simd.add_f64s(*sum, simd.mul_f64s(*a, *b));
    }
}

/// A block of numbers in double precision.
#[inline(always)]
fn widened<T: Copy + Into<f64>>(of: &[T]) -> Partial {
    let mut to = Partial::default();
    for node in 0..BLOCK {
        to[node] = of[node].into();
    }
    to
}
