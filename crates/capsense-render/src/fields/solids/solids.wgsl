// Exact solids: which points and which part of a segment they hold. `capsense_core::solids` does the same in double precision;
// names are those of its functions.
//
// Places are told from the origin of an object, so that single precision is a millionth of the object, not of the lattice:
// planes of nodes and origins come in two parts, of which the differences are taken first. What reads buffers stands elsewhere:
//   fn solid_word(object: u32, number: u32) -> u32
//   fn tree_number(at: u32) -> f32
//   fn plane_of(axis: u32, index: u32) -> vec3<f32>: the plane in two parts, and how far the next one is, zero behind the last
//   fn plane_counts() -> vec3<u32>
// and `objects`, how many there are.

const BOX: u32 = 0u;
const CAPSULE: u32 = 1u;
const CYLINDER: u32 = 2u;

// Solids are smaller than stated by this part: what lies in a face but for rounding is outside.
const SHRINK: f32 = 3e-7;
// What is beyond a face by this part of how far it is from the centre is so whatever rounding does.
const BEYOND: f32 = 1e-6;

struct Solid {
    // Half the edge lengths of a box, or radius, radius and half the length of the axis.
    size: vec3<f32>,
    // A kind, and a bit for each axis of the sensor frame that is normal to a flat face.
    kind: u32,
    // The origin in the sensor frame, in two parts.
    origin: vec3<f32>, origin_rest: vec3<f32>,
    // Where a cylinder's tree of edges begins, and ends.
    tree: u32, tree_end: u32,
    // Axes of the solid in the sensor frame.
    turn: mat3x3<f32>,
}

fn solid_vector(object: u32, number: u32) -> vec3<f32> {
    let words = vec3<u32>(solid_word(object, number), solid_word(object, number + 1u), solid_word(object, number + 2u));
    return bitcast<vec3<f32>>(words);
}

fn solid_of(object: u32) -> Solid {
    let turn = mat3x3<f32>(solid_vector(object, 12u), solid_vector(object, 15u), solid_vector(object, 18u));
    return Solid(
        solid_vector(object, 0u), solid_word(object, 3u), solid_vector(object, 4u), solid_vector(object, 7u),
        solid_word(object, 10u), solid_word(object, 11u), turn,
    );
}

const ALL: vec2<f32> = vec2<f32>(-3e38, 3e38);

// A point of the sensor frame, in two parts.
struct Spot { at: vec3<f32>, rest: vec3<f32> }

fn is_hit(span: Span) -> bool { return span.enter <= span.leave; }

fn spot_of(place: vec3<u32>) -> Spot {
    let x = plane_of(0u, place.x);
    let y = plane_of(1u, place.y);
    let z = plane_of(2u, place.z);
    return Spot(vec3<f32>(x.x, y.x, z.x), vec3<f32>(x.y, y.y, z.y));
}

// From the origin of a solid, along the axes of the sensor frame.
fn from_origin(solid: Solid, spot: Spot) -> vec3<f32> {
    return (spot.at - solid.origin) + (spot.rest - solid.origin_rest);
}

// The same in the solid's frame.
fn in_frame(solid: Solid, spot: Spot) -> vec3<f32> {
    return from_origin(solid, spot) * solid.turn;
}

fn absolute(turn: mat3x3<f32>) -> mat3x3<f32> { return mat3x3<f32>(abs(turn[0]), abs(turn[1]), abs(turn[2])); }

// Half the extents of a solid along its axes.
fn half_size(solid: Solid) -> vec3<f32> {
    return select(solid.size, solid.size + vec3<f32>(0.0, 0.0, solid.size.x), solid.kind == CAPSULE);
}

// The same along the axes of the sensor frame.
fn half_bounds(solid: Solid) -> vec3<f32> { return absolute(solid.turn) * half_size(solid); }

// Whether an axis-aligned box, given by its middle from the solid's origin and half its size, meets that around the solid.
fn is_in_bounds(solid: Solid, middle: vec3<f32>, half: vec3<f32>) -> bool {
    return all(abs(middle) <= half_bounds(solid) * (1.0 + BEYOND) + half);
}

// The size that is used in place of the stated one.
fn shrunk(solid: Solid) -> vec3<f32> { return solid.size * (1.0 - SHRINK); }

fn solid_contains(solid: Solid, point: vec3<f32>) -> bool {
    let size = shrunk(solid);
    switch solid.kind {
        case BOX: { return all(abs(point) < size); }
        case CAPSULE: {
            let beyond = max(abs(point.z) - solid.size.z, 0.0);
            return dot(point.xy, point.xy) + beyond * beyond < size.x * size.x;
        }
        default: { return dot(point.xy, point.xy) < size.x * size.x && abs(point.z) < size.z; }
    }
}

