// Nodes near edges of conductors and in front of round ones, linked by what makes the field there satisfy their equations:
// `occupancy/near_field` of the core in single precision, names being those of its functions. Beside what `solids.wgsl` asks
// for:
//   fn is_sensors(node: u32) -> bool, whether a terminal has it
//   fn is_homogeneous(node: u32) -> bool, whether the background is the same on all its edges
//   fn dual_length_of(axis: u32, index: u32) -> f32, what the dual length of a plane of nodes is multiplied by
//   fn conductor_at(node: u32) -> u32, the object that holds it or NO_OBJECT
// all of the scene at hand.

// Up to so many cells from an edge, the field is that of a wedge alone; so many cells away, nothing is known of it.
const NEAR: f32 = 1.0;
const FAR: f32 = 1.6;
// The axis along which each node's own edge carries its link.
const CARRIER: u32 = 0u;
const STRAIGHT: f32 = 3e38;
// By how much thicker than edges of the mesh a conductor must be, so that what is behind it does not matter.
const SPARE: f32 = 1.1;

// Conductors no broader than this part of the longest edge keep no negative links, and as broad as this, all; in between in proportion.
const LEFT_OUT: f32 = 0.25;
const KEPT: f32 = 0.75;

// A node of the lattice and its neighbours: how far those below and above are, zero where the lattice ends; and the cells behind
// these.
struct Star {
    node: u32, place: vec3<u32>,
    below: vec3<f32>, above: vec3<f32>,
    first_below: vec3<f32>, first_above: vec3<f32>, second_below: vec3<f32>, second_above: vec3<f32>,
    reach: vec3<f32>,
    dual: vec3<f32>,
}

fn node_steps() -> vec3<u32> {
    let counts = plane_counts();
    return vec3<u32>(1u, counts.x, counts.x * counts.y);
}

fn star_at(node: u32, place: vec3<u32>) -> Star {
    var star: Star;
    star.node = node;
    star.place = place;
    let counts = plane_counts();
    for (var axis = 0u; axis < 3u; axis++) {
        let index = place[axis];
        let above = plane_of(axis, index).z;
        var below = 0.0;
        if (index > 0u) { below = plane_of(axis, index - 1u).z; }
        let longest = max(below, above);
        let first_below = select(longest, below, below > 0.0);
        let first_above = select(longest, above, above > 0.0);
        var second_below = first_below;
        var reach_below = 2.0 * longest;
        if (index > 1u) {
            second_below = plane_of(axis, index - 2u).z;
            reach_below = below + second_below;
        }
        var second_above = first_above;
        var reach_above = 2.0 * longest;
        if (index + 2u < counts[axis]) {
            second_above = plane_of(axis, index + 1u).z;
            reach_above = above + second_above;
        }
        star.below[axis] = below;
        star.above[axis] = above;
        star.first_below[axis] = first_below;
        star.first_above[axis] = first_above;
        star.second_below[axis] = second_below;
        star.second_above[axis] = second_above;
        star.reach[axis] = max(reach_below, reach_above);
        star.dual[axis] = dual_length_of(axis, index);
    }
    return star;
}

// The dual faces of edges along each axis, their weights in air times their lengths, dual lengths being matched. Of Kuhn's tetrahedra, cells on the diagonal
// from below to above count by a third, the other two by a sixth.
fn areas_of(star: Star) -> vec3<f32> {
    let width = 0.5 * (star.below + star.above);
    let skew = star.above - star.below;
    return (width.yzx * width.zxy + skew.yzx * skew.zxy / 12.0) * (star.dual.yzx * star.dual.zxy);
}

// Cells to a place, given from the node, parts of them counted; no more than FAR.
fn cells_to(star: Star, place: vec3<f32>) -> f32 {
    let is_above = place > vec3<f32>(0.0);
    let way = select(star.below, star.above, is_above);
    let first = select(star.first_below, star.first_above, is_above);
    let second = select(star.second_below, star.second_above, is_above);
    let distance = abs(place);
    let part = distance / first;
    let counted = select(1.0 + abs(distance - way) / second, part, (part <= vec3<f32>(1.0)) | (way == vec3<f32>(0.0)));
    return min(max(counted.x, max(counted.y, counted.z)), FAR);
}

