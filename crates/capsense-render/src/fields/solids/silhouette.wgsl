// Edges of whose dual face a conductor covers a part: `occupancy/silhouette.rs` of the core in single precision. All of it is in
// the frame of the one object that it is about.

const FRINGE: f32 = 0.09;

// The box around an edge in the frame of an object: the edge's start and the way along it; and of both axes across it where they
// lead, how far the box reaches below and above, and how much further than it does a conductor is taken to reach.
struct Tube {
    start: vec3<f32>, way: vec3<f32>, length: f32,
    across: array<vec3<f32>, 2>, widths: array<vec2<f32>, 2>, fringes: vec2<f32>,
    // The box with all from where a conductor reaches it: its middle from the object's origin along the axes of the sensor frame,
    // and half its size.
    middle: vec3<f32>, half: vec3<f32>,
}

fn tube_of(star: Star, axis: u32, solid: Solid) -> Tube {
    var tube: Tube;
    let begin = from_origin(solid, spot_of(star.place));
    var turn = transpose(solid.turn);
    tube.length = star.above[axis];
    tube.start = begin * solid.turn;
    tube.way = tube.length * turn[axis];
    var low = vec3<f32>(0.0);
    var high = vec3<f32>(0.0);
    high[axis] = tube.length;
    for (var number = 0u; number < 2u; number++) {
        let across = (axis + 1u + number) % 3u;
        let below = star.below[across];
        let above = star.above[across];
        // No further than to the next node.
        let most = 0.5 * select(max(below, above), min(below, above), below > 0.0 && above > 0.0);
        let fringe = min(FRINGE * max(tube.length, 0.5 * (below + above)), most);
        tube.across[number] = turn[across];
        tube.widths[number] = 0.5 * vec2<f32>(below, above);
        tube.fringes[number] = fringe;
        low[across] = -(0.5 * below + fringe);
        high[across] = 0.5 * above + fringe;
    }
    tube.middle = begin + 0.5 * (low + high);
    tube.half = 0.5 * (high - low);
    return tube;
}

// From the edge to the middle of a side of its box; nothing at the wall.
fn side_across(tube: Tube, number: u32, side: u32) -> vec3<f32> {
    var all_across = tube.across;
    var all_widths = tube.widths;
    let width = all_widths[number][side];
    return select(-width, width, side == 1u) * all_across[number];
}

fn width_of(span: Span) -> f32 { return max(span.leave - span.enter, 0.0); }

// How much of a ray a conductor fills.
fn width_across(solid: Solid, start: vec3<f32>, ray: vec3<f32>) -> f32 {
    return width_of(solid_span(solid, start, start + ray));
}

fn point_in(tube: Tube, span: Span, part: f32) -> vec3<f32> {
    return tube.start + (span.enter + part * (span.leave - span.enter)) * tube.way;
}

// Whether the face of a conductor ends at a wall along the edge: one if it is as wide close to the face as in the middle of what
// the edge meets of it, zero if it is half as wide.
fn abruptness(solid: Solid, tube: Tube, span: Span, ray: vec3<f32>, middle: f32) -> f32 {
    if (middle <= 0.0) { return 1.0; }
    var narrowest = middle;
    if (span.enter > 0.0) { narrowest = min(narrowest, width_across(solid, point_in(tube, span, 0.1), ray)); }
    if (span.leave < 1.0) { narrowest = min(narrowest, width_across(solid, point_in(tube, span, 0.9), ray)); }
    return clamp(2.5 * narrowest / middle - 1.25, 0.0, 1.0);
}

// The part of a box around an edge that meets the conductor which the edge meets.
fn part_covered(solid: Solid, tube: Tube, span: Span) -> f32 {
    var least = 1.0;
    var all_widths = tube.widths;
    for (var number = 0u; number < 2u; number++) {
        let widths = all_widths[number];
        var covered = 0.0;
        for (var side = 0u; side < 2u; side++) {
            let width = widths[side];
            if (width == 0.0) { continue; }
            let ray = side_across(tube, number, side);
            let reach = width_across(solid, point_in(tube, span, 0.5), ray);
            let missing = max(width * (1.0 - reach) - tube.fringes[number], 0.0);
            covered += width;
            if (missing > 0.0) { covered -= missing * abruptness(solid, tube, span, ray, reach); }
        }
        least = min(least, covered / (widths.x + widths.y));
    }
    return least;
}

