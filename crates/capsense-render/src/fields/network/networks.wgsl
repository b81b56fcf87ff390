// The networks of all levels.

// The inverse of the diagonal; where weights are negative, of as much more as keeps sweeps from overshooting.
fn inverse_of(sum: f32, size: f32) -> f32 {
    let diagonal = max(sum, 0.5 * (sum + size));
    return select(0.0, 1.0 / max(diagonal, LEAST), diagonal > LEAST);
}

fn take_changes() {
    let header = scene_header();
    let level = plan.levels[0];
    for (var number = first; number < header.rows; number += every) {
        let record = header.rows_at + 6u * number;
        let row = changes[record];
        let holder = changes[record + 1u];
        let leak = bitcast<f32>(changes[record + 2u]);
        let at = changes[record + 4u];
        let count = changes[record + 5u];
        let is_free = holder == NO_HOLDER;
        let first_entry = entries_of(level, row).x;
        var sum = leak;
        var size = abs(leak);
        for (var entry = 0u; entry < count; entry++) {
            let weight = bitcast<f32>(changes[at + entry]);
            let is_held = ((changes[at + count + entry / 32u] >> (entry % 32u)) & 1u) == 1u;
            let place = first_entry + SLICE * entry;
            networks[plan.weights + place] = weight;
            networks[level.weights + place] = select(0.0, weight, is_free && !is_held);
            sum += weight;
            size += abs(weight);
        }
        networks[plan.links + row] = leak;
        networks[level.leak + row] = select(0.0, leak + bitcast<f32>(changes[record + 3u]), is_free);
        networks[level.inverse + row] = select(0.0, inverse_of(sum, size), is_free);
        holders[row] = holder;
        for (var column = 0u; column < COLUMNS && !is_free; column++) {
            vectors[plan.potential + row * COLUMNS + column] = select(0.0, 1.0, holder == column);
        }
    }
    for (var feed = first; feed < header.feeds; feed += every) {
        let at = header.feeds_at + 3u * feed;
        vectors[plan.feed + changes[at] * COLUMNS + changes[at + 1u]] = bitcast<f32>(changes[at + 2u]);
    }
}

fn empty_columns() {
    let emptied = scene_header().emptied;
    for (var row = first; row < plan.levels[0].rows; row += every) {
        for (var column = 0u; column < COLUMNS; column++) {
            if ((emptied & (1u << column)) == 0u) { continue; }
            let at = row * COLUMNS + column;
            vectors[plan.potential + at] = select(0.0, 1.0, holders[row] == column);
            vectors[plan.image + at] = 0.0;
            vectors[plan.steps.x + at] = 0.0;
            vectors[plan.steps.y + at] = 0.0;
        }
    }
}

// The network of the level above `number`: what aggregates have in common with others, and with what is held.
fn coarsen(number: u32) {
    let fine = plan.levels[number];
    let coarse = plan.levels[number + 1u];
    for (var row = first; row < coarse.rows; row += every) {
        var leak = 0.0;
        for (var at = maps[coarse.member_ends + row]; at < maps[coarse.member_ends + row + 1u]; at++) {
            leak += networks[fine.leak + maps[coarse.members + at]];
        }
        var sum = leak;
        var size = abs(leak);
        let entries = entries_of(coarse, row);
        for (var entry = entries.x; entry < entries.y; entry += SLICE) {
            var weight = 0.0;
            for (var at = maps[coarse.part_ends + entry]; at < maps[coarse.part_ends + entry + 1u]; at++) {
                weight += networks[fine.weights + maps[coarse.parts + at]];
            }
            networks[coarse.weights + entry] = weight;
            sum += weight;
            size += abs(weight);
        }
        networks[coarse.leak + row] = leak;
        networks[coarse.inverse + row] = inverse_of(sum, size);
    }
}