// How much of a node's links the field around a place of a surface, given from the node, has.
fn part_at(star: Star, place: vec3<f32>) -> f32 {
    if (all(place >= -star.below) && all(place <= star.above)) { return 1.0; }
    let part = min((FAR - cells_to(star, place)) / (FAR - NEAR), 1.0);
    return part * part * (3.0 - 2.0 * part);
}

// How much a place on a conductor, given from the node, counts: nothing outside the lattice, all of it a cell within. An edge may
// lead out along a unit vector.
fn within(star: Star, place: vec3<f32>, along: vec3<f32>) -> f32 {
    let counts = plane_counts();
    var inside = vec3<f32>(1.0);
    for (var axis = 0u; axis < 3u; axis++) {
        let own = plane_of(axis, star.place[axis]);
        let first = plane_of(axis, 0u);
        let last = plane_of(axis, counts[axis] - 1u);
        let from_first = (own.x - first.x) + (own.y - first.y) + place[axis];
        let from_last = (last.x - own.x) + (last.y - own.y) - place[axis];
        inside[axis] = clamp(min(from_first / first.z, from_last / plane_of(axis, counts[axis] - 2u).z), 0.0, 1.0);
    }
    let part = 1.0 - (1.0 - inside) * (1.0 - along * along);
    return min(part.x, min(part.y, part.z));
}

// A right angle at which faces of an object meet, in the object's frame.
struct RightAngle {
    place: vec3<f32>, first: vec3<f32>, second: vec3<f32>,
    radius: f32, thickness: vec2<f32>, breadth: f32,
    // Not there in the middle of a rim.
    exists: bool,
}

fn side_of(coordinate: f32) -> f32 { return select(-1.0, 1.0, coordinate >= 0.0); }

fn sides_of(point: vec3<f32>) -> vec3<f32> { return vec3<f32>(side_of(point.x), side_of(point.y), side_of(point.z)); }

// The axis along which the edge of a box is that is nearest to a point so far outside of its faces.
fn farthest_inside(outside: vec3<f32>) -> u32 {
    if (outside.x <= outside.y && outside.x <= outside.z) { return 0u; }
    return select(1u, 2u, outside.z < outside.y);
}

// Edges of a box have a part in the field that are less than this much, in cells, from being the nearest one; and how much further in faces
// are seen, in parts of what cells grow by from one to the next, along x and y.
const MIXED: f32 = 0.2;
const UNEVEN: f32 = 0.15;

// The field near the edges of a box, as a node of the lattice sees it: `near_field/box_field.rs` of the core.
struct BoxField {
    // On which side the node is, half the box's edge lengths, and the parts of the edges along each axis.
    side: vec3<f32>, half: vec3<f32>, parts: vec3<f32>,
    // How much further in faces seem a cell from them, and how large cells are, along each axis of the box.
    inwards: vec3<f32>, sizes: vec3<f32>,
}

fn box_field(star: Star, solid: Solid, point: vec3<f32>) -> BoxField {
    var field: BoxField;
    field.side = sides_of(point);
    let outside = abs(point) - solid.size;
    // By how much cells grow from one to the next upwards, as far as two on either side tell.
    let two = 0.25 * (star.first_above + star.second_above - star.first_below - star.second_below);
    let narrowest = narrowest_beside(star);
    let growth = clamp(two, -narrowest, narrowest) * vec3<f32>(1.0, 1.0, 0.0);
    for (var axis = 0u; axis < 3u; axis++) {
        let normal = solid.turn[axis] * field.side[axis];
        field.sizes[axis] = size_along(star, solid.turn[axis]);
        field.inwards[axis] = UNEVEN * dot(normal * abs(normal), growth);
    }
    let least = min(outside.x, min(outside.y, outside.z));
    let parts = max(1.0 - (outside - least) / (MIXED * field.sizes), vec3<f32>(0.0));
    field.parts = parts / (parts.x + parts.y + parts.z);
    field.half = solid.size;
    return field;
}

