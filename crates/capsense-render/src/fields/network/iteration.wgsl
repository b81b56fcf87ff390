// Conjugate gradients on the finest level.

// Σ w (v - v') to all neighbours and through links to 0 V, less what links lead to otherwise.
fn charge(row: u32) -> Values {
    let level = plan.levels[0];
    let own = values_at(plan.potential, row);
    let leak = networks[plan.links + row];
    let feed = values_at(plan.feed, row);
    var sums: Values;
    for (var column = 0u; column < COLUMNS; column++) { sums[column] = leak * own[column] - feed[column]; }
    let entries = entries_of(level, row);
    for (var entry = entries.x; entry < entries.y; entry += SLICE) {
        let weight = networks[plan.weights + entry];
        let other = values_at(plan.potential, maps[level.columns + entry]);
        for (var column = 0u; column < COLUMNS; column++) { sums[column] += weight * (own[column] - other[column]); }
    }
    return sums;
}

fn find_residual() {
    let level = plan.levels[0];
    if (team == 0u && thread < COLUMNS) {
        let at = record_at(0u, thread);
        scratch[at] = 0.0;
        scratch[at + 1u] = 0.0;
        scratch[at + 2u] = LARGEST;
        scratch[at + 3u] = 1.0;
    }
    for (var row = first; row < level.rows; row += every) {
        let drawn = charge(row);
        let inverse = networks[level.inverse + row];
        let is_free = holders[row] == NO_HOLDER;
        var residual: Values;
        var swept: Values;
        for (var column = 0u; column < COLUMNS; column++) {
            residual[column] = select(0.0, -drawn[column], is_free);
            swept[column] = OMEGA * inverse * residual[column];
        }
        store(level.residual, row, residual);
        store(level.swept, row, swept);
    }
}

// p = z + β p with β = -z·K p / p·K p, which keeps steps apart whatever the cycle is, and K p.
fn find_direction(iteration: u32) {
    let level = plan.levels[0];
    var betas: Values;
    for (var column = 0u; column < COLUMNS; column++) {
        let mixed = total(OF_MIXED, column);
        let last = record_at(iteration, column);
        let rz = scratch[last];
        let goes_on = iteration > 0u && rz > 0.0 && scratch[last + 1u] > 0.0 && is_active(iteration, column);
        // The drop of the last step is (r·z)² / p·K p.
        betas[column] = select(0.0, -mixed / max(rz, LEAST) * (scratch[last + 1u] / max(rz, LEAST)), goes_on);
    }
    let before = plan.steps[iteration % 2u];
    let now = plan.steps[(iteration + 1u) % 2u];
    var sums: Values;
    if (any_active(iteration)) {
        for (var row = first; row < level.rows; row += every) {
            let is_free = holders[row] == NO_HOLDER;
            let z = values_at(level.correction, row);
            let p = values_at(before, row);
            let leak = networks[level.leak + row];
            var own: Values;
            var image: Values;
            for (var column = 0u; column < COLUMNS; column++) {
                own[column] = z[column] + betas[column] * p[column];
                image[column] = leak * own[column];
            }
            let entries = entries_of(level, row);
            for (var entry = entries.x; entry < entries.y; entry += SLICE) {
                let weight = networks[level.weights + entry];
                let other = maps[level.columns + entry];
                let z_other = values_at(level.correction, other);
                let p_other = values_at(before, other);
                for (var column = 0u; column < COLUMNS; column++) {
                    image[column] += weight * (own[column] - (z_other[column] + betas[column] * p_other[column]));
                }
            }
            for (var column = 0u; column < COLUMNS; column++) {
                image[column] = select(0.0, image[column], is_free);
                sums[column] += own[column] * image[column];
            }
            store(now, row, own);
            store(plan.image, row, image);
        }
    }
    for (var column = 0u; column < COLUMNS; column++) {
        let sum = sum_of_team(sums[column]);
        if (thread == 0u) { scratch[OF_CURVATURE + team * COLUMNS + column] = sum; }
    }
}

// x += α p, r -= α K p, and the first sweep.
fn advance(iteration: u32) {
    let level = plan.levels[0];
    var alphas: Values;
    for (var column = 0u; column < COLUMNS; column++) { alphas[column] = take_step(iteration, column); }
    if (!any_active(iteration)) { return; }
    let now = plan.steps[(iteration + 1u) % 2u];
    for (var row = first; row < level.rows; row += every) {
        let inverse = networks[level.inverse + row];
        for (var column = 0u; column < COLUMNS; column++) {
            let at = row * COLUMNS + column;
            vectors[plan.potential + at] += alphas[column] * vectors[now + at];
            let residual = vectors[level.residual + at] - alphas[column] * vectors[plan.image + at];
            vectors[level.residual + at] = residual;
            vectors[level.swept + at] = OMEGA * inverse * residual;
        }
    }
}

// Energies of all pairs of columns, and the residuals and charges, as far as this workgroup has them. Of an edge each of its
// nodes has half.
fn evaluate() {
    let level = plan.levels[0];
    for (var s = 0u; s < COLUMNS; s++) {
        var sums: array<vec2<f32>, COLUMNS>;
        var free = 0.0;
        var held = 0.0;
        for (var row = first; row < level.rows; row += every) {
            var own = values_at(plan.potential, row);
            var feed = values_at(plan.feed, row);
            let leak = networks[plan.links + row];
            var drawn = leak * own[s] - feed[s];
            let entries = entries_of(level, row);
            for (var entry = entries.x; entry < entries.y; entry += SLICE) {
                let weight = networks[plan.weights + entry];
                var other = values_at(plan.potential, maps[level.columns + entry]);
                let current = weight * (own[s] - other[s]);
                drawn += current;
                for (var t = s; t < COLUMNS; t++) { sums[t] = add(sums[t], 0.5 * current * (own[t] - other[t])); }
            }
            for (var t = s; t < COLUMNS; t++) {
                sums[t] = add(sums[t], of_links(leak, vec2<f32>(own[s], own[t]), vec2<f32>(feed[s], feed[t])));
            }
            let holder = holders[row];
            free += select(0.0, drawn * drawn, holder == NO_HOLDER);
            held += select(0.0, drawn * drawn, holder == s);
        }
        let base = OF_ENERGIES + team * NUMBERS;
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
