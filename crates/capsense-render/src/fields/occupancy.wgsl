// From surfaces to rows of K: core's `occupancy/mod.rs` and `stiffness/mod.rs`. Each frame all nodes are looked at anew; what an
// edge becomes is found at both of its ends, by the same steps from its first node, so no edge needs to be kept.

struct Lattice {
    planes_at: vec3<u32>, nodes_at: u32,
    weights_at: u32, permittivity_at: u32, permittivity_stride: u32, electrodes: u32,
    links_at: u32, flags_len: u32, alike_at: u32, cells_at: u32,
}
struct Camera { size: vec2<u32>, pixels_per_metre: vec2<f32>, depths: vec2<f32>, jump: f32, back_fill: u32 }
// The part of a segment in an object, from 0 to 1; nothing where `enter` is more than `leave`.
struct Span { enter: f32, leave: f32 }

@group(1) @binding(0) var<uniform> lattice: Lattice;
@group(1) @binding(1) var<uniform> camera: Camera;
@group(1) @binding(2) var<storage, read> tables: array<u32>;
@group(1) @binding(3) var<storage, read> sources: array<f32>;
@group(1) @binding(4) var<storage, read_write> found: array<u32>;
@group(1) @binding(5) var<storage, read_write> flags: array<atomic<u32>>;

const NO_OBJECT: u32 = 0xffffu;
const HELD_AT_ZERO: u32 = 0xfffffffeu;
// Words of a link in the tables.
const LINK_WORDS: u32 = 4u;
// As the host's numbers of terminals.
const FREE: u32 = 0xffffu;
const GROUND: u32 = 0u;
const MISSED: Span = Span(1.0f, 0.0f);

// An object's words: what it is, between which planes, and what the geometry source needs.
const KIND: u32 = 0u;
const PERMITTIVITY: u32 = 1u;
const HOLDER: u32 = 2u;
const FIRST_PLANE: u32 = 3u;
const LAST_PLANE: u32 = 6u;
const OWN: u32 = 9u;
const IS_SEEN: u32 = 1u;
const IS_CONDUCTOR: u32 = 2u;

// A node's words in `found`, FOUND of them: the conductor that holds it, what its three edges are like, to tell whether they
// change, and what a geometry source keeps there.
// A scene's flags: a bit for each column whose object is there, the number of edges that changed, and a bit for each object and
// electrode that touch.
const PRESENT: u32 = 0u;
const CHANGED: u32 = 1u;
const CONTACTS: u32 = 2u;

// The scene's objects.
var<private> objects: u32;
var<private> objects_at: u32;

fn object_word(object: u32, word: u32) -> u32 { return changes[objects_at + object * OBJECT_WORDS + word]; }

fn object_number(object: u32, word: u32) -> f32 { return bitcast<f32>(object_word(object, word)); }

fn is_conductor(object: u32) -> bool { return (object_word(object, KIND) & IS_CONDUCTOR) != 0u; }

fn permittivity_of(object: u32) -> f32 { return object_number(object, PERMITTIVITY); }

// Whether an object may be between some planes.
fn is_near(object: u32, low: vec3<u32>, high: vec3<u32>) -> bool {
    if ((object_word(object, KIND) & IS_SEEN) == 0u) { return false; }
    for (var axis = 0u; axis < 3u; axis++) {
        if (high[axis] < object_word(object, FIRST_PLANE + axis) || low[axis] > object_word(object, LAST_PLANE + axis)) { return false; }
    }
    return true;
}

// A plane's words: where it is, in two parts; the way to the next; its pixel and where in it; what its dual length is multiplied by.
const PLANE: u32 = 6u;
fn plane_at(axis: u32, number: u32) -> u32 { return lattice.planes_at[axis] + PLANE * number; }

fn way_after(axis: u32, number: u32) -> f32 { return bitcast<f32>(tables[plane_at(axis, number) + 2u]); }

fn way_before(axis: u32, number: u32) -> f32 {
    if (number == 0u) { return 0.0; }
    return way_after(axis, number - 1u);
}