fn parts_by_face(solid: Solid, a: vec3<f32>, b: vec3<f32>) -> bool {
    let size = shrunk(solid);
    let low = min(a, b);
    let high = max(a, b);
    switch solid.kind {
        case BOX: { return any(low >= size) || any(high <= -size); }
        case CAPSULE: { return false; }
        default: { return low.z >= size.z || high.z <= -size.z; }
    }
}

// Whether a box about a point of the solid's frame is all before one flat face.
fn solid_misses(solid: Solid, middle: vec3<f32>, half: vec3<f32>) -> bool {
    let near = (abs(middle) - half) * (1.0 - BEYOND);
    switch solid.kind {
        case BOX: { return any(near > solid.size); }
        case CAPSULE: { return false; }
        default: { return near.z > solid.size.z; }
    }
}

fn solid_holds(solid: Solid, middle: vec3<f32>, half: vec3<f32>) -> bool {
    return solid_contains(solid, (abs(middle) + half) * (1.0 + BEYOND));
}

// Intervals of a line; those that end where they start or before are none.

fn both(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> { return vec2<f32>(max(a.x, b.x), min(a.y, b.y)); }

const NO_INTERVAL: vec2<f32> = vec2<f32>(3e38, -3e38);

// Below this, a direction has no part along an axis.
const STANDSTILL: f32 = 1e-25;

fn slab(start: f32, along: f32, half: f32) -> vec2<f32> {
    if (abs(along) < STANDSTILL) { return select(NO_INTERVAL, ALL, abs(start) < half); }
    let leaving = select(-half, half, along > 0.0);
    return vec2<f32>(-leaving - start, leaving - start) / along;
}

fn round_interval(towards: f32, along_squared: f32, moment_squared: f32, start_squared: f32, radius: f32) -> vec2<f32> {
    if (along_squared < STANDSTILL) { return select(NO_INTERVAL, ALL, start_squared < radius * radius); }
    let within = radius * radius - moment_squared / along_squared;
    if (within <= 0.0) { return NO_INTERVAL; }
    let nearest = -towards / along_squared;
    let half = sqrt(within / along_squared);
    return vec2<f32>(nearest - half, nearest + half);
}

fn disk_interval(start: vec3<f32>, along: vec3<f32>, radius: f32) -> vec2<f32> {
    let moment = start.x * along.y - start.y * along.x;
    return round_interval(dot(start.xy, along.xy), dot(along.xy, along.xy), moment * moment, dot(start.xy, start.xy), radius);
}

fn ball_interval(start: vec3<f32>, along: vec3<f32>, radius: f32) -> vec2<f32> {
    let moment = cross(start, along);
    return round_interval(dot(start, along), dot(along, along), dot(moment, moment), dot(start, start), radius);
}

fn hull_of(a: vec2<f32>, b: vec2<f32>) -> vec2<f32> {
    if (a.x >= a.y) { return b; }
    if (b.x >= b.y) { return a; }
    return vec2<f32>(min(a.x, b.x), max(a.y, b.y));
}

fn interval(solid: Solid, start: vec3<f32>, along: vec3<f32>) -> vec2<f32> {
    let size = shrunk(solid);
    switch solid.kind {
        case BOX: {
            let x = slab(start.x, along.x, size.x);
            let y = slab(start.y, along.y, size.y);
            return both(both(x, y), slab(start.z, along.z, size.z));
        }
        case CAPSULE: {
            let half = solid.size.z;
            if (half == 0.0) { return ball_interval(start, along, size.x); }
            let end = vec3<f32>(0.0, 0.0, half);
            let side = both(disk_interval(start, along, size.x), slab(start.z, along.z, half));
            let ends = hull_of(ball_interval(start - end, along, size.x), ball_interval(start + end, along, size.x));
            return hull_of(side, ends);
        }
        default: {
            return both(disk_interval(start, along, size.x), slab(start.z, along.z, size.z));
        }
    }
}

// The part of a segment of the solid's frame that is in the solid.
fn solid_span(solid: Solid, a: vec3<f32>, b: vec3<f32>) -> Span {
    if (parts_by_face(solid, a, b)) { return MISSED; }
    // An end that is inside starts or ends the span, whatever rounding makes of the interval.
    let at_a = solid_contains(solid, a);
    let at_b = solid_contains(solid, b);
    if (at_a && at_b) { return Span(0.0, 1.0); }
    let on_line = interval(solid, a, b - a);
    if (on_line.x >= on_line.y) {
        if (at_a) { return Span(0.0, 0.0); }
        if (at_b) { return Span(1.0, 1.0); }
        return MISSED;
    }
    let enter = select(max(on_line.x, 0.0), 0.0, at_a);
    let leave = select(min(on_line.y, 1.0), 1.0, at_b);
    if (!(enter < leave || at_a || at_b)) { return MISSED; }
    let begin = min(enter, 1.0);
    return Span(begin, max(leave, begin));
}

// What the edge rule asks of a geometry source: all is told from a node, the anchor.
var<private> anchor: Spot;

fn set_anchor(place: vec3<u32>) { anchor = spot_of(place); }

fn object_contains(object: u32, point: vec3<f32>) -> bool {
    let solid = solid_of(object);
    return solid_contains(solid, in_frame(solid, moved(anchor, point)));
}

// The other end of the edge is where its own planes are, so that it is in the object or not as it is by itself.
fn object_span(object: u32, edge: Edge, shift: vec3<f32>) -> Span {
    let solid = solid_of(object);
    let end = spot_of(next_along(edge.place, edge.axis));
    return solid_span(solid, in_frame(solid, moved(anchor, shift)), in_frame(solid, moved(end, shift)));
}

fn moved(spot: Spot, way: vec3<f32>) -> Spot { return Spot(spot.at, spot.rest + way); }

fn next_along(place: vec3<u32>, axis: u32) -> vec3<u32> {
    var next = place;
    next[axis] += 1u;
    return next;
}

// Whether a segment, given by its middle and the way from there to its end, meets a box about the origin.
fn is_segment_in(middle: vec3<f32>, way: vec3<f32>, half: vec3<f32>) -> bool {
    let reach = abs(way);
    let across = half.zxy * reach.yzx + half.yzx * reach.zxy;
    return all(abs(middle) <= half + reach) && all(abs(cross(middle, way)) <= across);
}

// Edges are where they are in a solid that is smaller by this part: boxes that end at the plane of a face have its edges in them if
// they are behind it, and not if they are before it, whatever rounding does.
const EDGES_WITHIN: f32 = 1e-6;

// Whether an object has an edge in a box of the sensor frame, given by its middle from the object's origin and half its size.
fn has_edge_in(solid: Solid, middle: vec3<f32>, half: vec3<f32>) -> bool {
    let centre = middle * solid.turn;
    let around = half * absolute(solid.turn);
    let size = solid.size * (1.0 - EDGES_WITHIN);
    switch solid.kind {
        case BOX: { return has_straight_edge_in(solid, size, middle, half); }
        case CAPSULE: { return false; }
        default: {
            let is_near_rim = abs(length(centre.xy) - size.x) <= length(around.xy);
            return abs(abs(centre.z) - size.z) <= around.z && is_near_rim && has_rim_in(solid, middle, half);
        }
    }
}

fn has_straight_edge_in(solid: Solid, size: vec3<f32>, middle: vec3<f32>, half: vec3<f32>) -> bool {
    let centre = middle * solid.turn;
    let around = half * absolute(solid.turn);
    let low = abs(centre + size) <= around;
    let high = abs(centre - size) <= around;
    if (any(abs(centre) - size > around)) { return false; }
    var turn = solid.turn;
    for (var axis = 0u; axis < 3u; axis++) {
        let b = (axis + 1u) % 3u;
        let c = (axis + 2u) % 3u;
        if (!(low[b] || high[b]) || !(low[c] || high[c])) { continue; }
        let way = turn[axis] * size[axis];
        for (var corner = 0u; corner < 4u; corner++) {
            let at_b = (corner & 1u) != 0u;
            let at_c = (corner & 2u) != 0u;
            if (!select(low[b], high[b], at_b) || !select(low[c], high[c], at_c)) { continue; }
            let of_b = turn[b] * select(-size[b], size[b], at_b);
            let of_c = turn[c] * select(-size[c], size[c], at_c);
            if (is_segment_in(of_b + of_c - middle, way, half)) { return true; }
        }
    }
    return false;
}

fn tree_vector(at: u32) -> vec3<f32> { return vec3<f32>(tree_number(at), tree_number(at + 1u), tree_number(at + 2u)); }

// Whether one of the smallest boxes around pieces of a cylinder's rims touches a box: the same boxes as on the processor. Each has a
// middle, half a size and, from the first, the place of the box after it and all within it.
fn has_rim_in(solid: Solid, middle: vec3<f32>, half: vec3<f32>) -> bool {
    let spread = absolute(solid.turn);
    var at = solid.tree;
    while (at < solid.tree_end) {
        let centre = solid.turn * tree_vector(at);
        let reach = spread * tree_vector(at + 3u) + half;
        let touches = all(abs(centre - middle) <= reach * (1.0 + BEYOND));
        let after = solid.tree + u32(tree_number(at + 6u));
        if (touches && after == at + 7u) { return true; }
        at = select(after, at + 7u, touches);
    }
    return false;
}
