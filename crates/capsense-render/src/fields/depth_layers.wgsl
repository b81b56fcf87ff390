// Objects as a depth camera sees them: core's `occupancy/depth.rs` and `occupancy/crossing.rs`, which say what this is.
//
// Points are relative to a node of the lattice, the anchor, and depths are made so too, so that single precision is that of
// cells, not of the whole domain. Pixels are counted from the anchor's own. `sources` has what was drawn: depths from 0 to 1 over
// an object's own range, 1 in front where a ray misses it.

// Rounding moves no border by more than this many pixel widths.
const MARGIN_IN_PIXELS: f32 = 1e-3f;
// Where a ray misses: far behind in front, far before at the back.
const MISS: vec2<f32> = vec2<f32>(1e30f, -1e30f);
const BEYOND: f32 = 2.0f;
// The largest number below one.
const LARGEST_PART: f32 = 0.99999994f;

const FRONT_AT: u32 = OWN;
const BACK_AT: u32 = OWN + 1u;
const PITCH: u32 = OWN + 2u;
const NEAR_HIGH: u32 = OWN + 3u;
const NEAR_LOW: u32 = OWN + 4u;
const RANGE: u32 = OWN + 5u;

var<private> anchor_z: vec2<f32>;
var<private> anchor_pixel: vec2<i32>;
var<private> anchor_in_pixel: vec2<f32>;
// The ways to the next planes across x and y, and where these are: exactly in the pixels that their nodes are in.
var<private> way_to_next: vec2<f32>;
var<private> next_in_pixels: vec2<f32>;

fn set_anchor(place: vec3<u32>) {
    let x = plane_at(0u, place.x);
    let y = plane_at(1u, place.y);
    let z = plane_at(2u, place.z);
    anchor_pixel = vec2<i32>(bitcast<i32>(tables[x + 3u]), bitcast<i32>(tables[y + 3u]));
    anchor_in_pixel = vec2<f32>(bitcast<f32>(tables[x + 4u]), bitcast<f32>(tables[y + 4u]));
    anchor_z = vec2<f32>(bitcast<f32>(tables[z]), bitcast<f32>(tables[z + 1u]));
    way_to_next = vec2<f32>(bitcast<f32>(tables[x + 2u]), bitcast<f32>(tables[y + 2u]));
    // Behind the last plane there is a way of no length, and what is read is of no use.
    let pixels = vec2<i32>(bitcast<i32>(tables[x + PLANE + 3u]), bitcast<i32>(tables[y + PLANE + 3u])) - anchor_pixel;
    let within = vec2<f32>(bitcast<f32>(tables[x + PLANE + 4u]), bitcast<f32>(tables[y + PLANE + 4u]));
    let whole = vec2<f32>(pixels);
    next_in_pixels = min(whole + within, (whole + 1.0) * LARGEST_PART);
}

fn in_pixels(point: vec3<f32>) -> vec2<f32> {
    let is_next = (point.xy == way_to_next) & (way_to_next > vec2<f32>());
    return select(anchor_in_pixel + point.xy * camera.pixels_per_metre, next_in_pixels, is_next);
}

// Front and back in a pixel, relative to the anchor.
fn depths_in(object: u32, pixel: vec2<i32>) -> vec2<f32> {
    let at = u32(pixel.y) * object_word(object, PITCH) + u32(pixel.x);
    let nearest = sources[object_word(object, FRONT_AT) + at];
    if (nearest >= 1.0) { return MISS; }
    let drawn = vec2<f32>(nearest, sources[object_word(object, BACK_AT) + at]);
    let before = vec2<f32>(object_number(object, NEAR_HIGH), object_number(object, NEAR_LOW)) - anchor_z;
    let z = (object_number(object, RANGE) * drawn + before.x) + before.y;
    let domain = (camera.depths - anchor_z.x) - anchor_z.y;
    if (z.y < domain.x || z.x > domain.y) { return MISS; }
    let front = max(z.x, domain.x);
    let back = min(z.y, domain.y);
    return vec2<f32>(front, select(back, domain.y, camera.back_fill == 1u && front < domain.y));
}

// Along one axis, the pixel at a coordinate and the next one on the nearer side; -1 where there is none.
fn pixels_at(coordinate: f32, base: i32, count: i32) -> vec2<i32> {
    let place = f32(base) + coordinate;
    if (place < -MARGIN_IN_PIXELS || place > f32(count) + MARGIN_IN_PIXELS) { return vec2<i32>(-1, -1); }
    let pixel = clamp(base + i32(floor(coordinate)), 0, count - 1);
    let is_before_centre = coordinate < f32(pixel - base) + 0.5;
    let beside = select(pixel + 1, pixel - 1, is_before_centre);
    return vec2<i32>(pixel, select(-1, beside, beside < count));
}