// What no object can take: the electrode, ground, or nothing.
fn owner_of(node: u32) -> u32 { return tables[lattice.nodes_at + 2u * node] >> 16u; }

fn terminal_of(node: u32) -> u32 { return tables[lattice.nodes_at + 2u * node] & 0xffffu; }

fn is_electrode(owner: u32) -> bool { return owner != FREE && owner != GROUND; }

fn base_weight(axis: u32, node: u32) -> f32 {
    return bitcast<f32>(tables[lattice.weights_at + axis * plan.grids[0].nodes + node]);
}

fn background_at(axis: u32, node: u32) -> f32 {
    return bitcast<f32>(tables[lattice.permittivity_at + lattice.permittivity_stride * (axis * plan.grids[0].nodes + node)]);
}

fn background_in(cell: vec3<u32>, around: f32) -> f32 {
    let cells = plan.grids[0].counts - 1u;
    let number = (cell.z * cells.y + cell.y) * cells.x + cell.x;
    return bitcast<f32>(tables[lattice.cells_at + lattice.permittivity_stride * number]);
}

fn conductor_at(node: u32) -> u32 { return found[FOUND * (in_holders + node)]; }

fn take_objects() -> bool {
    let header = scene_header();
    objects = header.objects;
    objects_at = header.objects_at;
    return header.is_placed == 1u;
}

fn flag_at(number: u32) -> u32 { return scene * lattice.flags_len + number; }

// The conductor that holds each node: of several the first listed.
fn find_holders() {
    if (!take_objects()) { return; }
    for (var number = first; number < lattice.flags_len; number += every) { atomicStore(&flags[flag_at(number)], 0u); }
    let grid = plan.grids[0];
    for (var node = first; node < grid.nodes; node += every) {
        var holder = NO_OBJECT;
        if (owner_of(node) == FREE) {
            let place = place_of(grid, node);
            for (var object = 0u; object < objects && holder == NO_OBJECT; object++) {
                if (!is_conductor(object) || !is_near(object, place, place)) { continue; }
                set_anchor(place);
                if (object_contains(object, vec3<f32>())) { holder = object; }
            }
        }
        found[FOUND * (in_holders + node)] = holder;
    }
}

fn coupling_of(grid: Grid, place: vec3<u32>, axis: u32, is_own: bool) -> Coupling {
    let edge = Edge(place, axis, way_after(axis, place[axis]));
    let node = node_at(grid, place);
    let ends = vec2<u32>(node, node + steps(grid)[axis]);
    let owners = vec2<u32>(conductor_at(ends.x), conductor_at(ends.y));
    let background = background_at(axis, node);
    set_anchor(place);
    let is_any = find_spans(edge, vec3<f32>());
    let around = Surroundings(edge, ends, owners, background, spans);
    let electrodes = vec2<u32>(owner_of(ends.x), owner_of(ends.y));
    if (is_own && is_any) { note_contacts(electrodes); }
    let is_free = all(owners == vec2<u32>(NO_OBJECT));
    var cut = PLAIN;
    if (is_any || !is_free) { cut = edge_rule(owners, background); }
    if (HAS_LINES && is_free && all_lined()) {
        let is_along = axis != 2u && (is_electrode(electrodes.x) || is_electrode(electrodes.y));
        let lines = along_lines(around, is_along);
        if (lines >= 0.0) { return only_through(on_strong(around, lines)); }
    }
    return with_surroundings(around, cut);
}

// Conductors that fill an edge up to an end that an electrode has.
fn note_contacts(electrodes: vec2<u32>) {
    for (var object = 0u; object < objects; object++) {
        if (!is_met(object) || !is_conductor(object)) { continue; }
        let touches = vec2<bool>((spans[object].enter < SMALLEST_PART), (spans[object].leave > 1.0 - SMALLEST_PART));
        for (var end = 0u; end < 2u; end++) {
            if (touches[end] && is_electrode(electrodes[end])) {
                let bit = object * lattice.electrodes + electrodes[end] - 1u;
                atomicOr(&flags[flag_at(CONTACTS + bit / 32u)], 1u << (bit % 32u));
            }
        }
    }
}

