// What solids make of one edge of a lattice: the edge rule, faces of strong dielectrics in which it lies, walls of conductors beside
// it, and what the field near edges of conductors and before round ones makes of its ends. `Occupancy::update_edge` of the core.
// Beside what the files before ask for:
//   fn background_of(edge: u32) -> f32
//   fn is_electrodes(node: u32) -> bool, whether an electrode has it
//   fn wedge_of(node: u32) -> Wedge

// Dielectrics below this relative permittivity are weak.
const WEAK: f32 = 10.0;

fn is_weak(object: u32) -> bool { return !is_conductor(object) && permittivity_of(object) < WEAK; }

// One edge from a node along an axis: its ends, and what holds these.
struct Edge {
    number: u32, axis: u32, star: Star,
    ends: vec2<u32>, begin: Spot, end: Spot,
    owners: vec2<u32>, background: f32,
}

fn edge_from(star: Star, axis: u32) -> Edge {
    var edge: Edge;
    edge.number = 3u * star.node + axis;
    edge.axis = axis;
    edge.star = star;
    edge.ends = vec2<u32>(star.node, star.node + node_steps()[axis]);
    var next = star.place;
    next[axis] += 1u;
    edge.begin = spot_of(star.place);
    edge.end = spot_of(next);
    edge.owners = vec2<u32>(conductor_at(edge.ends.x), conductor_at(edge.ends.y));
    edge.background = background_of(edge.number);
    return edge;
}

// Whether a conductor may be between the two ends of an edge, or a dielectric: boxes around them meet it.
fn any_object_near(edge: Edge) -> bool {
    // All that lines and walls beside an edge may meet.
    let low = -max(edge.star.below, vec3<f32>(0.0));
    let middle = 0.5 * (low + edge.star.above);
    let half = 0.5 * (edge.star.above - low);
    for (var object = 0u; object < object_count(); object++) {
        let solid = solid_of(object);
        if (is_in_bounds(solid, from_origin(solid, edge.begin) + middle, half)) { return true; }
    }
    return false;
}

// How dielectrics fill a box: not at all, some all of it and the others nothing, or perhaps in part.
const NOTHING: u32 = 0u;
const EVEN: u32 = 1u;
const UNEVEN: u32 = 2u;

// The box is given by its middle from the edge's start and half its size.
fn filling(edge: Edge, middle: vec3<f32>, half: vec3<f32>) -> u32 {
    var found = NOTHING;
    for (var object = 0u; object < object_count(); object++) {
        if (is_conductor(object)) { continue; }
        let solid = solid_of(object);
        let begin = from_origin(solid, edge.begin) + middle;
        if (!is_in_bounds(solid, begin, half)) { continue; }
        let around = half * absolute(solid.turn);
        if (solid_holds(solid, begin * solid.turn, around)) {
            found = EVEN;
        } else if (!solid_misses(solid, begin * solid.turn, around)) {
            return UNEVEN;
        }
    }
    return found;
}

// Where lines pass a quarter, in parts of half its widths from its middle.
fn place_of_line(line: u32) -> vec2<f32> {
    switch line {
        case 0u: { return vec2<f32>(-0.75, -0.25); }
        case 1u: { return vec2<f32>(-0.25, 0.75); }
        case 2u: { return vec2<f32>(0.25, -0.75); }
        default: { return vec2<f32>(0.75, 0.25); }
    }
}

