// Conjugate gradients on the finest level.

fn scene_header() -> Scene {
    let at = scene * HEADER;
    return Scene(
        changes[at], changes[at + 1u], changes[at + 2u], changes[at + 3u], changes[at + 4u], changes[at + 5u], changes[at + 6u],
        changes[at + 7u], changes[at + 8u], changes[at + 9u], changes[at + 10u], changes[at + 11u],
    );
}

fn empty_columns() {
    let emptied = scene_header().emptied | absent_columns();
    if (emptied == 0u) { return; }
    let stride = plan.levels[0].stride;
    for (var node = first; node < plan.grids[0].nodes; node += every) {
        let holder = holders[in_holders + node];
        for (var column = 0u; column < COLUMNS; column++) {
            if ((emptied & (1u << column)) == 0u) { continue; }
            let at = in_vectors + column * stride + node;
            vectors[at + plan.potential] = select(0.0, 1.0, holder == column);
            vectors[at + plan.steps.x] = 0.0;
            vectors[at + plan.steps.y] = 0.0;
        }
    }
    // What is no number must not come back from any level.
    for (var number = 0u; number < plan.level_count; number++) {
        let level = plan.levels[number];
        for (var node = first; node < plan.grids[level.grid].nodes; node += every) {
            for (var column = 0u; column < COLUMNS; column++) {
                if ((emptied & (1u << column)) != 0u) {
                    vectors[in_vectors + column * level.stride + level.correction + node] = 0.0;
                }
            }
        }
    }
}

fn take_changes() {
    let header = scene_header();
    let grid = plan.grids[0];
    let stride = plan.levels[0].stride;
    for (var row = first; row < header.rows; row += every) {
        let at = header.rows_at + 6u * row;
        let node = changes[at];
        let holder = changes[at + 5u];
        let leak = bitcast<f32>(changes[at + 4u]);
        let is_free = holder == NO_HOLDER;
        for (var array = 0u; array < 3u; array++) {
            networks[in_networks + grid.at + array * grid.stride + node] = bitcast<f32>(changes[at + 1u + array]);
        }
        networks[in_networks + grid.at + 3u * grid.stride + node] = select(FIXED, leak, is_free);
        vectors[in_vectors + plan.leak + node] = leak;
        holders[in_holders + node] = holder;
        for (var column = 0u; column < COLUMNS && !is_free; column++) {
            vectors[in_vectors + plan.potential + column * stride + node] = select(0.0, 1.0, holder == column);
        }
    }
    for (var feed = first; feed < header.feeds; feed += every) {
        let at = header.feeds_at + 3u * feed;
        let place = plan.feed + changes[at + 1u] * stride + changes[at];
        vectors[in_vectors + place] = bitcast<f32>(changes[at + 2u]);
    }
}

// What a node draws: Σ w (v - v') and through its links to 0 V.
fn charge(all: Around, step: vec3<u32>, vector: u32, node: u32) -> f32 {
    let at = vector + node;
    let own = vectors[at];
    let before = own - vec3<f32>(vectors[at - step.x], vectors[at - step.y], vectors[at - step.z]);
    let after = own - vec3<f32>(vectors[at + step.x], vectors[at + step.y], vectors[at + step.z]);
    return dot(all.before, before) + dot(all.after, after) + vectors[in_vectors + plan.leak + node] * own;
}

fn find_residual() {
    let level = plan.levels[0];
    let grid = plan.grids[0];
    if (team == 0u && thread < COLUMNS) {
        let at = record_at(0u, thread);
        let is_solved = scene_header().is_solved == 1u;
        scratch[at] = 0.0;
        scratch[at + 1u] = 0.0;
        scratch[at + 2u] = select(0.0, LARGEST, is_solved);
        scratch[at + 3u] = select(0.0, 1.0, is_solved);
    }
    for (var node = first; node < grid.nodes; node += every) {
        let all = around(grid, node);
        let place = place_of(grid, node);
        let is_red = (place.x + place.y + place.z) % 2u == RED;
        for (var column = 0u; column < COLUMNS; column++) {
            let at = in_vectors + column * level.stride + node;
            let drawn = charge(all, steps(grid), in_vectors + plan.potential + column * level.stride, node);
            let residual = select(0.0, vectors[at + plan.feed] - drawn, holders[in_holders + node] == NO_HOLDER);
            vectors[at + level.residual] = residual;
            if (is_red) { vectors[at + level.correction] = all.inverse * residual; }
        }
    }
}

// r·z, as far as this workgroup has it.
fn sum_rz() {
    let level = plan.levels[0];
    var sums: array<f32, COLUMNS>;
    for (var node = first; node < plan.grids[0].nodes; node += every) {
        for (var column = 0u; column < COLUMNS; column++) {
            let at = in_vectors + column * level.stride + node;
            sums[column] += vectors[at + level.residual] * vectors[at + level.correction];
        }
    }
    for (var column = 0u; column < COLUMNS; column++) {
        let sum = sum_of_team(sums[column]);
        if (thread == 0u) { scratch[in_scratch + OF_RZ + team * COLUMNS + column] = sum; }
    }
}

