// The field in front of round conductors, and before the sides and ends of cylinders: `occupancy/near_field/round` and `cylinder` of the core
// in single precision, for `near_field.wgsl`.

// ln(1 + x) / x for x > 0, by the series of the area tangent: drivers' logarithms have eleven bits.
fn log_over(x: f32) -> f32 {
    var mantissa = 1.0 + x;
    var exponent = 0.0;
    var s = x / (2.0 + x);
    if (x > 0.4) {
        let bits = bitcast<u32>(mantissa);
        mantissa = bitcast<f32>((bits & 0x7fffffu) | 0x3f800000u);
        exponent = f32(bits >> 23u) - 127.0;
        if (mantissa > 1.41421356) {
            mantissa *= 0.5;
            exponent += 1.0;
        }
        s = (mantissa - 1.0) / (mantissa + 1.0);
    }
    let square = s * s;
    let series = 1.0 + square * (0.33333333 + square * (0.2 + square * (0.14285714 + square * 0.11111111)));
    if (x > 0.4) { return (0.69314718 * exponent + 2.0 * s * series) / x; }
    return 2.0 / (2.0 + x) * series;
}

// A round surface as it is near a point: all that is as far as the radius from a piece of the axis, of which this is half the length; the
// smaller principal curvature in parts of the larger one; and how much of the potential is by the distance from the cylinder that it is in
// place of.
struct RoundField { half: f32, second: f32, by_cylinder: f32 }

// So many radii longer at either end is a capsule with the radius and the capacitance of a cylinder.
const BEYOND_ENDS: f32 = 0.4;

// How much of the potential is by the distance from a cylinder, where ends are those of a capsule.
const BY_CYLINDER: f32 = 0.5;

// So many times as long, ends are nowhere.
const ENDLESS: f32 = 1e6;

fn round_field(star: Star, solid: Solid, point: vec3<f32>) -> RoundField {
    if (solid.kind != CYLINDER && solid.size.z == 0.0) { return RoundField(0.0, 1.0, 0.0); }
    var field = RoundField(solid.size.z, 0.0, 0.0);
    if (solid.kind == CYLINDER) {
        let ended = min(2.0 * rounded_part(star, solid), 1.0);
        if (ended == 0.0) { return RoundField(ENDLESS * solid.size.z, 0.0, 0.0); }
        // As ends appear, they come from far away.
        field.half = solid.size.z / ended - (1.0 - BEYOND_ENDS) * solid.size.x;
        field.by_cylinder = BY_CYLINDER * ended;
    }
    field.second = clamp((abs(point.z) - field.half) / solid.size.x + 0.5, 0.0, 1.0);
    return field;
}

// How much the ends of a cylinder are those of a capsule: where nothing is known of rims, all, but for disks. Up to a half they come from
// far away; from there on nodes before them have more and more of what is before the side, too.
fn rounded_part(star: Star, solid: Solid) -> f32 {
    let within = (1.0 - BEYOND_ENDS) * solid.size.x;
    let largest = max(size_along(star, solid.turn[2]), size_across(star, solid.turn[2]));
    return (1.0 - known_within(solid.size.x, largest)) * clamp(solid.size.z / within - 1.0, 0.0, 1.0);
}

// How far a point is from a cylinder; negative within.
fn distance_to_cylinder(solid: Solid, point: vec3<f32>) -> f32 {
    let outside = vec2<f32>(length(point.xy) - solid.size.x, abs(point.z) - solid.size.z);
    if (all(outside > vec2<f32>(0.0))) { return length(outside); }
    return max(outside.x, outside.y);
}

// The potential before a round surface, in radii; zero in the object.
fn round_potential(solid: Solid, field: RoundField, point: vec3<f32>) -> f32 {
    let axis = vec3<f32>(0.0, 0.0, clamp(point.z, -field.half, field.half));
    let of_piece = potential_at_distance(solid, field, distance(point, axis) - solid.size.x);
    if (field.by_cylinder == 0.0) { return of_piece; }
    let of_cylinder = potential_at_distance(solid, field, distance_to_cylinder(solid, point));
    return of_piece + field.by_cylinder * (of_cylinder - of_piece);
}

fn potential_at_distance(solid: Solid, field: RoundField, gap: f32) -> f32 {
    let along = max(gap, 0.0) / solid.size.x;
    let rest = 1.0 - field.second;
    let shared_part = along / (1.0 + field.second * along);
    return shared_part * select(1.0, log_over(rest * shared_part), rest * shared_part > 0.0);
}

// How much is known of a rim where cells are so large at most.
fn known_within(radius: f32, largest: f32) -> f32 { return clamp(radius / largest - 1.0, 0.0, 1.0); }

// The largest size of a cell across an axis, a unit vector.
fn size_across(star: Star, axis: vec3<f32>) -> f32 {
    let sizes = narrowest_beside(star);
    let by_axis = sizes * axis;
    let even = min(abs(by_axis.x + by_axis.y + by_axis.z), abs(by_axis.x + by_axis.y - by_axis.z));
    let odd = min(abs(by_axis.x - by_axis.y + by_axis.z), abs(by_axis.x - by_axis.y - by_axis.z));
    let along = min(even, odd);
    return sqrt(max(dot(sizes, sizes) - along * along, 0.0));
}

// How much of a node's links what is round has if there is nothing else: a capsule, or the side of a cylinder but for a cell at either
// end, unless its ends are those of a capsule.
fn round_share(star: Star, solid: Solid, point: vec3<f32>) -> f32 {
    let axis = vec3<f32>(0.0, 0.0, clamp(point.z, -solid.size.z, solid.size.z));
    let away = point - axis;
    var place = axis;
    var part = 1.0;
    if (solid.kind == CYLINDER) {
        let beside = clamp((solid.size.z - abs(point.z)) / size_along(star, solid.turn[2]), 0.0, 1.0);
        part = beside + (1.0 - beside) * max(2.0 * rounded_part(star, solid) - 1.0, 0.0);
        if (part == 0.0) { return 0.0; }
        let across = length(away.xy);
        let kept = select(1.0, solid.size.x / across, across > solid.size.x);
        place += vec3<f32>(away.xy * kept, 0.0);
    } else {
        let distance = length(away);
        place += away * select(0.0, solid.size.x / distance, distance > 0.0);
    }
    place = solid.turn * (place - point);
    return part * part_at(star, place) * within(star, place, vec3<f32>(0.0));
}
