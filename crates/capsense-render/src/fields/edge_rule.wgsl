// What objects make of an edge: core's `occupancy/coupling.rs` and `occupancy/parallel.rs`, which say what the rules are.
//
// Points and spans are those of the file before this one, a geometry source, which has
//     fn set_anchor(place: vec3<u32>)
//     fn object_contains(object: u32, point: vec3<f32>) -> bool
//     fn object_span(object: u32, edge: Edge, shift: vec3<f32>) -> Span, of the segment beside an edge from the anchor
//     fn object_fill(object: u32, edge: Edge, shift: vec3<f32>, reach: vec2<f32>) -> Fill, of a bar about that segment that reaches so far across
//     fn gap_to(object: u32, edge: Edge, along: f32, to_next: vec2<f32>) -> f32, from a place on an edge to an object in one direction
//     fn is_round(object: u32) -> bool, whether it has no edges
//     fn on_strong(around: Surroundings, lines: f32) -> f32, of an edge on which dielectrics are, of which lines make `lines`
//     fn with_surroundings(around: Surroundings, cut: Coupling) -> Coupling
//     fn background_in(cell: vec3<u32>, around: f32) -> f32, of a cell beside an edge around which it is that on average
// all points and shifts relative to the anchor, a node given by its planes, in metres. The last tells what else a source knows to be
// around an edge of which surfaces on it leave `cut`.

// No edge is shortened to less than this part of its length.
const SMALLEST_PART: f32 = 1e-3f;
// Dielectrics below this relative permittivity are weak.
const WEAK: f32 = 10.0f;

// What is left of an edge: what multiplies its weight between its ends, and in links from either end to an object.
struct Coupling { through: f32, factor: vec2<f32>, object: vec2<u32> }

const PLAIN: Coupling = Coupling(1.0f, vec2<f32>(0.0f, 0.0f), vec2<u32>(NO_OBJECT, NO_OBJECT));

// By object: the part of the segment at hand that it fills.
var<private> spans: array<Span, OBJECTS>;

fn is_met(object: u32) -> bool { return spans[object].enter <= spans[object].leave; }

fn only_through(through: f32) -> Coupling {
    return Coupling(through, vec2<f32>(), vec2<u32>(NO_OBJECT));
}

// ∫ ε_background/ε dt: parts in series. Where dielectrics overlap, the first listed counts.
fn series(a: f32, b: f32, background: f32) -> f32 {
    let last = max(b, a + SMALLEST_PART);
    var sum = 0.0;
    var start = a;
    while (start < last) {
        var end = last;
        for (var object = 0u; object < objects; object++) {
            if (!is_met(object) || is_conductor(object)) { continue; }
            let span = spans[object];
            if (span.enter > start && span.enter < end) { end = span.enter; }
            if (span.leave > start && span.leave < end) { end = span.leave; }
        }
        let middle = 0.5 * (start + end);
        var ratio = 1.0;
        for (var object = 0u; object < objects; object++) {
            if (!is_met(object) || is_conductor(object)) { continue; }
            if (spans[object].enter <= middle && middle <= spans[object].leave) {
                ratio = permittivity_of(object) / background;
                break;
            }
        }
        sum += (end - start) / ratio;
        start = end;
    }
    return sum;
}

// The edge rule for the spans as they are; `owners` are the conductors that hold the ends.
fn edge_rule(owners: vec2<u32>, background: f32) -> Coupling {
    var met = owners;
    var place = vec2<f32>(0.0, 1.0);
    for (var object = 0u; object < objects; object++) {
        if (!is_met(object) || !is_conductor(object)) { continue; }
        let span = spans[object];
        if (owners.x == NO_OBJECT && (met.x == NO_OBJECT || span.enter < place.x)) {
            met.x = object;
            place.x = span.enter;
        }
        if (owners.y == NO_OBJECT && (met.y == NO_OBJECT || span.leave > place.y)) {
            met.y = object;
            place.y = span.leave;
        }
    }
    // An end that a conductor holds is a contact even where the surface's own answer misses it by rounding.
    let held = select(owners.y, owners.x, owners.x != NO_OBJECT);
    if (met.x == NO_OBJECT) { met.x = held; place.x = 1.0; }
    if (met.y == NO_OBJECT) { met.y = held; place.y = 0.0; }
    if (met.x == NO_OBJECT || met.y == NO_OBJECT) {
        return only_through(1.0 / series(0.0, 1.0, background));
    }
    let is_held = owners != vec2<u32>(NO_OBJECT);
    if (all(is_held)) {
        if (owners.x == owners.y) { return PLAIN; }
        let leave = select(0.0, spans[owners.x].leave, is_met(owners.x));
        let enter = select(1.0, spans[owners.y].enter, is_met(owners.y));
        return only_through(1.0 / series(leave, enter, background));
    }
    if (is_held.x && met.y == owners.x) { return only_through(1.0 / series(place.y, 1.0, background)); }
    if (is_held.y && met.x == owners.y) { return only_through(1.0 / series(0.0, place.x, background)); }
    var coupling = only_through(0.0);
    if (!is_held.x) {
        coupling.object.x = met.x;
        coupling.factor.x = 1.0 / series(0.0, place.x, background);
    }
    if (!is_held.y) {
        coupling.object.y = met.y;
        coupling.factor.y = 1.0 / series(place.y, 1.0, background);
    }
    return coupling;
}