// A number that differs where couplings or conductors at the ends do; zero for an edge as in the empty scene.
fn likeness(coupling: Coupling, owners: vec2<u32>) -> u32 {
    let plain = bitcast<u32>(1.0f);
    let numbers = vec3<u32>(bitcast<u32>(coupling.through) ^ plain, bitcast<u32>(coupling.factor.x), bitcast<u32>(coupling.factor.y));
    let conductors = vec4<u32>(coupling.object, owners) ^ vec4<u32>(NO_OBJECT);
    return (numbers.x * 0x9e3779b1u) ^ (numbers.y * 0x85ebca77u) ^ (numbers.z * 0xc2b2ae3du)
        ^ (conductors.x * 0x27d4eb2fu) ^ (conductors.y * 0x165667b1u) ^ (conductors.z * 0xd3a2646du) ^ (conductors.w * 0xfd7046c5u);
}

// A row of K while its links are summed up.
struct Sums { leak: f32, feeds: array<f32, COLUMNS> }

fn add_link(sums: ptr<function, Sums>, weight: f32, holder: u32) {
    (*sums).leak += weight;
    if (holder < COLUMNS) { (*sums).feeds[holder] += weight; }
}

// Thin electrodes are across this axis.
const ELECTRODE_NORMAL: u32 = 2u;

// Links between a node and the electrodes whose rim it is at, and ground beyond an open wall: they grow as the mean permittivity
// around the node does, and by what conductors add to the weights of edges across the electrode as they come nearer than rows are
// apart, as far as that covers the node.
fn add_own_links(sums: ptr<function, Sums>, node: u32, ratio: f32, nearer: f32) {
    let word = tables[lattice.nodes_at + 2u * node + 1u];
    let start = lattice.links_at + LINK_WORDS * (word / 16u);
    for (var link = 0u; link < word % 16u; link++) {
        let at = start + LINK_WORDS * link;
        let weight = ratio * bitcast<f32>(tables[at + 1u]) + nearer * bitcast<f32>(tables[at + 2u]);
        add_link(sums, weight, tables[at]);
    }
}

// One over the least distance between rows along the rims that a node is at; zero at none.
fn rows_per_metre(node: u32) -> f32 {
    let word = tables[lattice.nodes_at + 2u * node + 1u];
    var most = 0.0f;
    for (var link = 0u; link < word % 16u; link++) {
        most = max(most, bitcast<f32>(tables[lattice.links_at + LINK_WORDS * (word / 16u + link) + 3u]));
    }
    return most;
}

fn is_near_any(place: vec3<u32>) -> bool {
    let low = max(place, vec3<u32>(1u)) - 1u;
    for (var object = 0u; object < objects; object++) {
        if (is_near(object, low, place + 1u)) { return true; }
    }
    return false;
}