// What multiplies the weight of an edge that weak dielectrics alone are near; -1 where nothing is, or others are.
fn along_lines(edge: Edge, on_edge: ptr<function, Spans>, spans: ptr<function, Spans>) -> f32 {
    var has_weak = false;
    for (var object = 0u; object < object_count(); object++) {
        has_weak = has_weak || is_weak(object);
        if (is_met((*on_edge)[object]) && !is_weak(object)) { return -1.0; }
    }
    if (!has_weak || any(edge.owners != UNLINKED)) { return -1.0; }
    let b = (edge.axis + 1u) % 3u;
    let c = (edge.axis + 2u) % 3u;
    let length = edge.star.above[edge.axis];
    var low = -0.5 * edge.star.below;
    var high = 0.5 * edge.star.above;
    low[edge.axis] = 0.0;
    high[edge.axis] = length;
    let all_of_it = filling(edge, 0.5 * (low + high), 0.5 * (high - low));
    if (all_of_it == NOTHING) { return -1.0; }
    if (all_of_it == EVEN) { return edge_rule(on_edge, edge.owners, edge.background).through; }
    // At an electrode layers are in series.
    let is_in_series = edge.axis != 2u && (is_electrodes(edge.ends.x) || is_electrodes(edge.ends.y));
    var sum = 0.0;
    var whole = 0.0;
    var any_met = false;
    for (var quarter = 0u; quarter < 4u; quarter++) {
        let first = select(-edge.star.below[b], edge.star.above[b], (quarter & 2u) != 0u);
        let second = select(-edge.star.below[c], edge.star.above[c], (quarter & 1u) != 0u);
        let share = 0.25 * abs(first * second);
        if (share == 0.0) { continue; }
        whole += share;
        var offset = vec3<f32>(0.0);
        offset[b] = 0.25 * first;
        offset[c] = 0.25 * second;
        var middle = offset;
        middle[edge.axis] = 0.5 * length;
        var half = abs(offset);
        half[edge.axis] = 0.5 * length;
        let filled = filling(edge, middle, half);
        if (filled == NOTHING) {
            sum += share;
            continue;
        }
        let lines = select(4u, 1u, filled == EVEN);
        var parallel = 0.0;
        var in_series = 0.0;
        for (var line = 0u; line < lines; line++) {
            let place = place_of_line(line);
            var shift = offset;
            shift[b] += place.x * offset[b];
            shift[c] += place.y * offset[c];
            spans_between(spans, moved(edge.begin, shift), moved(edge.end, shift));
            for (var object = 0u; object < object_count(); object++) {
                if (is_conductor(object)) {
                    (*spans)[object] = NO_SPAN;
                } else if (is_met((*spans)[object])) {
                    if (!is_weak(object)) { return -1.0; }
                    any_met = true;
                }
            }
            let through = edge_rule(spans, UNLINKED, edge.background).through;
            parallel += through;
            in_series += 1.0 / through;
        }
        let count = f32(lines);
        sum += share * select(parallel / count, count / in_series, is_in_series);
    }
    if (!any_met || whole == 0.0) { return -1.0; }
    return sum / whole;
}

// Edges nearer to a face than this part of the lattice's size lie in it.
const IN_FACE: f32 = 1e-7;

fn in_face_distance() -> f32 {
    let counts = plane_counts();
    var largest = 0.0;
    for (var axis = 0u; axis < 3u; axis++) {
        largest = max(largest, plane_at(axis, counts[axis] - 1u).x - plane_at(axis, 0u).x);
    }
    return IN_FACE * largest;
}

fn moved(spot: Spot, way: vec3<f32>) -> Spot { return Spot(spot.at, spot.rest + way); }

// What multiplies the weight of an edge that lies in a face of a dielectric: the mean of what it would be a little to either side of it;
// -1 for all other edges.
fn in_face(edge: Edge, on_edge: ptr<function, Spans>, spans: ptr<function, Spans>) -> f32 {
    let away = in_face_distance();
    let b = (edge.axis + 1u) % 3u;
    let c = (edge.axis + 2u) % 3u;
    var may_hold = false;
    var has_strong = false;
    for (var object = 0u; object < object_count(); object++) {
        has_strong = has_strong || !(is_conductor(object) || is_weak(object));
        if (is_conductor(object) || is_met((*on_edge)[object])) { continue; }
        let solid = solid_of(object);
        may_hold = may_hold || has_face_across(solid, b) || has_face_across(solid, c);
    }
    if (!has_strong || !may_hold) { return -1.0; }
    var sum = 0.0;
    var whole = 0.0;
    var lies_in_one = false;
    for (var quarter = 0u; quarter < 4u; quarter++) {
        let is_above = vec2<bool>((quarter & 2u) != 0u, (quarter & 1u) != 0u);
        let first = select(edge.star.below[b], edge.star.above[b], is_above.x);
        let second = select(edge.star.below[c], edge.star.above[c], is_above.y);
        let share = 0.25 * first * second;
        if (share == 0.0) { continue; }
        var beside = vec3<f32>(0.0);
        beside[b] = select(-away, away, is_above.x);
        beside[c] = select(-away, away, is_above.y);
        spans_between(spans, moved(edge.begin, beside), moved(edge.end, beside));
        for (var object = 0u; object < object_count(); object++) {
            if (!is_met((*spans)[object])) { continue; }
            if (is_conductor(object)) { return -1.0; }
            lies_in_one = lies_in_one || !is_met((*on_edge)[object]);
        }
        sum += share * edge_rule(spans, UNLINKED, edge.background).through;
        whole += share;
    }
    if (!lies_in_one) { return -1.0; }
    return sum / whole;
}

// What the edge rule makes of an edge to a part, and to the rest what is along it without the conductor.
fn blend(cut: Coupling, part: f32, without: f32) -> Coupling {
    var blended = Coupling(part * cut.through + (1.0 - part) * without, part * cut.factor, cut.object);
    blended.object = select(UNLINKED, cut.object, blended.factor > vec2<f32>(0.0));
    return blended;
}

