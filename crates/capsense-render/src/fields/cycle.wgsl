// The multigrid cycle: one level at a time.

// The six weights around a node: those before along x, y and z, and those after.
struct Around { before: vec3<f32>, after: vec3<f32>, inverse: f32 }

fn around(grid: Grid, node: u32) -> Around {
    let step = steps(grid);
    var all: Around;
    all.before = vec3<f32>(weight(grid, 0u, node - step.x), weight(grid, 1u, node - step.y), weight(grid, 2u, node - step.z));
    all.after = vec3<f32>(weight(grid, 0u, node), weight(grid, 1u, node), weight(grid, 2u, node));
    let sum = all.before + all.after;
    let diagonal = sum.x + sum.y + sum.z + weight(grid, 3u, node);
    all.inverse = select(0.0, 1.0 / diagonal, diagonal > 0.0 && diagonal < 0.5 * FIXED);
    return all;
}

fn gather(all: Around, step: vec3<u32>, at: u32) -> f32 {
    let before = vec3<f32>(vectors[at - step.x], vectors[at - step.y], vectors[at - step.z]);
    let after = vec3<f32>(vectors[at + step.x], vectors[at + step.y], vectors[at + step.z]);
    return dot(all.before, before) + dot(all.after, after);
}

// Nodes of one colour come two by two along x, the last of a row perhaps alone.
fn pairs(grid: Grid) -> u32 {
    return (grid.counts.x + 1u) / 2u * grid.counts.y * grid.counts.z;
}

fn place_of_pair(grid: Grid, colour: u32, pair: u32) -> vec3<u32> {
    let half = (grid.counts.x + 1u) / 2u;
    let row = pair / half;
    let y = row % grid.counts.y;
    let z = row / grid.counts.y;
    return vec3<u32>(2u * (pair - row * half) + ((y + z + colour) & 1u), y, z);
}

fn relax(number: u32, colour: u32) {
    let level = plan.levels[number];
    let grid = plan.grids[level.grid];
    let count = pairs(grid);
    for (var pair = first; pair < count; pair += every) {
        let place = place_of_pair(grid, colour, pair);
        if (place.x >= grid.counts.x) { continue; }
        let node = node_at(grid, place);
        let all = around(grid, node);
        for (var column = 0u; column < COLUMNS; column++) {
            let at = in_vectors + column * level.stride + node;
            let sum = gather(all, steps(grid), at + level.correction);
            vectors[at + level.correction] = (vectors[at + level.residual] + sum) * all.inverse;
        }
    }
}

fn leave_red(number: u32) {
    let level = plan.levels[number];
    let grid = plan.grids[level.grid];
    let count = pairs(grid);
    for (var pair = first; pair < count; pair += every) {
        let place = place_of_pair(grid, RED, pair);
        if (place.x >= grid.counts.x) { continue; }
        let node = node_at(grid, place);
        let all = around(grid, node);
        for (var column = 0u; column < COLUMNS; column++) {
            let at = in_vectors + column * level.stride + level.correction + node;
            let sum = gather(all, steps(grid), at);
            vectors[at] = select(0.0, sum, all.inverse > 0.0);
        }
    }
}

// Between levels

// Of three planes at a coarse one, before, at and after it, the parts that it takes. Those not given up have none.
fn parts(number: u32, axis: u32, grid: Grid, place: vec3<u32>) -> vec3<f32> {
    var result = vec3<f32>(0.0, 1.0, 0.0);
    let node = node_at(grid, place);
    let step = steps(grid)[axis];
    if (place[axis] > 0u && is_given_up(number, axis, grid.counts[axis], place[axis] - 1u)) {
        result.x = shares(grid, axis, node - step).y;
    }
    if (is_given_up(number, axis, grid.counts[axis], place[axis] + 1u)) {
        result.z = shares(grid, axis, node + step).x;
    }
    return result;
}