// Front and back of an object over a quarter of a pixel: at the pixel's centre, at those of the neighbours in its row and its
// column, and of the one across.
struct Quarter { is_hit: bool, centre: vec2<f32>, front: vec4<f32>, back: vec4<f32> }

fn smooth_or_alone(z: vec4<f32>) -> vec4<f32> {
    let low = min(min(z.x, z.y), min(z.z, z.w));
    let high = max(max(z.x, z.y), max(z.z, z.w));
    return select(vec4<f32>(z.x), z, high - low <= camera.jump);
}

fn quarter_at(object: u32, place: vec2<f32>) -> Quarter {
    var quarter: Quarter;
    let size = vec2<i32>(camera.size);
    let columns = pixels_at(place.x, anchor_pixel.x, size.x);
    let rows = pixels_at(place.y, anchor_pixel.y, size.y);
    if (columns.x < 0 || rows.x < 0) { return quarter; }
    let own = depths_in(object, vec2<i32>(columns.x, rows.x));
    if (own.x > own.y) { return quarter; }
    quarter.is_hit = true;
    quarter.centre = vec2<f32>(vec2<i32>(columns.x, rows.x) - anchor_pixel) + 0.5;
    quarter.front = vec4<f32>(own.x);
    quarter.back = vec4<f32>(own.y);
    if (columns.y >= 0 && rows.y >= 0) {
        let in_row = depths_in(object, vec2<i32>(columns.y, rows.x));
        let in_column = depths_in(object, vec2<i32>(columns.x, rows.y));
        let across = depths_in(object, vec2<i32>(columns.y, rows.y));
        quarter.front = smooth_or_alone(vec4<f32>(own.x, in_row.x, in_column.x, across.x));
        quarter.back = smooth_or_alone(vec4<f32>(own.y, in_row.y, in_column.y, across.y));
    }
    return quarter;
}

fn interpolated(z: vec4<f32>, offset: vec2<f32>) -> f32 {
    let near = z.x + (z.y - z.x) * offset.x;
    let far = z.z + (z.w - z.z) * offset.x;
    return near + (far - near) * offset.y;
}

// How deep a height is behind the front and before the back.
fn depth_inside(quarter: Quarter, place: vec2<f32>, z: f32) -> vec2<f32> {
    let offset = abs(place - quarter.centre);
    return vec2<f32>(z - interpolated(quarter.front, offset), interpolated(quarter.back, offset) - z);
}

// The part of a segment that is in an object, its ends in the quarter, at parameters `t` of the whole.
fn span_in_quarter(quarter: Quarter, start: vec3<f32>, end: vec3<f32>, t: vec2<f32>) -> Span {
    let at_start = depth_inside(quarter, start.xy, start.z);
    let at_end = depth_inside(quarter, end.xy, end.z);
    var part = vec2<f32>(0.0, 1.0);
    for (var side = 0u; side < 2u; side++) {
        let s = at_start[side];
        let e = at_end[side];
        if (s <= 0.0 && e <= 0.0) { return MISSED; }
        if (s > 0.0 && e <= 0.0) { part.y = min(part.y, s / (s - e)); }
        if (s <= 0.0 && e > 0.0) { part.x = max(part.x, s / (s - e)); }
    }
    if (part.x >= part.y) { return MISSED; }
    // Exactly the end where there is no crossing.
    let at = t.x + part * (t.y - t.x);
    return Span(at.x, select(at.y, t.y, part.y == 1.0));
}

// Front and back along the ray through a point; a miss where it passes by.
fn layer_at(object: u32, point: vec3<f32>) -> vec2<f32> {
    let place = in_pixels(point);
    let quarter = quarter_at(object, place);
    if (!quarter.is_hit) { return MISS; }
    let offset = abs(place - quarter.centre);
    return vec2<f32>(interpolated(quarter.front, offset), interpolated(quarter.back, offset));
}

fn object_contains(object: u32, point: vec3<f32>) -> bool {
    let place = in_pixels(point);
    let quarter = quarter_at(object, place);
    if (!quarter.is_hit) { return false; }
    let inside = depth_inside(quarter, place, point.z);
    return inside.x > 0.0 && inside.y > 0.0;
}

// The parameters at which a segment crosses multiples of half a pixel, in order: for each axis the next border, the one behind
// the last, and the way there.
var<private> border: vec2<i32>;
var<private> last_border: vec2<i32>;
var<private> border_step: vec2<i32>;
var<private> border_origin: vec2<f32>;
var<private> border_inverse: vec2<f32>;

