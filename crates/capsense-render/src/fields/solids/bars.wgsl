// What of a bar is in a solid: `solids/bars.rs` of the core, which says how it is told.

// Bars are no thinner than this, in metres.
const LEAST_REACH: f32 = 1e-25;
// What is missing from a cross-section is the same all along a bar if it differs by less than this from end to end.
const EVEN: f32 = 1e-3;

// A bar of a solid's frame: where its middle line starts, from there to its end, and from the middle of the cross-section to those of two sides.
struct Bar { start: vec3<f32>, way: vec3<f32>, first: vec3<f32>, second: vec3<f32> }

// Directions are along each other if they differ by no more than this.
const ALONG: f32 = 1e-5;

const WHOLE: Fill = Fill(1.0f, Span(0.0f, 1.0f));
const EMPTY: Fill = Fill(0.0f, Span(1.0f, 0.0f));

// What a bar beside an edge, which reaches so far along the axes across it, has in an object.
fn object_fill(object: u32, edge: Edge, shift: vec3<f32>, reach: vec2<f32>) -> Fill {
    let solid = solid_of(object);
    var turn = solid.turn;
    let start = in_frame(solid, moved(anchor, shift));
    let end = in_frame(solid, moved(spot_of(next_along(edge.place, edge.axis)), shift));
    var first = vec3<f32>();
    var second = vec3<f32>();
    first[(edge.axis + 1u) % 3u] = reach.x;
    second[(edge.axis + 2u) % 3u] = reach.y;
    return solid_fill(solid, Bar(start, end - start, first * turn, second * turn));
}

fn is_along_z(way: vec3<f32>) -> bool { return length(way.xy) <= ALONG * length(way); }
fn is_across_z(way: vec3<f32>) -> bool { return abs(way.z) <= ALONG * length(way); }

// Whether the sides of a bar are along the z axis and across it.
fn is_aligned(bar: Bar) -> bool {
    return (is_along_z(bar.way) || is_across_z(bar.way)) && (is_along_z(bar.first) || is_across_z(bar.first))
        && (is_along_z(bar.second) || is_across_z(bar.second));
}

fn solid_fill(solid: Solid, bar: Bar) -> Fill {
    let size = shrunk(solid);
    switch solid.kind {
        case BOX: {
            let x = left_between(bar, 0u, vec2<f32>(-size.x, size.x));
            let y = left_between(bar, 1u, vec2<f32>(-size.y, size.y));
            let all = kept(kept(x, y), left_between(bar, 2u, vec2<f32>(-size.z, size.z)));
            return where_not_apart(all, bar, size);
        }
        case CAPSULE: {
            if (size.z == 0.0 || !is_along_z(bar.way)) { return on_line(interval(solid, bar.start, bar.way)); }
            let next = nearest_to_axis(bar);
            return kept(left_about_axis(next, size.x), on_line(interval(solid, next.start, bar.way)));
        }
        default: {
            if (!is_aligned(bar)) { return on_line(interval(solid, bar.start, bar.way)); }
            let ends = left_between(bar, 2u, vec2<f32>(-size.z, size.z));
            if (is_along_z(bar.way)) { return kept(ends, left_about_axis(nearest_to_axis(bar), size.x)); }
            return kept(ends, on_line(disk_interval(bar.start, bar.way, size.x)));
        }
    }
}

// What two fills leave of each other.
fn kept(a: Fill, b: Fill) -> Fill {
    let span = Span(max(a.span.enter, b.span.enter), min(a.span.leave, b.span.leave));
    if (!(span.enter < span.leave)) { return EMPTY; }
    return Fill(a.part * b.part, span);
}

fn on_line(found: vec2<f32>) -> Fill { return kept(WHOLE, Fill(1.0, Span(found.x, found.y))); }

fn left_between(bar: Bar, axis: u32, faces: vec2<f32>) -> Fill {
    let reach = abs(bar.first[axis]) + abs(bar.second[axis]);
    return left_of(bar.start[axis], bar.way[axis], max(reach, LEAST_REACH), faces);
}

// How far a bar and a box reach into each other along a direction.
fn overlap(bar: Bar, half: vec3<f32>, normal: vec3<f32>) -> f32 {
    let way = 0.5 * bar.way;
    let reach = abs(dot(normal, way)) + abs(dot(normal, bar.first)) + abs(dot(normal, bar.second));
    return dot(abs(normal), half) + reach - abs(dot(normal, bar.start + way));
}

