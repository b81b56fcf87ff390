// What is around an edge of a lattice makes of it: walls of conductors and of strong dielectrics beside it, and
// the field near edges of conductors and before round ones. `Occupancy::update_edge` of the core, behind the edge rule itself. Beside
// what the files before ask for:
//   fn wedge_of(node: u32) -> Wedge

const UNLINKED: vec2<u32> = vec2<u32>(NO_OBJECT, NO_OBJECT);

// A gap counts as a whole if it is longer by this part of the way to the next edge than what is between that and the body, which is as
// thick at least.
const LONGER: f32 = 0.25;

// The gap between a place on an edge and an object on the way to the next edge in one direction, in parts of the edge, as far as the next
// edge is nearer to the object. The anchor is the first node of the edge.
fn gap_to(object: u32, edge: Edge, part: f32, to_next: vec2<f32>) -> f32 {
    let solid = solid_of(object);
    let start = part * along(edge);
    var way = vec3<f32>();
    way[(edge.axis + 1u) % 3u] = to_next.x;
    way[(edge.axis + 2u) % 3u] = to_next.y;
    let body = solid_span(solid, in_frame(solid, moved(anchor, start)), in_frame(solid, moved(anchor, start + way)));
    if (!is_hit(body)) { return 0.0; }
    let longer = clamp((body.enter - (1.0 - body.leave)) / LONGER, 0.0, 1.0);
    let thick = clamp((body.leave - body.enter) / LONGER, 0.0, 1.0);
    return longer * thick * body.enter * min(abs(to_next.x), abs(to_next.y)) / edge.length;
}

// An edge ends at a face of a dielectric as a whole if so much of it is outside.
const OUTSIDE: f32 = 0.25;

fn is_round(object: u32) -> bool { return solid_of(object).kind == CAPSULE; }

// What an edge on which dielectrics are is, of which lines tell the more the weaker they are: `occupancy/parallel/strong.rs` of the core.
fn on_strong(around: Surroundings, lines: f32) -> f32 {
    var on_edge = around.on_edge;
    var strongest = NO_OBJECT;
    var strength = 0.0;
    for (var object = 0u; object < objects; object++) {
        if (!is_hit(on_edge[object])) { continue; }
        let own = strength_of(object, around.background);
        if (own > strength) {
            strength = own;
            strongest = object;
        }
    }
    if (strongest == NO_OBJECT) { return lines; }
    return lines + strength * (past_walls(around, strongest) - lines);
}

// What the edge rule makes of an edge to the part of its box that meets one of the dielectrics on it, and to the other what is along it
// without that one.
fn past_walls(around: Surroundings, object: u32) -> f32 {
    var on_edge = around.on_edge;
    spans = on_edge;
    let cut = edge_rule(UNLINKED, around.background).through;
    let solid = solid_of(object);
    var tube = tube_of(star_at(around.ends.x, around.edge.place), around.edge.axis, solid);
    if (!is_in_bounds(solid, tube.middle, tube.half) || !has_edge_in(solid, tube.middle, tube.half)) { return cut; }
    // Fields are strong where faces end, not along walls within.
    tube.fringes *= min((1.0 - width_of(on_edge[object])) / OUTSIDE, 1.0);
    let part = part_covered(solid, tube, on_edge[object]);
    if (part >= 1.0) { return cut; }
    spans = on_edge;
    spans[object] = MISSED;
    return part * cut + (1.0 - part) * edge_rule(UNLINKED, around.background).through;
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
                let star = star_at(around.ends[end], select(place, next, end == 1u));
                let slope = slope_from(wedge, star, spot_of(select(next, place, end == 1u)));
                coupling.factor[end] += wedge.share * (covered.through - cut.through) * slope;
            }
            if (end == 0u && around.edge.axis == CARRIER) { coupling.factor[end] += wedge.link; }
            coupling.object[end] = wedge.object;
        }
        if (coupling.factor[end] == 0.0) { coupling.object[end] = NO_OBJECT; }
    }
    return coupling;
}

// What is around an edge makes of it, of which surfaces on it leave `cut`.
fn with_surroundings(around: Surroundings, cut: Coupling) -> Coupling {
    let star = star_at(around.ends.x, around.edge.place);
    let is_all = vec2<bool>(wedge_of(around.ends.x).is_all, wedge_of(around.ends.y).is_all);
    var covered = cut;
    if (!all(is_all | (around.owners != UNLINKED))) { covered = at_silhouette(around, star, cut); }
    return between_wedges(around, cut, covered);
}
