// Edges past walls that a depth camera sees, where its image of an object ends or jumps: core's `occupancy/camera_wall.rs`, which says
// what the rule is.

const RAYS: u32 = 2u;
const FRINGE: f32 = 0.2f;
const STEEPEST: f32 = 0.15f;
const LARGEST_SHARE: f32 = 0.9f;

// Where an object is along the ray through one end of an edge, between the planes beside, all seen from the plane of the edge;
// NO_OBJECT if there is none, or more than one.
struct Layer { object: u32, end: u32, faces: vec2<f32>, planes: vec2<f32> }

// How far the wall is from the end of an edge outside, and from that behind it; less than nothing where there is none.
struct Wall { outside: f32, behind: f32, abruptness: f32 }

// What a wall leaves of an edge: what multiplies its weight, the tap at the end under a face, and how much of both counts.
struct Past { through: f32, tap: f32, abruptness: f32 }

const NO_WALL: Past = Past(1.0f, 0.0f, 0.0f);

fn distance_to(faces: vec2<f32>) -> f32 { return max(max(faces.x, -faces.y), 0.0); }

// The part of a dual face that an object with these faces is taken to fill.
fn part_filled(ends: vec2<f32>, faces: vec2<f32>, length: f32) -> f32 {
    let height = ends.y - ends.x;
    let fringe = min(vec2<f32>(FRINGE * max(length, height)), abs(ends));
    return max(min(faces.y + fringe.y, ends.y) - max(faces.x - fringe.x, ends.x), 0.0) / height;
}

// The part of the link past a wall that is less because of the potential under the faces.
fn part_under(ends: vec2<f32>, faces: vec2<f32>, wall: Wall) -> f32 {
    var sum = 0.0;
    for (var side = 0u; side < 2u; side++) {
        let forwards = select(-1.0, 1.0, side == 0u);
        let depth = forwards * (faces[side] - ends[side]);
        if (depth <= 0.0) { continue; }
        let plane = forwards * faces[side];
        let at_other = potential_before(wall.outside, plane);
        let more = potential_before(-wall.behind, 0.5 * depth) - potential_before(-wall.behind, plane);
        sum += depth / (ends.y - ends.x) * clamp(more, 0.0, max(at_other, 0.0)) / max(at_other, LEAST);
    }
    return sum;
}

// The object that is between the planes beside along the ray through one end of an edge alone; the anchor is the edge's first node.
fn only_layer(edge: Edge) -> Layer {
    let planes = vec2<f32>(-way_before(RAYS, edge.place.z), way_after(RAYS, edge.place.z));
    let none = Layer(NO_OBJECT, 0u, vec2<f32>(), planes);
    var only = none;
    for (var object = 0u; object < objects; object++) {
        if (!is_beside(object, edge)) { continue; }
        let first_end = layer_at(object, vec3<f32>());
        let other_end = layer_at(object, along(edge));
        let low = max(vec2<f32>(first_end.x, other_end.x), vec2<f32>(planes.x));
        let high = min(vec2<f32>(first_end.y, other_end.y), vec2<f32>(planes.y));
        let between = low < high;
        if (!any(between)) { continue; }
        if (all(between) || only.object != NO_OBJECT) { return none; }
        let end = select(0u, 1u, between.y);
        only = Layer(object, end, vec2<f32>(low[end], high[end]), planes);
    }
    return only;
}

fn wall_of(edge: Edge, layer: Layer) -> Wall {
    let middle = vec3<f32>(0.0, 0.0, 0.5 * (layer.faces.x + layer.faces.y));
    let found = wall_beside(layer.object, edge, middle, layer.end == 0u, layer.planes);
    let outside = max(select(1.0 - found.x, found.x, layer.end == 1u), SMALLEST_PART);
    let abruptness = clamp(2.0 - 2.0 / STEEPEST * found.y, 0.0, 1.0);
    if (found.x < 0.0 || outside > 1.0 - SMALLEST_PART) { return Wall(0.0, 0.0, 0.0); }
    return Wall(outside * edge.length, (1.0 - outside) * edge.length, abruptness);
}

