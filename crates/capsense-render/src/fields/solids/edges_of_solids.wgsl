// What is around an edge of a lattice makes of it: faces of strong dielectrics in which it lies, walls of conductors beside it, and
// the field near edges of conductors and before round ones. `Occupancy::update_edge` of the core, behind the edge rule itself. Beside
// what the files before ask for:
//   fn wedge_of(node: u32) -> Wedge

const UNLINKED: vec2<u32> = vec2<u32>(NO_OBJECT, NO_OBJECT);

// Edges nearer to a face than this part of the lattice's size lie in it.
const IN_FACE: f32 = 1e-7;

fn in_face_distance() -> f32 {
    let counts = plane_counts();
    var largest = 0.0;
    for (var axis = 0u; axis < 3u; axis++) {
        largest = max(largest, plane_of(axis, counts[axis] - 1u).x - plane_of(axis, 0u).x);
    }
    return IN_FACE * largest;
}

// What multiplies the weight of an edge that lies in a face of a dielectric: the mean of what it would be a little to either side of it;
// -1 for all other edges.
fn in_face(around: Surroundings, star: Star) -> f32 {
    var on_edge = around.on_edge;
    let axis = around.edge.axis;
    var away = in_face_distance();
    let b = (axis + 1u) % 3u;
    let c = (axis + 2u) % 3u;
    var may_hold = false;
    var has_strong = false;
    for (var object = 0u; object < objects; object++) {
        has_strong = has_strong || !(is_conductor(object) || is_weak(object));
        if (is_conductor(object) || is_hit(on_edge[object])) { continue; }
        let solid = solid_of(object);
        may_hold = may_hold || has_face_across(solid, b) || has_face_across(solid, c);
        // Lines beside the edge must reach into the solid, which is smaller than stated.
        away = max(away, 3.0 * SHRINK * max(solid.size.x, max(solid.size.y, solid.size.z)));
    }
    if (!has_strong || !may_hold) { return -1.0; }
    var sum = 0.0;
    var whole = 0.0;
    var lies_in_one = false;
    for (var quarter = 0u; quarter < 4u; quarter++) {
        let is_above = vec2<bool>((quarter & 2u) != 0u, (quarter & 1u) != 0u);
        let first = select(star.below[b], star.above[b], is_above.x);
        let second = select(star.below[c], star.above[c], is_above.y);
        let area = 0.25 * first * second;
        if (area == 0.0) { continue; }
        var cell = star.place;
        cell[b] -= select(1u, 0u, is_above.x);
        cell[c] -= select(1u, 0u, is_above.y);
        let background = background_in(cell, around.background);
        let share = area * background;
        var beside = vec3<f32>(0.0);
        beside[b] = select(-away, away, is_above.x);
        beside[c] = select(-away, away, is_above.y);
        var through = 1.0;
        if (find_spans(around.edge, beside)) {
            for (var object = 0u; object < objects; object++) {
                if (!is_met(object)) { continue; }
                if (is_conductor(object)) { return -1.0; }
                lies_in_one = lies_in_one || !is_hit(on_edge[object]);
            }
            through = edge_rule(UNLINKED, background).through;
        }
        sum += share * through;
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
fn at_silhouette(around: Surroundings, star: Star, cut: Coupling) -> Coupling {
    if (all(around.owners != UNLINKED)) { return cut; }
    var on_edge = around.on_edge;
    var conductors = 0u;
    var met = 0u;
    var conductor = NO_OBJECT;
    for (var object = 0u; object < objects; object++) {
        if (!is_hit(on_edge[object])) { continue; }
        met++;
        if (is_conductor(object)) {
            conductors++;
            conductor = object;
        }
    }
    if (conductors != 1u && (met > 0u || any(around.owners != UNLINKED))) { return cut; }
    if (met == 0u) {
        conductor = only_conductor_beside(around.edge, star);
        if (conductor == NO_OBJECT) { return cut; }
    }
    let solid = solid_of(conductor);
    let tube = tube_of(star, around.edge.axis, solid);
    if (!is_in_bounds(solid, tube.middle, tube.half) || !has_edge_in(solid, tube.middle, tube.half)) { return cut; }
    if (met == 0u) {
        let most = all_beside(solid, tube);
        let is_linked = most.links > vec2<f32>(0.0);
        if (!any(is_linked)) { return cut; }
        return Coupling(cut.through * (1.0 - most.taken), most.links, select(UNLINKED, vec2<u32>(conductor), is_linked));
    }
    let part = part_covered(solid, tube, on_edge[conductor]);
    if (part >= 1.0) { return cut; }
    spans = on_edge;
    spans[conductor] = MISSED;
    return blend(cut, part, edge_rule(UNLINKED, around.background).through);
}

// The conductor that is near the box around an edge, if it is one alone.
fn only_conductor_beside(edge: Edge, star: Star) -> u32 {
    var found_one = NO_OBJECT;
    for (var object = 0u; object < objects; object++) {
        if (!is_conductor(object) || !is_beside(object, edge)) { continue; }
        let solid = solid_of(object);
        let tube = tube_of(star, edge.axis, solid);
        if (!is_in_bounds(solid, tube.middle, tube.half)) { continue; }
        if (found_one != NO_OBJECT) { return NO_OBJECT; }
        found_one = object;
    }
    return found_one;
}

// What is left of an edge with nodes near edges of conductors at its ends. `cut` is what surfaces on the edge make of it, `covered`
// what walls make of it as well.
fn between_wedges(around: Surroundings, cut: Coupling, covered: Coupling) -> Coupling {
    let is_free = all(around.owners == UNLINKED);
    let shares = vec2<f32>(wedge_of(around.ends.x).share, wedge_of(around.ends.y).share);
    if (all(shares <= vec2<f32>(0.0))) { return covered; }
    var coupling = covered;
    if (!is_free) {
        // To a node in the conductor the edge itself is what others are linked by.
        coupling.through *= 1.0 - max(shares.x, shares.y);
    }
    let place = around.edge.place;
    let next = next_along(place, around.edge.axis);
    for (var end = 0u; end < 2u; end++) {
        let wedge = wedge_of(around.ends[end]);
        coupling.factor[end] *= 1.0 - wedge.share;
        if (wedge.share > 0.0) {
            // The link was found for what surfaces on the edge make of it.
            if (is_free && covered.through != cut.through) {
                let own = spot_of(select(place, next, end == 1u));
                let slope = slope_from(wedge, own, spot_of(select(next, place, end == 1u)));
                coupling.factor[end] += wedge.share * (covered.through - cut.through) * slope;
            }
            if (end == 0u && around.edge.axis == CARRIER) { coupling.factor[end] += wedge.link; }
            coupling.object[end] = wedge.object;
        }
        if (coupling.factor[end] == 0.0) { coupling.object[end] = NO_OBJECT; }
    }
    return coupling;
}

// What is around an edge makes of it, of which surfaces on it leave `by_rule`.
fn with_surroundings(around: Surroundings, by_rule: Coupling) -> Coupling {
    let star = star_at(around.ends.x, around.edge.place);
    var cut = by_rule;
    if (all(around.owners == UNLINKED)) {
        let held = in_face(around, star);
        if (held >= 0.0) { cut = only_through(held); }
    }
    let is_all = vec2<bool>(wedge_of(around.ends.x).is_all, wedge_of(around.ends.y).is_all);
    var covered = cut;
    if (!all(is_all | (around.owners != UNLINKED))) { covered = at_silhouette(around, star, cut); }
    return between_wedges(around, cut, covered);
}