// What a conductor beside an edge takes from it, and the links of its ends.
struct Beside { taken: f32, links: vec2<f32> }

// As a wall comes to the edge, this becomes what the edge rule makes of it.
fn nearly(part: f32, away: f32) -> f32 {
    if (part >= 1.0) { return 1.0; }
    return part / max(part + (1.0 - part) * away, LEAST);
}

// Of one end, if all of the box were covered: what is taken, and the link. `away` is how far the wall is, in parts of the box's width
// on that side.
fn link_beside(tube: Tube, gaps: vec2<f32>, wall: f32, away: f32) -> vec2<f32> {
    let gap = gaps.x;
    if (gap > 0.0) {
        let fading = nearly(2.0 * (1.0 - gap), away);
        return vec2<f32>(fading * nearly(4.0 * gap, away), fading * over_way(tube, gap, wall));
    }
    let filled = 1.0 - gaps.y;
    return vec2<f32>(0.0, max(1.0 - 2.0 * filled, 0.0) * over_way(tube, filled, wall));
}

fn over_way(tube: Tube, along: f32, wall: f32) -> f32 {
    return tube.length / max(length(vec2<f32>(wall, along * tube.length)), SMALLEST_PART * tube.length);
}

// What a conductor fills of the box between an edge and a side of it: the part along the edge and across it, and how much it
// fills of a ray in the middle of the former.
struct Probe { is_met: bool, along: Span, across: Span, middle: f32 }

fn probe(solid: Solid, tube: Tube, ray: vec3<f32>) -> Probe {
    let along = solid_span(solid, tube.start + ray, tube.start + ray + tube.way);
    if (is_hit(along)) {
        let start = point_in(tube, along, 0.5);
        let across = solid_span(solid, start, start + ray);
        return Probe(is_hit(across), along, across, width_of(across));
    }
    // One that is too thin to reach the side is found where it passes an end of the edge.
    for (var end = 0u; end < 2u; end++) {
        let start = select(tube.start, tube.start + tube.way, end == 1u);
        let across = solid_span(solid, start, start + ray);
        if (!is_hit(across)) { continue; }
        let beside = tube.start + 0.5 * (across.enter + across.leave) * ray;
        let beside_it = solid_span(solid, beside, beside + tube.way);
        if (!is_hit(beside_it)) { continue; }
        return Probe(true, beside_it, across, width_across(solid, point_in(tube, beside_it, 0.5), ray));
    }
    return Probe(false, MISSED, MISSED, 0.0);
}

fn beside_towards(solid: Solid, tube: Tube, number: u32, side: u32) -> Beside {
    let nothing = Beside(0.0, vec2<f32>(0.0));
    var all_widths = tube.widths;
    let widths = all_widths[number];
    let width = widths[side];
    if (width == 0.0) { return nothing; }
    let fringe = tube.fringes[number];
    let reach = 1.0 + fringe / width;
    let ray = reach * side_across(tube, number, side);
    if (solid_misses(solid, tube.start + 0.5 * (tube.way + ray), 0.5 * (abs(tube.way) + abs(ray)))) { return nothing; }
    let found = probe(solid, tube, ray);
    if (!found.is_met) { return nothing; }
    let place = reach * width;
    let wall = place * found.across.enter;
    // Near the edge the fringe fills some of the box behind it.
    let start = max(wall - fringe, -widths[1u - side]);
    let covered = max(min(place * found.across.leave, width) - start, 0.0) / (widths.x + widths.y);
    let part = covered * abruptness(solid, tube, found.along, ray, found.middle);
    let gaps = vec2<f32>(found.along.enter, 1.0 - found.along.leave);
    let away = clamp(wall / width, 0.0, 1.0);
    let at_start = link_beside(tube, gaps, wall, away);
    let at_end = link_beside(tube, gaps.yx, wall, away);
    return Beside(part * max(at_start.x, at_end.x), part * vec2<f32>(at_start.y, at_end.y));
}

// What a conductor beside an edge that meets no object makes of it.
fn all_beside(solid: Solid, tube: Tube) -> Beside {
    var most = Beside(0.0, vec2<f32>(0.0));
    for (var number = 0u; number < 2u; number++) {
        let below = beside_towards(solid, tube, number, 0u);
        let above = beside_towards(solid, tube, number, 1u);
        most.taken = max(most.taken, min(below.taken + above.taken, 1.0));
        most.links = max(most.links, below.links + above.links);
    }
    return most;
}