fn restrict_residual(number: u32) {
    let transfer = plan.transfers[number];
    let fine = plan.levels[number];
    let coarse = plan.levels[number + 1u];
    let grid = plan.grids[coarse.grid];
    let grid_x = plan.grids[transfer.grids.x];
    let grid_y = plan.grids[transfer.grids.y];
    let grid_z = plan.grids[transfer.grids.z];
    for (var to = first; to < grid.nodes; to += every) {
        let place = place_of(grid, to);
        var sums: array<f32, COLUMNS>;
        var at_z = place;
        at_z.z = maps[transfer.fine.z + place.z];
        let parts_z = parts(number, 2u, grid_z, at_z);
        for (var z = 0u; z < 3u; z++) {
            if (parts_z[z] == 0.0) { continue; }
            var at_y = vec3<u32>(place.x, maps[transfer.fine.y + place.y], at_z.z + z - 1u);
            let parts_y = parts(number, 1u, grid_y, at_y);
            for (var y = 0u; y < 3u; y++) {
                if (parts_y[y] == 0.0) { continue; }
                let at_x = vec3<u32>(maps[transfer.fine.x + place.x], at_y.y + y - 1u, at_y.z);
                let parts_x = parts(number, 0u, grid_x, at_x);
                for (var x = 0u; x < 3u; x++) {
                    let source = vec3<u32>(at_x.x + x - 1u, at_x.y, at_x.z);
                    if (parts_x[x] == 0.0 || (source.x + source.y + source.z) % 2u != RED) { continue; }
                    let part = parts_z[z] * parts_y[y] * parts_x[x];
                    let at = in_vectors + fine.correction + node_at(grid_x, source);
                    for (var column = 0u; column < COLUMNS; column++) {
                        sums[column] += part * vectors[at + column * fine.stride];
                    }
                }
            }
        }
        let is_red = (place.x + place.y + place.z) % 2u == RED;
        let inverse = around(grid, to).inverse;
        for (var column = 0u; column < COLUMNS; column++) {
            let at = in_vectors + column * coarse.stride + to;
            let residual = OVERCORRECTION * sums[column];
            vectors[at + coarse.residual] = residual;
            if (is_red) { vectors[at + coarse.correction] = inverse * residual; }
        }
    }
}

// The coarse plane at or before a fine one, and the parts of it and of the next.
struct Between { plane: u32, parts: vec2<f32> }

fn between(number: u32, axis: u32, grid: Grid, place: vec3<u32>) -> Between {
    let told = maps[plan.transfers[number].coarse[axis] + place[axis]];
    if (told % 2u == 0u) { return Between(told / 2u, vec2<f32>(1.0, 0.0)); }
    return Between(told / 2u, shares(grid, axis, node_at(grid, place)));
}

fn prolong(number: u32) {
    let transfer = plan.transfers[number];
    let fine = plan.levels[number];
    let coarse = plan.levels[number + 1u];
    let grid = plan.grids[transfer.grids.x];
    let grid_y = plan.grids[transfer.grids.y];
    let grid_z = plan.grids[transfer.grids.z];
    let coarse_grid = plan.grids[transfer.grids.w];
    let count = pairs(grid);
    for (var pair = first; pair < count; pair += every) {
        let place = place_of_pair(grid, RED, pair);
        if (place.x >= grid.counts.x) { continue; }
        let node = node_at(grid, place);
        let inverse = around(grid, node).inverse;
        var sums: array<f32, COLUMNS>;
        if (inverse > 0.0) {
            let of_x = between(number, 0u, grid, place);
            for (var x = 0u; x < 2u; x++) {
                if (of_x.parts[x] == 0.0) { continue; }
                let at_y = vec3<u32>(of_x.plane + x, place.y, place.z);
                let of_y = between(number, 1u, grid_y, at_y);
                for (var y = 0u; y < 2u; y++) {
                    if (of_y.parts[y] == 0.0) { continue; }
                    let at_z = vec3<u32>(at_y.x, of_y.plane + y, place.z);
                    let of_z = between(number, 2u, grid_z, at_z);
                    for (var z = 0u; z < 2u; z++) {
                        if (of_z.parts[z] == 0.0) { continue; }
                        let part = of_x.parts[x] * of_y.parts[y] * of_z.parts[z];
                        let source = vec3<u32>(at_z.x, at_z.y, of_z.plane + z);
                        let at = in_vectors + coarse.correction + node_at(coarse_grid, source);
                        for (var column = 0u; column < COLUMNS; column++) {
                            sums[column] += part * vectors[at + column * coarse.stride];
                        }
                    }
                }
            }
        }
        for (var column = 0u; column < COLUMNS; column++) {
            let at = in_vectors + column * fine.stride + node;
            vectors[at + fine.correction] = inverse * vectors[at + fine.residual] + sums[column];
        }
    }
}

// All levels from one on, down and up again, in one workgroup.
fn cycle_from(level: u32) {
    let last = plan.level_count - 1u;
    for (var number = level; number < last; number++) {
        relax(number, BLACK);
        wait();
        leave_red(number);
        wait();
        restrict_residual(number);
        wait();
    }
    for (var sweep = 0u; sweep < SWEEPS; sweep++) {
        relax(last, BLACK);
        wait();
        relax(last, RED);
        wait();
    }
    for (var number = last; number > level; number--) {
        prolong(number - 1u);
        wait();
        relax(number - 1u, BLACK);
        wait();
        relax(number - 1u, RED);
        wait();
    }
}

fn coarsen_from(level: u32) {
    for (var number = level; number + 1u < plan.level_count; number++) {
        for (var axis = 0u; axis < 3u; axis++) {
            coarsen(number, axis);
            wait();
        }
    }
}