// What is left of an edge one of whose ends' rays meets an object.
fn past(edge: Edge, background: f32, layer: Layer) -> Past {
    var contrast = 1.0;
    let distance = distance_to(layer.faces);
    if (!is_conductor(layer.object)) {
        contrast = 1.0 - background / permittivity_of(layer.object);
        let is_around = layer.faces.x > layer.planes.x && layer.faces.y < layer.planes.y;
        if (is_weak(layer.object) || contrast <= 0.0 || (distance > 0.0 && is_around)) { return NO_WALL; }
    }
    let wall = wall_of(edge, layer);
    if (wall.abruptness == 0.0) { return NO_WALL; }
    let ends = 0.5 * layer.planes;
    let near = wall.behind * wall.behind / (wall.behind * wall.behind + distance * distance);
    let part = part_filled(ends, layer.faces, edge.length);
    let way = length(vec2<f32>(wall.outside, distance)) / edge.length;
    let under = contrast * part_under(ends, layer.faces, wall);
    let link = max(near * (part / (1.0 - contrast + contrast * way) - under), 0.0);
    let through = 1.0 - near * part + link;
    if (distance == 0.0) { return Past(through, 0.0, wall.abruptness); }
    let before = max(distance, SMALLEST_PART * edge.length);
    let ratio = potential_before(-wall.behind, before) / potential_before(wall.outside, before);
    let share = clamp(ratio, SMALLEST_PART, LARGEST_SHARE);
    return Past(through + contrast * link * share / (1.0 - share), contrast * link / share, wall.abruptness);
}

fn past_wall(around: Surroundings, cut: Coupling) -> Coupling {
    let layer = only_layer(around.edge);
    if (layer.object == NO_OBJECT) { return cut; }
    let is_under = distance_to(layer.faces) > 0.0;
    for (var object = 0u; object < objects; object++) {
        let span = around.on_edge[object];
        if ((object != layer.object || is_under) && span.enter <= span.leave) { return cut; }
    }
    if (owner_of(around.ends[layer.end]) != FREE) { return cut; }
    let left = past(around.edge, around.background, layer);
    if (left.abruptness == 0.0) { return cut; }
    return only_through(cut.through + left.abruptness * (left.through - cut.through));
}

// The taps of the edges across the rays at a node under the face of an object, in parts of the weight of the edge through the face,
// which has that length and permittivity around it. The anchor moves.
fn taps(place: vec3<u32>, object: u32, height: f32, background: f32) -> f32 {
    let dual_height = 0.5 * (way_before(RAYS, place.z) + way_after(RAYS, place.z));
    var sum = 0.0;
    for (var axis = 0u; axis < RAYS; axis++) {
        let ways = vec2<f32>(way_before(axis, place[axis]), way_after(axis, place[axis]));
        let width = 0.5 * (ways.x + ways.y);
        for (var side = 0u; side < 2u; side++) {
            if (ways[side] == 0.0) { continue; }
            var start = place;
            if (side == 0u) { start[axis] -= 1u; }
            let across = Edge(start, axis, ways[side]);
            set_anchor(start);
            let layer = only_layer(across);
            if (layer.object != object || layer.end != 1u - side) { continue; }
            let around = background_at(axis, node_at(plan.grids[0], start));
            let left = past(across, around, layer);
            sum += left.abruptness * left.tap * around / background * dual_height * height / (across.length * width);
        }
    }
    return sum;
}

fn under_walls(around: Surroundings, cut: Coupling) -> Coupling {
    var met = NO_OBJECT;
    for (var object = 0u; object < objects; object++) {
        let span = around.on_edge[object];
        if (span.enter > span.leave) { continue; }
        if (met != NO_OBJECT) { return cut; }
        met = object;
    }
    if (met == NO_OBJECT) { return cut; }
    let span = around.on_edge[met];
    var coupling = cut;
    var shorter = 0.0;
    for (var end = 0u; end < 2u; end++) {
        var gap = select(1.0 - span.leave, span.enter, end == 0u);
        if (gap <= 0.0 || around.owners[end] != NO_OBJECT || owner_of(around.ends[end]) != FREE) { continue; }
        if (is_conductor(met)) { gap = max(gap, SMALLEST_PART); }
        var place = around.edge.place;
        place.z += end;
        let more = gap * taps(place, met, around.edge.length, around.background);
        if (cut.object[end] == met) {
            coupling.factor[end] *= 1.0 + more;
        } else {
            shorter += gap * more / (1.0 + more);
        }
    }
    if (shorter > 0.0 && shorter * cut.through < 1.0) {
        coupling.through = cut.through / (1.0 - shorter * cut.through);
    }
    return coupling;
}

// Strong dielectrics that a camera sees are not taken along lines.
fn gap_to(object: u32, edge: Edge, part: f32, to_next: vec2<f32>) -> f32 { return 0.0; }

fn is_round(object: u32) -> bool { return false; }

fn on_strong(around: Surroundings, lines: f32) -> f32 { return lines; }

fn with_surroundings(around: Surroundings, cut: Coupling) -> Coupling {
    if (all(around.owners != vec2<u32>(NO_OBJECT))) { return cut; }
    if (around.edge.axis == RAYS) { return under_walls(around, cut); }
    return past_wall(around, cut);
}
