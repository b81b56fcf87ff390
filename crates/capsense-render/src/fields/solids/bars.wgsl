// What of a bar is in a solid: `solids/bars.rs` of the core, which says how it is told.

// Bars are no thinner than this, in metres.
const LEAST_REACH: f32 = 1e-25;
// What is missing from a cross-section is the same all along a bar if it differs by less than this from end to end.
const EVEN: f32 = 1e-3;

// A bar of a solid's frame: where its middle line starts, from there to its end, and how far the cross-section reaches.
struct Bar { start: vec3<f32>, way: vec3<f32>, half: vec3<f32> }

const WHOLE: Fill = Fill(1.0f, Span(0.0f, 1.0f));
const EMPTY: Fill = Fill(0.0f, Span(1.0f, 0.0f));

// What a bar beside an edge, which reaches so far along the axes of the sensor frame, has in an object.
fn object_fill(object: u32, edge: Edge, shift: vec3<f32>, reach: vec3<f32>) -> Fill {
    let solid = solid_of(object);
    let start = in_frame(solid, moved(anchor, shift));
    let end = in_frame(solid, moved(spot_of(next_along(edge.place, edge.axis)), shift));
    return solid_fill(solid, Bar(start, end - start, reach * absolute(solid.turn)));
}

fn solid_fill(solid: Solid, bar: Bar) -> Fill {
    let size = shrunk(solid);
    let is_along_axis = dot(bar.way.xy, bar.way.xy) < 4.0 * dot(bar.half.xy, bar.half.xy);
    switch solid.kind {
        case BOX: {
            let x = left_between(bar, 0u, vec2<f32>(-size.x, size.x));
            let y = left_between(bar, 1u, vec2<f32>(-size.y, size.y));
            return kept(kept(x, y), left_between(bar, 2u, vec2<f32>(-size.z, size.z)));
        }
        case CAPSULE: {
            if (size.z == 0.0 || !is_along_axis) { return on_middle_line(interval(solid, bar.start, bar.way)); }
            let middle = (bar.start + 0.5 * bar.way).xy;
            let end = solid.size.z + sqrt(max(size.x * size.x - dot(middle, middle), 0.0));
            return kept(left_about_axis(bar, size.x), left_between(bar, 2u, vec2<f32>(-end, end)));
        }
        default: {
            let ends = left_between(bar, 2u, vec2<f32>(-size.z, size.z));
            if (is_along_axis) { return kept(ends, left_about_axis(bar, size.x)); }
            return kept(ends, on_middle_line(disk_interval(bar.start, bar.way, size.x)));
        }
    }
}

// What two fills leave of each other.
fn kept(a: Fill, b: Fill) -> Fill {
    let span = Span(max(a.span.enter, b.span.enter), min(a.span.leave, b.span.leave));
    if (!(span.enter < span.leave)) { return EMPTY; }
    return Fill(a.part * b.part, span);
}

fn on_middle_line(on_line: vec2<f32>) -> Fill { return kept(WHOLE, Fill(1.0, Span(on_line.x, on_line.y))); }

fn left_between(bar: Bar, axis: u32, faces: vec2<f32>) -> Fill {
    return left_of(bar.start[axis], bar.way[axis], max(bar.half[axis], LEAST_REACH), faces);
}

// What the side of a cylinder about the z axis leaves of a bar that is nearly along it.
fn left_about_axis(bar: Bar, radius: f32) -> Fill {
    let start = bar.start.xy;
    let end = start + bar.way.xy;
    let middle = 0.5 * (start + end);
    var outwards = vec2<f32>(1.0, 0.0);
    if (dot(middle, middle) > 0.0) { outwards = normalize(middle); }
    let reach = max(dot(bar.half.xy, abs(outwards)), LEAST_REACH);
    return left_of(length(start), length(end) - length(start), reach, vec2<f32>(-radius - 2.0 * reach, radius));
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