// An edge of the lattice: its first node, its axis, and its length.
struct Edge { place: vec3<u32>, axis: u32, length: f32 }

// An edge with its ends, the conductors that hold these, the background's permittivity, and what fills it.
struct Surroundings { edge: Edge, ends: vec2<u32>, owners: vec2<u32>, background: f32, on_edge: array<Span, OBJECTS> }

fn along(edge: Edge) -> vec3<f32> {
    var way = vec3<f32>();
    way[edge.axis] = edge.length;
    return way;
}

// What of a bar is in an object: a part of its cross-section over a part of its length.
struct Fill { part: f32, span: Span }

// Finds what fills the segment beside an edge, and returns whether anything does.
fn find_spans(edge: Edge, shift: vec3<f32>) -> bool {
    var is_any = false;
    for (var object = 0u; object < objects; object++) {
        spans[object] = MISSED;
        if (is_beside(object, edge)) {
            spans[object] = object_span(object, edge, shift);
            is_any = is_any || is_met(object);
        }
    }
    return is_any;
}

// Whether an object may be in the cells around an edge.
fn is_beside(object: u32, edge: Edge) -> bool {
    var end = edge.place + 1u;
    var start = vec3<u32>(max(edge.place, vec3<u32>(1u)) - 1u);
    start[edge.axis] = edge.place[edge.axis];
    return is_near(object, start, end);
}

fn is_weak(object: u32) -> bool { return !is_conductor(object) && permittivity_of(object) < WEAK; }

// Whether an object is a dielectric that is taken along lines.
fn is_lined(object: u32) -> bool { return is_weak(object) || (IS_EXACT && !is_conductor(object)); }

fn all_lined() -> bool {
    for (var object = 0u; object < objects; object++) {
        if (is_met(object) && !is_lined(object)) { return false; }
    }
    return true;
}

// How strong a dielectric is: core's `occupancy/parallel/strong.rs`.
fn strength_of(object: u32, background: f32) -> f32 {
    if (is_conductor(object)) { return 0.0; }
    let weakness = WEAK * background / permittivity_of(object);
    return max(1.0 - weakness * weakness, 0.0);
}

// Where lines pass a quarter, in parts of half its widths from its middle.
const PLACES = array<vec2<f32>, 4>(vec2<f32>(-0.75f, -0.25f), vec2<f32>(-0.25f, 0.75f), vec2<f32>(0.25f, -0.75f), vec2<f32>(0.75f, 0.25f));

// How far what a line stands for reaches beside it, in the same parts.
const REACH: f32 = 0.25f;

// From an edge to a line of the quarter that reaches half of the ways to the next edges.
fn shift_to(edge: Edge, to_next: vec2<f32>, line: u32) -> vec3<f32> {
    var shift = vec3<f32>();
    shift[(edge.axis + 1u) % 3u] = 0.25 * to_next.x * (1.0 + PLACES[line].x);
    shift[(edge.axis + 2u) % 3u] = 0.25 * to_next.y * (1.0 + PLACES[line].y);
    return shift;
}

// What of a line of such a quarter is in an object, as a bar of a quarter of the quarter's widths.
fn line_fill(object: u32, edge: Edge, to_next: vec2<f32>, line: u32) -> Fill {
    let reach = REACH * 0.25 * abs(to_next);
    return object_fill(object, edge, shift_to(edge, to_next, line), reach);
}