// Corrects what the edge rule makes of an edge for the part of its box that meets a conductor.
fn at_silhouette(edge: Edge, on_edge: ptr<function, Spans>, cut: Coupling) -> Coupling {
    if (all(edge.owners != UNLINKED)) { return cut; }
    var conductors = 0u;
    var objects = 0u;
    var conductor = NO_OBJECT;
    for (var object = 0u; object < object_count(); object++) {
        if (!is_met((*on_edge)[object])) { continue; }
        objects++;
        if (is_conductor(object)) {
            conductors++;
            conductor = object;
        }
    }
    if (conductors == 1u) {
        let solid = solid_of(conductor);
        let tube = tube_of(edge.star, edge.axis, solid);
        if (!is_in_bounds(solid, tube.middle, tube.half) || !has_edge_in(solid, tube.middle, tube.half)) { return cut; }
        let part = part_covered(solid, tube, (*on_edge)[conductor]);
        if (part >= 1.0) { return cut; }
        var dielectrics = *on_edge;
        dielectrics[conductor] = NO_SPAN;
        return blend(cut, part, edge_rule(&dielectrics, UNLINKED, edge.background).through);
    }
    if (objects > 0u || any(edge.owners != UNLINKED)) { return cut; }
    // What a conductor beside an edge that meets no object makes of it, if there is one alone.
    for (var object = 0u; object < object_count(); object++) {
        if (!is_conductor(object)) { continue; }
        let solid = solid_of(object);
        let tube = tube_of(edge.star, edge.axis, solid);
        if (!is_in_bounds(solid, tube.middle, tube.half)) { continue; }
        if (conductor != NO_OBJECT) { return cut; }
        conductor = object;
    }
    if (conductor == NO_OBJECT) { return cut; }
    let solid = solid_of(conductor);
    let tube = tube_of(edge.star, edge.axis, solid);
    if (!has_edge_in(solid, tube.middle, tube.half)) { return cut; }
    let most = all_beside(solid, tube);
    let is_linked = most.links > vec2<f32>(0.0);
    if (!any(is_linked)) { return cut; }
    return Coupling(cut.through * (1.0 - most.taken), most.links, select(UNLINKED, vec2<u32>(conductor), is_linked));
}

// What is left of an edge with nodes near edges of conductors at its ends. `cut` is what surfaces on the edge make of it, `covered`
// what walls make of it as well.
fn between_wedges(edge: Edge, wedges: array<Wedge, 2>, cut: Coupling, covered: Coupling) -> Coupling {
    let is_free = all(edge.owners == UNLINKED);
    var both_wedges = wedges;
    var coupling = covered;
    if (!is_free) {
        // To a node in the conductor the edge itself is what others are linked by.
        coupling.through *= 1.0 - max(wedges[0].share, wedges[1].share);
    }
    for (var end = 0u; end < 2u; end++) {
        let wedge = both_wedges[end];
        coupling.factor[end] *= 1.0 - wedge.share;
        if (wedge.share > 0.0) {
            // The link was found for what surfaces on the edge make of it.
            if (is_free && covered.through != cut.through) {
                var slope = 0.0;
                if (end == 0u) { slope = slope_from(wedge, edge.begin, edge.end); } else { slope = slope_from(wedge, edge.end, edge.begin); }
                coupling.factor[end] += wedge.share * (covered.through - cut.through) * slope;
            }
            if (end == 0u && edge.axis == CARRIER) { coupling.factor[end] += wedge.link; }
            coupling.object[end] = wedge.object;
        }
        if (coupling.factor[end] == 0.0) { coupling.object[end] = NO_OBJECT; }
    }
    return coupling;
}

// What all objects make of an edge.
fn coupling_of(edge: Edge) -> Coupling {
    if (!any_object_near(edge)) { return with_wedges(edge, PLAIN, PLAIN); }
    var on_edge: Spans;
    spans_between(&on_edge, edge.begin, edge.end);
    var beside: Spans;
    let through = along_lines(edge, &on_edge, &beside);
    if (through >= 0.0) { return only_through(through); }
    var cut = edge_rule(&on_edge, edge.owners, edge.background);
    if (all(edge.owners == UNLINKED)) {
        let held = in_face(edge, &on_edge, &beside);
        if (held >= 0.0) { cut = only_through(held); }
    }
    let wedges = vec2<bool>(wedge_of(edge.ends.x).is_all, wedge_of(edge.ends.y).is_all);
    var covered = cut;
    if (!all(wedges | (edge.owners != UNLINKED))) { covered = at_silhouette(edge, &on_edge, cut); }
    return with_wedges(edge, cut, covered);
}

fn with_wedges(edge: Edge, cut: Coupling, covered: Coupling) -> Coupling {
    let wedges = array<Wedge, 2>(wedge_of(edge.ends.x), wedge_of(edge.ends.y));
    if (wedges[0].share <= 0.0 && wedges[1].share <= 0.0) { return covered; }
    return between_wedges(edge, wedges, cut, covered);
}