// The part of a bar's thickness in a direction that reaches into a box.
fn trimmed(bar: Bar, half: vec3<f32>, normal: vec3<f32>) -> f32 {
    let thickness = abs(dot(normal, bar.first)) + abs(dot(normal, bar.second));
    return overlap(bar, half, normal) / max(2.0 * thickness, LEAST_REACH);
}

// Nothing of a bar that a plane parts from a box, which its faces by themselves do not tell, and little of one that nearly is.
fn where_not_apart(fill: Fill, bar: Bar, half: vec3<f32>) -> Fill {
    if (fill.part == 0.0 || (fill.part == 1.0 && fill.span.leave - fill.span.enter == 1.0)) { return fill; }
    let way = 0.5 * bar.way;
    let longest = max(overlap(bar, half, way) / (2.0 * dot(way, way)), 0.0);
    var part = min(trimmed(bar, half, bar.first), trimmed(bar, half, bar.second));
    var sides = array<vec3<f32>, 3>(way, bar.first, bar.second);
    for (var axis = 0u; axis < 3u; axis++) {
        for (var side = 0u; side < 3u; side++) {
            var along_axis = vec3<f32>();
            along_axis[axis] = 1.0;
            let normal = cross(along_axis, sides[side]);
            if (length(normal) > ALONG * length(sides[side])) { part = min(part, trimmed(bar, half, normal)); }
        }
    }
    let span = Span(fill.span.enter, min(fill.span.leave, fill.span.enter + longest));
    return Fill(clamp(part, 0.0, fill.part), span);
}

// Where the line of a bar that is along the z axis and next to it starts, and how far it and the farthest are from the axis.
struct Nearest { start: vec3<f32>, distance: f32, farthest: f32 }

fn nearest_to_axis(bar: Bar) -> Nearest {
    var nearest = Nearest(bar.start, length(bar.start.xy), 0.0);
    for (var place = 0; place < 9; place++) {
        let along_first = f32(place % 3 - 1);
        let along_second = f32(place / 3 - 1);
        let start = bar.start + along_first * bar.first + along_second * bar.second;
        let distance = length(start.xy);
        if (distance < nearest.distance) {
            nearest.start = start;
            nearest.distance = distance;
        }
        nearest.farthest = max(nearest.farthest, distance);
    }
    return nearest;
}

// What the side of a cylinder about the z axis leaves of a bar that is along it.
fn left_about_axis(nearest: Nearest, radius: f32) -> Fill {
    let part = clamp((radius - nearest.distance) / max(nearest.farthest - nearest.distance, LEAST_REACH), 0.0, 1.0);
    return Fill(part, Span(0.0, 1.0));
}

// What two faces leave of a bar whose middle line starts at a place along an axis and leads so far along it.
fn left_of(start: f32, way: f32, reach: f32, faces: vec2<f32>) -> Fill {
    let end = start + way;
    // How far the middle line is inside of either face at the most.
    let inside = vec2<f32>(max(start, end) - faces.x, faces.y - min(start, end));
    let fits = min((faces.y - faces.x) / (2.0 * reach), 1.0);
    let part = clamp((min(inside.x, inside.y) + reach) / (2.0 * reach), 0.0, fits);
    if (part == 0.0) { return EMPTY; }
    let missing = vec2<f32>(missing_of(inside.x, abs(way), reach), missing_of(inside.y, abs(way), reach));
    let all = missing.x + missing.y;
    let filled = min(max(1.0 - all, 0.0) / part, 1.0);
    var enter = select(missing.x, missing.y, way < 0.0);
    if (part < 1.0) { enter *= (1.0 - filled) / max(all, LEAST); }
    return Fill(part, Span(enter, enter + filled));
}

fn missing_of(inside: f32, way: f32, reach: f32) -> f32 {
    if (inside - way >= reach) { return 0.0; }
    if (way < 2.0 * reach) {
        let least = (reach - inside) / (2.0 * reach);
        let more = way / (2.0 * reach);
        if (more < EVEN) { return clamp(least + 0.5 * more, 0.0, 1.0); }
        if (least >= 1.0) { return 1.0; }
        return (sum_beside(least + more) - sum_beside(least)) / more;
    }
    let width = 2.0 * reach / way;
    let behind = 1.0 - inside / way;
    return sum_behind(behind, width) - sum_behind(behind - 1.0, width);
}

fn sum_beside(ramp: f32) -> f32 {
    let some = clamp(ramp, 0.0, 1.0);
    return 0.5 * some * some + max(ramp - 1.0, 0.0);
}

fn sum_behind(behind: f32, width: f32) -> f32 {
    let some = clamp(behind + 0.5 * width, 0.0, width);
    return 0.5 * some * (some / width) + max(behind - 0.5 * width, 0.0);
}