fn box_potential(field: BoxField, point: vec3<f32>) -> f32 {
    let away = point * field.side - field.half;
    let cells = min(abs(away) / field.sizes, vec3<f32>(1.0));
    let outside = away + field.inwards * cells * cells * (3.0 - 2.0 * cells);
    var potential = 0.0;
    for (var axis = 0u; axis < 3u; axis++) {
        if (field.parts[axis] > 0.0) {
            potential += field.parts[axis] * potential_before(outside[(axis + 1u) % 3u], outside[(axis + 2u) % 3u]);
        }
    }
    return potential;
}

// Whether no straight way between two points passes the box: a face is behind both of them.
fn see_around_box(field: BoxField, a: vec3<f32>, b: vec3<f32>) -> bool {
    return any((a * field.side - field.half >= vec3<f32>(0.0)) & (b * field.side - field.half >= vec3<f32>(0.0)));
}

// How much an edge counts that is twice as long as this: all of it from two cells on, however numbers are rounded.
fn of_length(half: f32, size: f32) -> f32 { return min((1.0 + 1e-6) * half / size, 1.0); }

// How much of a node's links the edges of a box have if there is nothing else.
fn share_of_box(star: Star, solid: Solid, point: vec3<f32>) -> f32 {
    let field = box_field(star, solid, point);
    let outside = abs(point) - solid.size;
    let to_faces = solid.size * field.side - point;
    // Of edges that all have theirs, all of it, and of those that have nothing, nothing, however numbers are rounded.
    var missing = 0.0;
    var is_near = false;
    for (var axis = 0u; axis < 3u; axis++) {
        if (field.parts[axis] == 0.0) { continue; }
        var way = to_faces;
        if (outside[axis] <= 0.0) { way[axis] = 0.0; }
        let own = part_at(star, solid.turn * way) * of_length(solid.size[axis], field.sizes[axis]);
        is_near = is_near || own > 0.0;
        missing += field.parts[axis] * (1.0 - own);
    }
    if (!is_near) { return 0.0; }
    // Of what is inside the lattice, the least; that of an edge counts as its part is to the nearest one's.
    let nearest = max(field.parts.x, max(field.parts.y, field.parts.z));
    var inside = 1.0;
    for (var axis = 0u; axis < 3u; axis++) {
        if (field.parts[axis] == 0.0) { continue; }
        var way = to_faces;
        if (outside[axis] <= 0.0) { way[axis] = 0.0; }
        let own = within(star, solid.turn * way, solid.turn[axis]);
        inside = min(inside, 1.0 - field.parts[axis] / nearest * (1.0 - own));
    }
    return max(1.0 - missing, 0.0) * inside;
}

// That which is nearest to a point of the object's frame.
fn nearest_angle(solid: Solid, point: vec3<f32>) -> RightAngle {
    var angle: RightAngle;
    let size = solid.size;
    if (solid.kind == CYLINDER) {
        let from_axis = length(point.xy);
        angle.exists = from_axis > STANDSTILL;
        if (!angle.exists) { return angle; }
        let outwards = point.xy / from_axis;
        let end = side_of(point.z);
        angle.place = vec3<f32>(size.x * outwards, size.z * end);
        angle.first = vec3<f32>(outwards, 0.0);
        angle.second = vec3<f32>(0.0, 0.0, end);
        angle.radius = size.x;
        angle.thickness = 2.0 * vec2<f32>(size.x, size.z);
        angle.breadth = 2.0 * size.x;
        return angle;
    }
    let outside = abs(point) - size;
    let axis = farthest_inside(outside);
    let b = (axis + 1u) % 3u;
    let c = (axis + 2u) % 3u;
    let side = sides_of(point);
    angle.exists = true;
    angle.place = size * side;
    angle.place[axis] = point[axis];
    angle.first[b] = side[b];
    angle.second[c] = side[c];
    angle.radius = STRAIGHT;
    angle.thickness = 2.0 * vec2<f32>(size[b], size[c]);
    angle.breadth = 2.0 * (size.x + size.y + size.z - min(size.x, min(size.y, size.z)) - max(size.x, max(size.y, size.z)));
    return angle;
}

