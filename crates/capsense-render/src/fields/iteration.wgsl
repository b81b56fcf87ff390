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

// What a column's energy may still fall by: `iteration.rs`. Where r·z is not positive although there is a residual, or K is not
// along the step, nothing is known, and going on would be of no use.
fn to_come(drop: f32, before: f32, is_first: bool) -> f32 {
    if (is_first) { return LARGEST; }
    let ratio = select(MOST_RATIO, clamp(drop / max(before, LEAST), LEAST_RATIO, MOST_RATIO), before > 0.0);
    return CAUTION * drop * ratio / (1.0 - ratio);
}

// x += α p, r -= α K p, and the first sweep at red nodes.
fn advance(iteration: u32) {
    let level = plan.levels[0];
    let grid = plan.grids[0];
    var alphas: array<f32, COLUMNS>;
    for (var column = 0u; column < COLUMNS; column++) {
        let rz = total(OF_RZ, column);
        let curvature = total(OF_CURVATURE, column);
        let goes_on = is_active(iteration, column) && rz > 0.0 && curvature > 0.0;
        let alpha = select(0.0, rz / max(curvature, LEAST), goes_on);
        alphas[column] = alpha;
        if (team == 0u && thread == 0u) {
            let last = record_at(iteration, column);
            let next = record_at(iteration + 1u, column);
            let drop = alpha * rz;
            let is_broken = !goes_on && rz != 0.0;
            let still = select(to_come(drop, scratch[last + 1u], iteration == 0u), select(0.0, LARGEST, is_broken), !goes_on);
            let allowed = bitcast<f32>(changes[plan.allowed_at + scene * COLUMNS + column]);
            let was_active = is_active(iteration, column);
            scratch[next] = rz;
            scratch[next + 1u] = select(scratch[last + 1u], drop, was_active);
            scratch[next + 2u] = select(scratch[last + 2u], still, was_active);
            let may_go_on = was_active && goes_on && iteration + 1u < scene_header().most_iterations;
            scratch[next + 3u] = select(0.0, 1.0, may_go_on && still > allowed);
        }
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

// A sum with what rounding took from it.
fn add(sum: vec2<f32>, value: f32) -> vec2<f32> {
    let high = sum.x + value;
    let part = high - sum.x;
    return vec2<f32>(high, sum.y + ((sum.x - (high - part)) + (value - part)));
}

var<workgroup> shared_pairs: array<vec2<f32>, THREADS>;

fn sum_pairs(value: vec2<f32>) -> vec2<f32> {
    shared_pairs[thread] = value;
    workgroupBarrier();
    for (var half = THREADS / 2u; half > 0u; half /= 2u) {
        if (thread < half) {
            let other = shared_pairs[thread + half];
            var sum = add(shared_pairs[thread], other.x);
            sum.y += other.y;
            shared_pairs[thread] = sum;
        }
        workgroupBarrier();
    }
    let sum = shared_pairs[0];
    workgroupBarrier();
    return sum;
}

// What the links of a node add to the energy of two columns: `capsense_core::solver::of_links`.
fn of_links(leak: f32, ends: vec2<f32>, feeds: vec2<f32>) -> f32 {
    if (leak > 0.5 * max(abs(feeds.x), abs(feeds.y))) {
        let differences = ends - feeds / leak;
        return leak * differences.x * differences.y;
    }
    return leak * ends.x * ends.y - feeds.x * ends.y - feeds.y * ends.x;
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

// What leaves the device of a scene: energies as sums and what rounding took from them, squared residuals and charges,
// what is still to come of each column, and the number of iterations.
fn collect(iterations: u32) {
    let out = scene * RESULTS;
    for (var s = 0u; s < COLUMNS; s++) {
        for (var t = s; t < COLUMNS; t++) {
            var sum = vec2<f32>();
            for (var one = thread; one < TEAMS; one += THREADS) {
                let at = in_scratch + OF_ENERGIES + one * NUMBERS + 2u * (s * COLUMNS + t);
                sum = add(sum, scratch[at]);
                sum.y += scratch[at + 1u];
            }
            let all = sum_pairs(sum);
            if (thread == 0u) {
                results[out + 2u * (s * COLUMNS + t)] = all.x;
                results[out + 2u * (s * COLUMNS + t) + 1u] = all.y;
            }
        }
    }
    for (var number = 2u * COLUMNS * COLUMNS; number < NUMBERS; number++) {
        var sum = 0.0;
        for (var one = thread; one < TEAMS; one += THREADS) {
            sum += scratch[in_scratch + OF_ENERGIES + one * NUMBERS + number];
        }
        let all = sum_of_team(sum);
        if (thread == 0u) { results[out + number] = all; }
    }
    if (thread == 0u) {
        var count = 0u;
        for (var iteration = 0u; iteration < iterations; iteration++) {
            if (any_active(iteration)) { count = iteration + 1u; }
        }
        for (var column = 0u; column < COLUMNS; column++) {
            results[out + NUMBERS + column] = scratch[record_at(count, column) + 2u];
        }
        results[out + NUMBERS + COLUMNS] = f32(count);
    }
}
