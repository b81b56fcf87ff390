// A cycle over the levels: one sweep on the way down, one on the way up, both damped and of all rows at once.

// K v at a row of a level, v zero where potentials are held.
fn draw(level: Level, vector: u32, row: u32) -> Values {
    let own = values_at(vector, row);
    let leak = networks[level.leak + row];
    var sums: Values;
    for (var column = 0u; column < COLUMNS; column++) { sums[column] = leak * own[column]; }
    let entries = entries_of(level, row);
    for (var entry = entries.x; entry < entries.y; entry += SLICE) {
        let weight = networks[level.weights + entry];
        let other = values_at(vector, maps[level.columns + entry]);
        for (var column = 0u; column < COLUMNS; column++) { sums[column] += weight * (own[column] - other[column]); }
    }
    return sums;
}

// The right-hand side of a coarse row, and the first sweep there.
fn start_row(level: Level, row: u32, residual: Values) {
    let inverse = networks[level.inverse + row];
    var swept: Values;
    for (var column = 0u; column < COLUMNS; column++) { swept[column] = OMEGA * inverse * residual[column]; }
    store(level.residual, row, residual);
    store(level.swept, row, swept);
}

// What the first sweep leaves, summed up over each aggregate by eight threads.
fn restrict_residual(number: u32, is_wanted: bool) {
    let fine = plan.levels[number];
    let coarse = plan.levels[number + 1u];
    let row = team * AGGREGATES + thread / LANES;
    let lane = thread % LANES;
    var sums: Values;
    if (is_wanted && row < coarse.rows) {
        let end = maps[coarse.member_ends + row + 1u];
        for (var at = maps[coarse.member_ends + row] + lane; at < end; at += LANES) {
            let member = maps[coarse.members + at];
            let residual = values_at(fine.residual, member);
            let drawn = draw(fine, fine.swept, member);
            for (var column = 0u; column < COLUMNS; column++) { sums[column] += residual[column] - drawn[column]; }
        }
    }
    for (var column = 0u; column < COLUMNS; column++) {
        shared_sums[thread] = sums[column];
        workgroupBarrier();
        if (lane == 0u) {
            for (var other = 1u; other < LANES; other++) { sums[column] += shared_sums[thread + other]; }
        }
        workgroupBarrier();
    }
    if (is_wanted && lane == 0u && row < coarse.rows) { start_row(coarse, row, sums); }
}

// The same in two steps, for one workgroup.
fn leave(number: u32) {
    let level = plan.levels[number];
    for (var row = first; row < level.rows; row += every) {
        var left = values_at(level.residual, row);
        let drawn = draw(level, level.swept, row);
        for (var column = 0u; column < COLUMNS; column++) { left[column] -= drawn[column]; }
        store(level.left, row, left);
    }
}

fn gather(number: u32) {
    let fine = plan.levels[number];
    let coarse = plan.levels[number + 1u];
    for (var row = first; row < coarse.rows; row += every) {
        var sums: Values;
        for (var at = maps[coarse.member_ends + row]; at < maps[coarse.member_ends + row + 1u]; at++) {
            let left = values_at(fine.left, maps[coarse.members + at]);
            for (var column = 0u; column < COLUMNS; column++) { sums[column] += left[column]; }
        }
        start_row(coarse, row, sums);
    }
}

// One more sweep.
fn relax(level: Level, origin: u32, to: u32) {
    for (var row = first; row < level.rows; row += every) {
        let inverse = networks[level.inverse + row];
        let residual = values_at(level.residual, row);
        let drawn = draw(level, origin, row);
        var own = values_at(origin, row);
        for (var column = 0u; column < COLUMNS; column++) {
            own[column] += OMEGA * inverse * (residual[column] - drawn[column]);
        }
        store(to, row, own);
    }
}

// What the first sweep found, with the correction of the row's aggregate.
fn lifted(level: Level, coarse: Level, row: u32) -> Values {
    var values = values_at(level.swept, row);
    let aggregate = maps[level.aggregate + row];
    if (aggregate != NO_AGGREGATE) {
        let correction = values_at(coarse.correction, aggregate);
        for (var column = 0u; column < COLUMNS; column++) { values[column] += OVERCORRECTION * correction[column]; }
    }
    return values;
}

// The second sweep at one row.
fn corrected(number: u32, row: u32) -> Values {
    let level = plan.levels[number];
    let coarse = plan.levels[number + 1u];
    let inverse = networks[level.inverse + row];
    var own: Values;
    if (inverse == 0.0) { return own; }
    own = lifted(level, coarse, row);
    let leak = networks[level.leak + row];
    var left = values_at(level.residual, row);
    for (var column = 0u; column < COLUMNS; column++) { left[column] -= leak * own[column]; }
    let entries = entries_of(level, row);
    for (var entry = entries.x; entry < entries.y; entry += SLICE) {
        let weight = networks[level.weights + entry];
        let other = lifted(level, coarse, maps[level.columns + entry]);
        for (var column = 0u; column < COLUMNS; column++) { left[column] -= weight * (own[column] - other[column]); }
    }
    for (var column = 0u; column < COLUMNS; column++) { own[column] += OMEGA * inverse * left[column]; }
    return own;
}

fn prolong(number: u32) {
    let level = plan.levels[number];
    for (var row = first; row < level.rows; row += every) { store(level.correction, row, corrected(number, row)); }
}

// On the finest level, with r·z and z·K p as far as this workgroup has them, p the last step.
fn prolong_finest(is_wanted: bool) {
    let level = plan.levels[0];
    var along: Values;
    var mixed: Values;
    for (var row = first; row < level.rows && is_wanted; row += every) {
        let z = corrected(0u, row);
        let residual = values_at(level.residual, row);
        let image = values_at(plan.image, row);
        for (var column = 0u; column < COLUMNS; column++) {
            along[column] += residual[column] * z[column];
            mixed[column] += image[column] * z[column];
        }
        store(level.correction, row, z);
    }
    for (var column = 0u; column < COLUMNS; column++) {
        let of_along = sum_of_team(along[column]);
        let of_mixed = sum_of_team(mixed[column]);
        if (thread == 0u) {
            scratch[OF_RZ + team * COLUMNS + column] = of_along;
            scratch[OF_MIXED + team * COLUMNS + column] = of_mixed;
        }
    }
}

// The cycle from one level on, in one workgroup. Its right-hand side and first sweep are there already.
fn cycle_from(number: u32) {
    for (var level = number; level + 1u < plan.level_count; level++) {
        leave(level);
        wait();
        gather(level);
        wait();
    }
    let coarsest = plan.levels[plan.level_count - 1u];
    for (var sweep = 1u; sweep < SWEEPS; sweep++) {
        let is_odd = sweep % 2u == 1u;
        let to = select(select(coarsest.swept, coarsest.left, is_odd), coarsest.correction, sweep + 1u == SWEEPS);
        relax(coarsest, select(coarsest.left, coarsest.swept, is_odd), to);
        wait();
    }
    for (var above = plan.level_count - 1u; above > number; above--) {
        prolong(above - 1u);
        wait();
    }
}

// The networks above one level, in one workgroup.
fn coarsen_from(number: u32) {
    for (var level = number; level + 1u < plan.level_count; level++) {
        coarsen(level);
        wait();
    }
}