// How far before either face a point of the object's frame is, and along the edge.
fn coordinates(angle: RightAngle, point: vec3<f32>) -> vec3<f32> {
    let away = point - angle.place;
    return vec3<f32>(dot(angle.first, away), dot(angle.second, away), dot(cross(angle.first, angle.second), away));
}

// Whether no straight way between two points passes the object: a face is behind both of them.
fn see_each_other(a: vec3<f32>, b: vec3<f32>) -> bool {
    return (a.x >= 0.0 && b.x >= 0.0) || (a.y >= 0.0 && b.y >= 0.0);
}

// Closer to the axis than this part of the radius the field around a rim is that at this place.
const LEAST_RADIUS: f32 = 0.1;

// The potential around a right angle at a point given by its coordinates. Around a rim it is that around a straight edge, by the
// distance from the axis, over the root of that.
fn potential_around(place: vec3<f32>, radius: f32) -> f32 {
    if (radius == STRAIGHT) { return potential_before(place.x, place.y); }
    let radial = 1.0 + place.x / radius;
    let sideways = place.z / radius;
    let from_axis = sqrt(radial * radial + sideways * sideways);
    // Beyond the axis, the sum of both may be all but nothing.
    var p = (from_axis - 1.0) * radius;
    if (radial > 0.0) { p = place.x + place.z * sideways / (from_axis + radial); }
    return potential_before(p, place.y) / sqrt(max(from_axis, LEAST_RADIUS));
}

// What a node near an edge of a conductor, or before a round one, makes of its edges.
struct Wedge {
    object: u32,
    // Whether the field is that of one wedge alone.
    is_all: bool,
    // How much of the node's links is what the wedge makes of them, that share of the link as a factor of the edge along
    // CARRIER, and the potential of the node itself.
    share: f32, link: f32, potential: f32,
    // How much of the share is an edge's, whose the potential is if it has any; the rest is that of what is round.
    of_edge: f32,
}

const NO_WEDGE: Wedge = Wedge(NO_OBJECT, false, 0.0, 0.0, 1.0, 0.0);

// Steps of the edge's part in the words of a wedge.
const PARTS: f32 = 16384.0;

// A wedge in four words: object, the edge's part and whether the field is that of one wedge alone; share, link and potential.
fn in_words(wedge: Wedge) -> vec4<u32> {
    let flags = u32(round(PARTS * wedge.of_edge)) << 17u | select(0u, 0x10000u, wedge.is_all);
    return vec4<u32>(wedge.object | flags, bitcast<u32>(wedge.share), bitcast<u32>(wedge.link), bitcast<u32>(wedge.potential));
}

fn of_words(words: vec4<u32>) -> Wedge {
    let numbers = bitcast<vec3<f32>>(words.yzw);
    let of_edge = f32(words.x >> 17u) / PARTS;
    return Wedge(words.x & 0xffffu, (words.x & 0x10000u) != 0u, numbers.x, numbers.y, numbers.z, of_edge);
}

// How much of a node's links the rim of a cylinder has if there is nothing else.
fn share_of_rim(star: Star, solid: Solid, point: vec3<f32>) -> f32 {
    let angle = nearest_angle(solid, point);
    if (!angle.exists) { return 0.0; }
    let place = solid.turn * (angle.place - point);
    if (any(abs(place) > star.reach)) { return 0.0; }
    let part = part_at(star, place);
    if (part <= 0.0) { return 0.0; }
    let along = abs(solid.turn * cross(angle.first, angle.second));
    let across = max(size_along(star, solid.turn * angle.first), size_along(star, solid.turn * angle.second));
    let known = known_within(angle.radius, max(size_along(star, along), across));
    return part * known * within(star, place, along);
}