// p = z + β p, and K p.
fn find_direction(iteration: u32) {
    let level = plan.levels[0];
    let grid = plan.grids[0];
    var betas: array<f32, COLUMNS>;
    for (var column = 0u; column < COLUMNS; column++) {
        let rz = total(OF_RZ, column);
        let last = scratch[record_at(iteration, column)];
        let goes_on = iteration > 0u && last > 0.0 && is_active(iteration, column);
        betas[column] = select(0.0, rz / max(last, LEAST), goes_on);
    }
    let before = plan.steps[iteration % 2u];
    let now = plan.steps[(iteration + 1u) % 2u];
    var sums: array<f32, COLUMNS>;
    let step = steps(grid);
    if (any_active(iteration)) {
        for (var node = first; node < grid.nodes; node += every) {
            let all = around(grid, node);
            let is_free = holders[in_holders + node] == NO_HOLDER;
            let leak = vectors[in_vectors + plan.leak + node];
            for (var column = 0u; column < COLUMNS; column++) {
                let at = in_vectors + column * level.stride + node;
                let z = at + level.correction;
                let p = at + before;
                let beta = betas[column];
                let own = vectors[z] + beta * vectors[p];
                let z_before = vec3<f32>(vectors[z - step.x], vectors[z - step.y], vectors[z - step.z]);
                let z_after = vec3<f32>(vectors[z + step.x], vectors[z + step.y], vectors[z + step.z]);
                let p_before = vec3<f32>(vectors[p - step.x], vectors[p - step.y], vectors[p - step.z]);
                let p_after = vec3<f32>(vectors[p + step.x], vectors[p + step.y], vectors[p + step.z]);
                let drawn = dot(all.before, own - (z_before + beta * p_before))
                    + dot(all.after, own - (z_after + beta * p_after)) + leak * own;
                let image = select(0.0, drawn, is_free);
                vectors[at + now] = own;
                vectors[at + plan.image] = image;
                sums[column] += own * image;
            }
        }
    }
    for (var column = 0u; column < COLUMNS; column++) {
        let sum = sum_of_team(sums[column]);
        if (thread == 0u) { scratch[in_scratch + OF_CURVATURE + team * COLUMNS + column] = sum; }
    }
}

// x += α p, r -= α K p, and the first sweep at red nodes.
fn advance(iteration: u32) {
    let level = plan.levels[0];
    let grid = plan.grids[0];
    var alphas: array<f32, COLUMNS>;
    for (var column = 0u; column < COLUMNS; column++) {
        alphas[column] = take_step(iteration, column);
    }
    if (!any_active(iteration)) { return; }
    let now = plan.steps[(iteration + 1u) % 2u];
    for (var node = first; node < grid.nodes; node += every) {
        let place = place_of(grid, node);
        let is_red = (place.x + place.y + place.z) % 2u == RED;
        let inverse = around(grid, node).inverse;
        for (var column = 0u; column < COLUMNS; column++) {
            let at = in_vectors + column * level.stride + node;
            let alpha = alphas[column];
            vectors[at + plan.potential] += alpha * vectors[at + now];
            let residual = vectors[at + level.residual] - alpha * vectors[at + plan.image];
            vectors[at + level.residual] = residual;
            if (is_red) { vectors[at + level.correction] = inverse * residual; }
        }
    }
}

// What that leaves out of the energies of what the links of a node lead to, each at 1 V in one column at most. Where the host finds
// objects, it adds this by itself: `RemoteSolver::constant`.
fn of_far_ends(leak: f32, feeds: vec2<f32>, is_own: bool) -> f32 {
    if (leak > 0.5 * max(abs(feeds.x), abs(feeds.y))) {
        return select(-feeds.x, leak - feeds.x, is_own) * feeds.y / leak;
    }
    return select(0.0, feeds.x, is_own);
}

// Energies of all pairs of columns, and the residuals and charges, as far as this workgroup has them.
fn evaluate() {
    let level = plan.levels[0];
    let grid = plan.grids[0];
    let step = steps(grid);
    let is_found = scene_header().is_found == 1u;
    for (var s = 0u; s < COLUMNS; s++) {
        var sums: array<vec2<f32>, COLUMNS>;
        var free = 0.0;
        var held = 0.0;
        let of_s = in_vectors + s * level.stride;
        for (var node = first; node < grid.nodes; node += every) {
            let all = around(grid, node);
            let leak = vectors[in_vectors + plan.leak + node];
            let at = of_s + plan.potential + node;
            let x = vectors[at];
            let along = x - vec3<f32>(vectors[at + step.x], vectors[at + step.y], vectors[at + step.z]);
            let feed = vectors[of_s + plan.feed + node];
            let drawn = charge(all, step, of_s + plan.potential, node) - feed;
            let holder = holders[in_holders + node];
            free += select(0.0, drawn * drawn, holder == NO_HOLDER);
            held += select(0.0, drawn * drawn, holder == s);
            for (var t = s; t < COLUMNS; t++) {
                let of_t = in_vectors + t * level.stride;
                let at_t = of_t + plan.potential + node;
                let y = vectors[at_t];
                let along_t = y - vec3<f32>(vectors[at_t + step.x], vectors[at_t + step.y], vectors[at_t + step.z]);
                let currents = all.after * along * along_t;
                sums[t] = add(sums[t], currents.x);
                sums[t] = add(sums[t], currents.y);
                sums[t] = add(sums[t], currents.z);
                let feeds = vec2<f32>(feed, vectors[of_t + plan.feed + node]);
                sums[t] = add(sums[t], of_links(leak, vec2<f32>(x, y), feeds));
                if (is_found) { sums[t] = add(sums[t], of_far_ends(leak, feeds, s == t)); }
            }
        }
        let base = in_scratch + OF_ENERGIES + team * NUMBERS;
        for (var t = s; t < COLUMNS; t++) {
            let sum = sum_pairs(sums[t]);
            if (thread == 0u) {
                scratch[base + 2u * (s * COLUMNS + t)] = sum.x;
                scratch[base + 2u * (s * COLUMNS + t) + 1u] = sum.y;
            }
        }
        let of_free = sum_of_team(free);
        let of_held = sum_of_team(held);
        if (thread == 0u) {
            scratch[base + 2u * COLUMNS * COLUMNS + s] = of_free;
            scratch[base + 2u * COLUMNS * COLUMNS + COLUMNS + s] = of_held;
        }
    }
}