// By object: the gap between an edge and the part of a strong one in a quarter, as far as it counts, in parts of the edge; and how much its
// lines count.
fn passed_by(around: Surroundings, to_next: vec2<f32>, background: f32) -> array<vec2<f32>, OBJECTS> {
    var gaps: array<vec2<f32>, OBJECTS>;
    var on_edge = around.on_edge;
    for (var object = 0u; object < objects; object++) {
        gaps[object] = vec2<f32>(0.0, 1.0);
        let strength = strength_of(object, background);
        let own = on_edge[object];
        if (strength == 0.0 || own.enter <= own.leave || !is_beside(object, around.edge)) { continue; }
        if (is_round(object)) {
            gaps[object].y = 1.0 - strength;
            continue;
        }
        var all = 0.0;
        var sum = 0.0;
        for (var line = 0u; line < 4u; line++) {
            let fill = line_fill(object, around.edge, to_next, line);
            let filled = fill.part * max(fill.span.leave - fill.span.enter, 0.0);
            all += filled;
            sum += 0.5 * filled * (fill.span.enter + fill.span.leave);
        }
        if (all > 0.0) { gaps[object].x = strength * gap_to(object, around.edge, sum / all, to_next); }
    }
    return gaps;
}

// What multiplies the weight of a free edge that dielectrics alone are near, by parallel lines; less than nothing where
// nothing is, or others are. The spans of the edge itself are lost.
fn along_lines(around: Surroundings, is_along_electrode: bool) -> f32 {
    let edge = around.edge;
    let u = (edge.axis + 1u) % 3u;
    let v = (edge.axis + 2u) % 3u;
    let steps_u = vec2<f32>(-way_before(u, edge.place[u]), way_after(u, edge.place[u]));
    let steps_v = vec2<f32>(-way_before(v, edge.place[v]), way_after(v, edge.place[v]));
    var sum = 0.0;
    var whole = 0.0;
    var is_any = false;
    for (var number = 0u; number < 4u; number++) {
        let to_u = steps_u[number / 2u];
        let to_v = steps_v[number % 2u];
        let area = 0.25 * abs(to_u * to_v);
        if (area == 0.0) { continue; }
        var cell = edge.place;
        cell[u] -= select(1u, 0u, number / 2u == 1u);
        cell[v] -= select(1u, 0u, number % 2u == 1u);
        let of_cell = background_in(cell, around.background);
        let share = area * of_cell;
        let to_next = vec2<f32>(to_u, to_v);
        var gaps: array<vec2<f32>, OBJECTS>;
        if (HAS_STRONG) { gaps = passed_by(around, to_next, of_cell); }
        var of_lines = 0.0;
        for (var line = 0u; line < 4u; line++) {
            var fills: array<Fill, OBJECTS>;
            for (var object = 0u; object < objects; object++) {
                fills[object] = Fill(0.0, MISSED);
                if (is_conductor(object) || !is_beside(object, edge)) { continue; }
                fills[object] = line_fill(object, edge, to_next, line);
                is_any = is_any || fills[object].part > 0.0;
            }
            // What fills more of a line's cross-section is all around what fills less of it.
            var rest = 1.0;
            while (rest > 0.0) {
                var next = 0.0;
                var gap = 0.0;
                var part = 1.0;
                for (var object = 0u; object < objects; object++) {
                    let fill = fills[object];
                    spans[object] = MISSED;
                    if (fill.part < rest) {
                        next = max(next, fill.part);
                        continue;
                    }
                    spans[object] = fill.span;
                    if (HAS_STRONG) {
                        gap = max(gap, (fill.span.leave - fill.span.enter) * gaps[object].x);
                        part = min(part, gaps[object].y);
                    }
                }
                if (!all_lined()) { return -1.0; }
                var through = edge_rule(vec2<u32>(NO_OBJECT), of_cell).through;
                if (gap > 0.0 && through > 1.0) { through = 1.0 / min(1.0 / through + gap, 1.0); }
                if (part < 1.0) { through = 1.0 + part * (through - 1.0); }
                of_lines += (rest - next) * select(through, 1.0 / through, is_along_electrode);
                rest = next;
            }
        }
        let mean = 0.25 * of_lines;
        sum += share * select(mean, 1.0 / mean, is_along_electrode);
        whole += share;
    }
    return select(-1.0, sum / max(whole, LEAST), is_any && whole > 0.0);
}