// The size of a cell in a direction.
fn size_along(star: Star, direction: vec3<f32>) -> f32 {
    return dot(abs(direction), narrowest_beside(star));
}

// The way to the nearer neighbour along each axis.
fn narrowest_beside(star: Star) -> vec3<f32> {
    let shortest = min(star.below, star.above);
    return select(max(star.below, star.above), shortest, shortest > vec3<f32>(0.0));
}

// How much of a node's links the edges of an object have if there is nothing else, and of what these leave what is round of it.
fn own_shares(star: Star, solid: Solid, point: vec3<f32>) -> vec2<f32> {
    var shares = vec2<f32>(0.0);
    if (solid.kind == BOX) { shares.x = share_of_box(star, solid, point); }
    if (solid.kind == CYLINDER) { shares.x = share_of_rim(star, solid, point); }
    if (solid.kind == CAPSULE || solid.kind == CYLINDER) {
        shares.y = (1.0 - shares.x) * round_share(star, solid, point);
    }
    return shares;
}

// What a node that no conductor holds makes of edges of conductors.
fn wedge_at(star: Star) -> Wedge {
    // What stands for the space beyond an open wall is in the weights of its nodes.
    let is_inside = all(star.below > vec3<f32>(0.0)) && all(star.above > vec3<f32>(0.0));
    if (is_sensors(star.node) || !is_inside) { return NO_WEDGE; }
    let spot = spot_of(star.place);
    var found = NO_OBJECT;
    var share = 1.0;
    var of_edge = 1.0;
    for (var object = 0u; object < objects; object++) {
        let solid = solid_of(object);
        let begin = from_origin(solid, spot);
        let half = half_bounds(solid);
        var away = 0.0;
        if (objects > 1u) { away = cells_to(star, clamp(begin, -half, half) - begin); }
        if (away >= FAR) { continue; }
        var own = 0.0;
        if (found == NO_OBJECT && is_conductor(object)) {
            let shares = own_shares(star, solid, begin * solid.turn);
            own = shares.x + shares.y;
            if (own > 0.0) { of_edge = shares.x / own; }
        }
        if (own > 0.0) {
            found = object;
            share = min(share, own);
        } else {
            share = min(share, max((away - NEAR) / (FAR - NEAR), 0.0));
        }
    }
    if (found == NO_OBJECT || share <= 0.0 || !is_homogeneous(star.node)) { return NO_WEDGE; }
    return linked_wedge(star, spot, found, share, of_edge);
}

fn farthest(ways: vec3<f32>) -> f32 { return max(ways.x, max(ways.y, ways.z)); }

// How much of negative links is left beside a conductor that is such a part of the longest edge broad.
fn of_negative(breadth: f32) -> f32 { return clamp((breadth - LEFT_OUT) / (KEPT - LEFT_OUT), 0.0, 1.0); }

// What the field around an edge of an object, or before what is round of it, makes of a node.
struct FieldLink {
    potential: f32,
    // As a factor of the edge along CARRIER.
    link: f32,
    // Whether no edge of the mesh can have both its ends before the object and meet it.
    is_thick: bool,
}

