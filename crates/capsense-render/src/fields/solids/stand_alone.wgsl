// What the files before ask for, and a kernel for each step.

struct Material { kind: u32, permittivity: f32 }
// `threads` is the number of nodes, or of segments.
struct Told { counts: vec3<u32>, threads: u32, objects: u32 }

@group(0) @binding(0) var<uniform> told: Told;
@group(0) @binding(1) var<storage, read> planes: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> marks: array<u32>;
@group(0) @binding(3) var<storage, read> backgrounds: array<f32>;
@group(0) @binding(4) var<storage, read> solids: array<u32>;
@group(0) @binding(5) var<storage, read> materials: array<Material>;
@group(0) @binding(6) var<storage, read> trees: array<f32>;
@group(0) @binding(7) var<storage, read_write> conductors: array<u32>;
@group(0) @binding(8) var<storage, read_write> wedges: array<vec4<u32>>;
@group(0) @binding(9) var<storage, read_write> couplings: array<vec4<u32>>;

// The part of a segment in an object, from 0 to 1; nothing where `enter` is more than `leave`.
struct Span { enter: f32, leave: f32 }
const NO_OBJECT: u32 = 0xffffu;
const MISSED: Span = Span(1.0f, 0.0f);
const LEAST: f32 = 1e-38f;
var<private> objects: u32;

const OF_SENSOR: u32 = 1u;
const OF_ELECTRODE: u32 = 2u;
const HOMOGENEOUS: u32 = 4u;
const CONDUCTOR: u32 = 0u;

fn plane_counts() -> vec3<u32> { return told.counts; }
fn plane_number(axis: u32, index: u32) -> u32 {
    return select(0u, told.counts.x, axis > 0u) + select(0u, told.counts.y, axis > 1u) + index;
}
fn plane_of(axis: u32, index: u32) -> vec3<f32> { return planes[plane_number(axis, index)].xyz; }
fn dual_length_of(axis: u32, index: u32) -> f32 { return planes[plane_number(axis, index)].w; }
fn way_after(axis: u32, number: u32) -> f32 { return plane_of(axis, number).z; }
// Nothing is told of cells.
fn background_in(cell: vec3<u32>, around: f32) -> f32 { return around; }
fn way_before(axis: u32, number: u32) -> f32 {
    if (number == 0u) { return 0.0; }
    return way_after(axis, number - 1u);
}
fn is_near(object: u32, low: vec3<u32>, high: vec3<u32>) -> bool {
    let solid = solid_of(object);
    let start = from_origin(solid, spot_of(low));
    let end = from_origin(solid, spot_of(min(high, plane_counts() - 1u)));
    return is_in_bounds(solid, 0.5 * (start + end), 0.5 * (end - start));
}
fn solid_word(object: u32, number: u32) -> u32 { return solids[SOLID_WORDS * object + number]; }
fn tree_number(at: u32) -> f32 { return trees[at]; }
fn is_conductor(object: u32) -> bool { return materials[object].kind == CONDUCTOR; }
fn permittivity_of(object: u32) -> f32 { return materials[object].permittivity; }
fn is_sensors(node: u32) -> bool { return (marks[node] & OF_SENSOR) != 0u; }
fn is_electrodes(node: u32) -> bool { return (marks[node] & OF_ELECTRODE) != 0u; }
fn is_homogeneous(node: u32) -> bool { return (marks[node] & HOMOGENEOUS) != 0u; }
fn conductor_at(node: u32) -> u32 { return conductors[node]; }
fn place_of_node(node: u32) -> vec3<u32> {
    let counts = plane_counts();
    let row = node / counts.x;
    return vec3<u32>(node - row * counts.x, row % counts.y, row / counts.y);
}

fn wedge_of(node: u32) -> Wedge {
    let words = wedges[node];
    return of_words(words);
}

fn coupling_of(place: vec3<u32>, axis: u32) -> Coupling {
    let edge = Edge(place, axis, way_after(axis, place[axis]));
    let node = dot(place, node_steps());
    let ends = vec2<u32>(node, node + node_steps()[axis]);
    let owners = vec2<u32>(conductors[ends.x], conductors[ends.y]);
    let background = backgrounds[3u * node + axis];
    set_anchor(place);
    let is_any = find_spans(edge, vec3<f32>());
    let around = Surroundings(edge, ends, owners, background, spans);
    let is_free = all(owners == UNLINKED);
    var cut = PLAIN;
    if (is_any || !is_free) { cut = edge_rule(owners, background); }
    if (is_free && all_lined()) {
        let is_along = axis != 2u && (is_electrodes(ends.x) || is_electrodes(ends.y));
        let lines = along_lines(around, is_along);
        if (lines >= 0.0) { return only_through(on_strong(around, lines)); }
    }
    return with_surroundings(around, cut);
}

// Instead of edges, segments from one point to another, each point a word of four numbers; what they have in the first object
// stands in the first of the two afterwards.
@compute @workgroup_size(64)
fn find_segments(@builtin(global_invocation_id) id: vec3<u32>) {
    if (id.x >= told.threads) { return; }
    let solid = solid_of(0u);
    let a = in_frame(solid, Spot(bitcast<vec3<f32>>(couplings[2u * id.x].xyz), vec3<f32>()));
    let b = in_frame(solid, Spot(bitcast<vec3<f32>>(couplings[2u * id.x + 1u].xyz), vec3<f32>()));
    let span = solid_span(solid, a, b);
    let is_in = select(0u, 1u, solid_contains(solid, a));
    couplings[2u * id.x] = vec4<u32>(bitcast<u32>(span.enter), bitcast<u32>(span.leave), is_in, 0u);
}

@compute @workgroup_size(64)
fn find_conductors(@builtin(global_invocation_id) id: vec3<u32>) {
    let node = id.x;
    objects = told.objects;
    if (node >= told.threads) { return; }
    var holder = NO_OBJECT;
    if (!is_sensors(node)) {
        set_anchor(place_of_node(node));
        for (var object = 0u; object < objects && holder == NO_OBJECT; object++) {
            if (is_conductor(object) && object_contains(object, vec3<f32>())) { holder = object; }
        }
    }
    conductors[node] = holder;
}

@compute @workgroup_size(64)
fn find_wedges(@builtin(global_invocation_id) id: vec3<u32>) {
    let node = id.x;
    objects = told.objects;
    if (node >= told.threads) { return; }
    var wedge = NO_WEDGE;
    if (conductors[node] == NO_OBJECT) { wedge = wedge_at(star_at(node, place_of_node(node))); }
    wedges[node] = in_words(wedge);
}

@compute @workgroup_size(64)
fn find_couplings(@builtin(global_invocation_id) id: vec3<u32>) {
    let node = id.x;
    objects = told.objects;
    if (node >= told.threads) { return; }
    let star = star_at(node, place_of_node(node));
    for (var axis = 0u; axis < 3u; axis++) {
        var coupling = PLAIN;
        if (star.above[axis] > 0.0) { coupling = coupling_of(star.place, axis); }
        let objects = coupling.object.x | (coupling.object.y << 16u);
        couplings[3u * node + axis] = vec4<u32>(bitcast<u32>(coupling.through), bitcast<u32>(coupling.factor.x), bitcast<u32>(coupling.factor.y), objects);
    }
}