// The row of a node that objects are near.
fn find_row(grid: Grid, node: u32, place: vec3<u32>, next: ptr<function, vec3<f32>>, sums: ptr<function, Sums>) {
    var links: array<vec2<u32>, 6>;
    var means = vec2<f32>();
    var nearer = 0.0f;
    let of_rows = rows_per_metre(node);
    var changed = 0u;
    for (var number = 0u; number < 6u; number++) {
        let axis = number / 2u;
        let is_own = number % 2u == 1u;
        links[number] = vec2<u32>(0u, NO_OBJECT);
        if (!is_own && place[axis] == 0u) { continue; }
        var start = place;
        if (!is_own) { start[axis] -= 1u; }
        let at = node_at(grid, start);
        let weight = base_weight(axis, at);
        if (weight <= 0.0) { continue; }
        let coupling = coupling_of(grid, start, axis, is_own);
        let owners = vec2<u32>(conductor_at(at), conductor_at(at + steps(grid)[axis]));
        if (is_own) {
            (*next)[axis] = weight * coupling.through;
            let now = likeness(coupling, owners);
            let place_of_likeness = FOUND * (in_holders + node) + 1u + axis;
            changed += select(0u, 1u, found[place_of_likeness] != now);
            found[place_of_likeness] = now;
        }
        let end = select(1u, 0u, is_own);
        links[number] = vec2<u32>(bitcast<u32>(weight * coupling.factor[end]), coupling.object[end]);
        if (axis == ELECTRODE_NORMAL) {
            let through = select(0.0, coupling.through, owners[1u - end] != NO_OBJECT);
            let way = way_after(axis, start[axis]);
            nearer += weight * max(coupling.factor[end] + through - max(way * of_rows, 1.0), 0.0);
        }
        let is_linked = any(coupling.object != vec2<u32>(NO_OBJECT));
        if (!is_linked && all(owners == vec2<u32>(NO_OBJECT))) { means += weight * vec2<f32>(coupling.through, 1.0); }
    }
    add_own_links(sums, node, select(1.0, means.x / max(means.y, LEAST), means.y > 0.0), nearer);
    for (var number = 0u; number < 6u; number++) {
        if (links[number].y == NO_OBJECT) { continue; }
        let holder = object_word(links[number].y, HOLDER);
        add_link(sums, bitcast<f32>(links[number].x), holder);
        if (holder < COLUMNS) { atomicOr(&flags[flag_at(PRESENT)], 1u << holder); }
    }
    if (changed > 0u) { atomicAdd(&flags[flag_at(CHANGED)], changed); }
}

// The same where no object is near.
fn empty_row(node: u32, sums: ptr<function, Sums>) {
    var changed = 0u;
    for (var axis = 0u; axis < 3u; axis++) {
        let at = FOUND * (in_holders + node) + 1u + axis;
        changed += select(0u, 1u, found[at] != 0u);
        found[at] = 0u;
    }
    add_own_links(sums, node, 1.0, 0.0);
    if (changed > 0u) { atomicAdd(&flags[flag_at(CHANGED)], changed); }
}

// Columns of objects that are nowhere.
fn absent_columns() -> u32 {
    let header = scene_header();
    if (header.is_found == 0u) { return 0u; }
    return header.columns & ~atomicLoad(&flags[flag_at(PRESENT)]);
}

// What holds a node's potential: a column, zero in all of them, or nothing.
fn holder_at(node: u32) -> u32 {
    let object = conductor_at(node);
    if (object != NO_OBJECT) {
        let holder = object_word(object, HOLDER);
        if (holder < COLUMNS) { atomicOr(&flags[flag_at(PRESENT)], 1u << holder); }
        return holder;
    }
    let terminal = terminal_of(node);
    if (terminal == FREE) { return NO_HOLDER; }
    return select(terminal - 1u, HELD_AT_ZERO, terminal == GROUND);
}

// Rows of all nodes, links and potentials of what is held. What no longer is keeps its potential as a first guess.
fn find_rows() {
    if (!take_objects()) { return; }
    let grid = plan.grids[0];
    let stride = plan.levels[0].stride;
    for (var node = first; node < grid.nodes; node += every) {
        let place = place_of(grid, node);
        var next = vec3<f32>(base_weight(0u, node), base_weight(1u, node), base_weight(2u, node));
        var sums: Sums;
        if (is_near_any(place)) { find_row(grid, node, place, &next, &sums); } else { empty_row(node, &sums); }
        let holder = holder_at(node);
        let is_free = holder == NO_HOLDER;
        let row = in_networks + grid.at + node;
        for (var axis = 0u; axis < 3u; axis++) { networks[row + axis * grid.stride] = next[axis]; }
        networks[row + 3u * grid.stride] = select(FIXED, sums.leak, is_free);
        vectors[in_vectors + plan.leak + node] = sums.leak;
        holders[in_holders + node] = holder;
        for (var column = 0u; column < COLUMNS; column++) {
            let at = in_vectors + column * stride + node;
            vectors[at + plan.feed] = sums.feeds[column];
            if (!is_free) { vectors[at + plan.potential] = select(0.0, 1.0, holder == column); }
        }
    }
}

@compute @workgroup_size(256)
fn step_holders(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    find_holders();
}

@compute @workgroup_size(256)
fn step_rows(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    find_rows();
}