fn field_link(star: Star, spot: Spot, object: u32, is_round: bool) -> FieldLink {
    let solid = solid_of(object);
    let point = in_frame(solid, spot);
    var angle: RightAngle;
    var roundness: RoundField;
    var breadth = 2.0 * solid.size.x;
    if (is_round) {
        roundness = round_field(star, solid, point);
    } else {
        angle = nearest_angle(solid, point);
        breadth = angle.breadth;
    }
    let longest_ways = max(star.below, star.above);
    let longest = farthest(longest_ways);
    let own_place = coordinates(angle, point);
    var own = 0.0;
    let is_box = !is_round && solid.kind == BOX;
    var around: BoxField;
    if (is_round) {
        own = round_potential(solid, roundness, point);
    } else if (is_box) {
        around = box_field(star, solid, point);
        own = box_potential(around, point);
    } else {
        own = potential_around(own_place, angle.radius);
    }
    let areas = areas_of(star);
    var turn = transpose(solid.turn);
    var sum = 0.0;
    var of_weights = 0.0;
    var highest = own;
    for (var axis = 0u; axis < 3u; axis++) {
        for (var side = 0u; side < 2u; side++) {
            let way = select(star.below[axis], star.above[axis], side == 1u);
            if (way == 0.0) { continue; }
            let stride = node_steps()[axis];
            let node = select(star.node - stride, star.node + stride, side == 1u);
            // Where the neighbour is by its own planes, so that it is in the object or not as it is elsewhere.
            var place = star.place;
            place[axis] = select(place[axis] - 1u, place[axis] + 1u, side == 1u);
            let other = in_frame(solid, spot_of(place));
            if (conductor_at(node) == object) { continue; }
            var potential = 0.0;
            var is_seen = false;
            if (is_round) {
                potential = round_potential(solid, roundness, other);
            } else {
                let moved = point + select(-way, way, side == 1u) * turn[axis];
                if (is_box) {
                    potential = box_potential(around, moved);
                    is_seen = see_around_box(around, point, moved);
                } else {
                    let other_place = coordinates(angle, moved);
                    potential = potential_around(other_place, angle.radius);
                    is_seen = see_each_other(own_place, other_place);
                }
            }
            highest = max(highest, potential);
            if (!is_seen && is_hit(solid_span(solid, point, other))) { continue; }
            let weight = areas[axis] / way;
            sum += weight * potential;
            of_weights += weight;
        }
    }
    var field: FieldLink;
    if (is_round) {
        field.is_thick = SPARE * longest <= breadth;
    } else {
        let ways = vec2<f32>(farthest(abs(solid.turn * angle.first) * longest_ways), farthest(abs(solid.turn * angle.second) * longest_ways));
        field.is_thick = all(SPARE * ways <= angle.thickness);
    }
    field.potential = max(max(own, SMALLEST_PART * highest), 1e-30);
    var link = sum / field.potential - of_weights;
    if (link < 0.0) { link *= of_negative(breadth / longest); }
    field.link = link * star.above[CARRIER] / areas[CARRIER];
    return field;
}

fn linked_wedge(star: Star, spot: Spot, object: u32, share: f32, of_edge: f32) -> Wedge {
    let field = field_link(star, spot, object, of_edge == 0.0);
    var link = field.link;
    if (of_edge > 0.0 && of_edge < 1.0) {
        link = of_edge * link + (1.0 - of_edge) * field_link(star, spot, object, true).link;
    }
    return Wedge(object, share >= 1.0 && field.is_thick, share, share * link, field.potential, of_edge);
}

// (u(Q) - u(P)) / u(P) for the field of a conductor's edge near a node, whose potential is known, and its neighbour.
fn slope_from(wedge: Wedge, star: Star, to: Spot) -> f32 {
    let solid = solid_of(wedge.object);
    // Before what is round there are no walls, but for ends of slim cylinders, where what they take is left out.
    if (wedge.of_edge == 0.0) { return 0.0; }
    let point = in_frame(solid, spot_of(star.place));
    var other = 0.0;
    if (solid.kind == BOX) {
        other = box_potential(box_field(star, solid, point), in_frame(solid, to));
    } else {
        let angle = nearest_angle(solid, point);
        if (!angle.exists) { return 0.0; }
        other = potential_around(coordinates(angle, in_frame(solid, to)), angle.radius);
    }
    return wedge.of_edge * (other / wedge.potential - 1.0);
}