fn start_borders(a: vec2<f32>, b: vec2<f32>) {
    border_origin = a;
    for (var axis = 0u; axis < 2u; axis++) {
        let low = i32(floor(2.0 * a[axis]));
        let high = i32(floor(2.0 * b[axis]));
        let is_up = low <= high;
        border[axis] = select(low, low + 1, is_up);
        last_border[axis] = select(high, high + 1, is_up);
        border_step[axis] = select(-1, 1, is_up);
        let is_crossed = border[axis] != last_border[axis];
        border_inverse[axis] = select(0.0, 1.0 / select(1.0, b[axis] - a[axis], is_crossed), is_crossed);
    }
}

fn next_border_after(t: f32) -> f32 {
    loop {
        let crossing = select((0.5 * vec2<f32>(border) - border_origin) * border_inverse, vec2<f32>(BEYOND), border == last_border);
        let axis = select(0u, 1u, crossing.y < crossing.x);
        if (crossing[axis] >= 1.0) { return 1.0; }
        border[axis] += border_step[axis];
        if (crossing[axis] > t) { return crossing[axis]; }
    }
    return 1.0;
}

fn object_span(object: u32, edge: Edge, shift: vec3<f32>) -> Span {
    let end = shift + along(edge);
    let start_at = vec3<f32>(in_pixels(shift), shift.z);
    let way = vec3<f32>(in_pixels(end), end.z) - start_at;
    start_borders(start_at.xy, start_at.xy + way.xy);
    var whole = MISSED;
    var start = 0.0;
    while (start < 1.0) {
        let end = next_border_after(start);
        let quarter = quarter_at(object, start_at.xy + (0.5 * (start + end)) * way.xy);
        if (quarter.is_hit) {
            let piece = span_in_quarter(quarter, start_at + start * way, start_at + end * way, vec2<f32>(start, end));
            if (piece.enter <= piece.leave) {
                whole = Span(select(whole.enter, piece.enter, whole.enter > whole.leave), piece.leave);
            }
        }
        start = end;
    }
    return whole;
}

// Nothing but the middle line of a bar is asked.
fn object_fill(object: u32, edge: Edge, shift: vec3<f32>, reach: vec2<f32>) -> Fill {
    let span = object_span(object, edge, shift);
    return Fill(select(0.0, 1.0, span.enter <= span.leave), span);
}

// How steeply faces between two depths rise or fall from the pixel around a place to the next one on some side of it; zero where that
// misses the object.
fn slope_beside(object: u32, place: vec2<f32>, axis: u32, direction: i32, depths: vec2<f32>) -> f32 {
    let size = vec2<i32>(camera.size);
    let own = vec2<i32>(pixels_at(place.x, anchor_pixel.x, size.x).x, pixels_at(place.y, anchor_pixel.y, size.y).x);
    var beside = own;
    beside[axis] += direction;
    if (any(own < vec2<i32>(0)) || any(beside < vec2<i32>(0)) || any(beside >= size)) { return 0.0; }
    let here = depths_in(object, own);
    let there = depths_in(object, beside);
    if (there.x > there.y) { return 0.0; }
    let is_between = (here > vec2<f32>(depths.x)) & (here < vec2<f32>(depths.y));
    let rises = select(vec2<f32>(), abs(there - here), is_between);
    return max(rises.x, rises.y) * camera.pixels_per_metre[axis];
}

// Where the segment beside an edge enters an object, coming from outside of it, if it does so at a wall along the rays: as soon as a
// pixel starts; less than nothing where it does not. And how steep the faces are behind the wall, of those between two depths.
// `is_first_inside` tells which end is inside.
fn wall_beside(object: u32, edge: Edge, shift: vec3<f32>, is_first_inside: bool, depths: vec2<f32>) -> vec2<f32> {
    let end = shift + along(edge);
    let start_at = vec3<f32>(in_pixels(shift), shift.z);
    let way = vec3<f32>(in_pixels(end), end.z) - start_at;
    start_borders(start_at.xy, start_at.xy + way.xy);
    var found = vec2<f32>(-1.0, 0.0);
    var start = 0.0;
    while (start < 1.0) {
        let end = next_border_after(start);
        let middle = start_at.xy + (0.5 * (start + end)) * way.xy;
        let quarter = quarter_at(object, middle);
        if (quarter.is_hit) {
            let piece = span_in_quarter(quarter, start_at + start * way, start_at + end * way, vec2<f32>(start, end));
            if (piece.enter <= piece.leave) {
                if (!is_first_inside) {
                    if (piece.enter != start) { return vec2<f32>(-1.0, 0.0); }
                    return vec2<f32>(start, slope_beside(object, middle, edge.axis, 1, depths));
                }
                found = vec2<f32>(-1.0, 0.0);
                if (piece.leave == end) { found = vec2<f32>(end, slope_beside(object, middle, edge.axis, -1, depths)); }
            }
        }
        start = end;
    }
    return found;
}
