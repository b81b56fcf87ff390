// Coarse networks.

fn steps(grid: Grid) -> vec3<u32> {
    return vec3<u32>(1u, grid.counts.x, grid.counts.x * grid.counts.y);
}

fn node_at(grid: Grid, place: vec3<u32>) -> u32 {
    return (place.z * grid.counts.y + place.y) * grid.counts.x + place.x;
}

fn place_of(grid: Grid, node: u32) -> vec3<u32> {
    let row = node / grid.counts.x;
    return vec3<u32>(node - row * grid.counts.x, row % grid.counts.y, row / grid.counts.y);
}

fn weight(grid: Grid, array: u32, node: u32) -> f32 {
    return networks[in_networks + grid.at + array * grid.stride + node];
}

fn shares(grid: Grid, axis: u32, node: u32) -> vec2<f32> {
    let before = weight(grid, axis, node - steps(grid)[axis]);
    let after = weight(grid, axis, node);
    let leak = max(weight(grid, 3u, node), 0.0);
    return vec2<f32>(before, after) / max(before + after + leak, LEAST);
}

fn is_given_up(number: u32, axis: u32, count: u32, plane: u32) -> bool {
    return plane < count && maps[plan.transfers[number].coarse[axis] + plane] % 2u == 1u;
}

// What becomes of a weight between two nodes that are given up: shared, crossing, lost.
fn divided(own: vec2<f32>, beside: vec2<f32>) -> vec3<f32> {
    let more = max(own.x - beside.x, 0.0);
    let less = max(beside.x - own.x, 0.0);
    let crossing = min(more, max(beside.y - own.y, 0.0));
    let back = min(less, max(own.y - beside.y, 0.0));
    let lost = more - crossing;
    return vec3<f32>(own.x - more, crossing + back, select(0.0, lost, lost > ROUNDING));
}

struct Row { next: array<f32, 3>, leak: f32, more: f32 }

fn divide(row: ptr<function, Row>, grid: Grid, axis: u32, node: u32, is_before: bool, along: f32) {
    let of_node = shares(grid, axis, node);
    let own = select(of_node, of_node.yx, is_before);
    let lost = 1.0 - (own.x + own.y);
    (*row).leak += along * select(0.0, lost, lost > ROUNDING);
    for (var across = 0u; across < 3u; across++) {
        if (across == axis) { continue; }
        let step = steps(grid)[across];
        let before = weight(grid, across, node - step);
        let after = weight(grid, across, node);
        let of_after = shares(grid, axis, node + step);
        let of_before = shares(grid, axis, node - step);
        let with_after = divided(own, select(of_after, of_after.yx, is_before));
        let with_before = divided(own, select(of_before, of_before.yx, is_before));
        let crossing = 0.5 * vec2<f32>(after * with_after.y, before * with_before.y);
        (*row).next[across] += after * with_after.x + crossing.x;
        (*row).more += crossing.x + crossing.y;
        (*row).leak += after * with_after.z + before * with_before.z;
    }
}

fn coarsen(number: u32, axis: u32) {
    let grids = plan.transfers[number].grids;
    if (grids[axis] == grids[axis + 1u]) { return; }
    let grid = plan.grids[grids[axis]];
    let coarse = plan.grids[grids[axis + 1u]];
    for (var to = first; to < coarse.nodes; to += every) {
        var place = place_of(coarse, to);
        let plane = maps[plan.transfers[number].fine[axis] + place[axis]];
        place[axis] = plane;
        let node = node_at(grid, place);
        var row: Row;
        for (var array = 0u; array < 3u; array++) { row.next[array] = weight(grid, array, node); }
        row.leak = max(weight(grid, 3u, node), 0.0);
        row.more = 0.0;
        let along = row.next[axis];
        var series = along;
        if (is_given_up(number, axis, grid.counts[axis], plane + 1u)) {
            let given_up = node + steps(grid)[axis];
            divide(&row, grid, axis, given_up, false, along);
            series = series * shares(grid, axis, given_up).y + row.more;
        }
        if (plane > 0u && is_given_up(number, axis, grid.counts[axis], plane - 1u)) {
            let given_up = node - steps(grid)[axis];
            divide(&row, grid, axis, given_up, true, weight(grid, axis, given_up));
        }
        row.next[axis] = series;
        let at = in_networks + coarse.at + to;
        for (var array = 0u; array < 3u; array++) { networks[at + array * coarse.stride] = row.next[array]; }
        networks[at + 3u * coarse.stride] = row.leak;
    }
}
