// Sums over workgroups, what is noted of iterations, and what leaves the device: of lattices and of networks.

var<workgroup> shared_sums: array<f32, THREADS>;

// Sum over the workgroup, the same for all its threads.
fn sum_of_team(value: f32) -> f32 {
    shared_sums[thread] = value;
    workgroupBarrier();
    for (var half = THREADS / 2u; half > 0u; half /= 2u) {
        if (thread < half) { shared_sums[thread] += shared_sums[thread + half]; }
        workgroupBarrier();
    }
    let sum = shared_sums[0];
    workgroupBarrier();
    return sum;
}

// Scratch: partial sums of r·z and p·Kp by workgroup, then for each iteration and column what it found.

const OF_RZ: u32 = 0u;
const OF_CURVATURE: u32 = TEAMS * COLUMNS;
const OF_ENERGIES: u32 = 2u * TEAMS * COLUMNS;
const NUMBERS: u32 = 2u * COLUMNS * COLUMNS + 2u * COLUMNS;
const OF_RECORDS: u32 = OF_ENERGIES + TEAMS * NUMBERS;
const RESULTS: u32 = NUMBERS + COLUMNS + 1u;

fn total(partials: u32, column: u32) -> f32 {
    var sum = 0.0;
    for (var one = thread; one < TEAMS; one += THREADS) {
        sum += scratch[in_scratch + partials + one * COLUMNS + column];
    }
    return sum_of_team(sum);
}

// r·z, the drop, what may still come, and whether the column goes on: of the iterations before `iteration`.
fn record_at(iteration: u32, column: u32) -> u32 {
    return in_scratch + OF_RECORDS + (iteration * COLUMNS + column) * 4u;
}

fn is_active(iteration: u32, column: u32) -> bool {
    return scratch[record_at(iteration, column) + 3u] > 0.0;
}

fn any_active(iteration: u32) -> bool {
    var any = false;
    for (var column = 0u; column < COLUMNS; column++) { any = any || is_active(iteration, column); }
    return any;
}

// What a column's energy may still fall by: `iteration.rs`. Where r·z is not positive although there is a residual, or K is not
// along the step, nothing is known, and going on would be of no use.
fn to_come(drop: f32, before: f32, is_first: bool) -> f32 {
    if (is_first) { return LARGEST; }
    let ratio = select(MOST_RATIO, clamp(drop / max(before, LEAST), LEAST_RATIO, MOST_RATIO), before > 0.0);
    return CAUTION * drop * ratio / (1.0 - ratio);
}

// α, and what is noted of the step: its drop, what is still to come, and whether the column goes on.
fn take_step(iteration: u32, column: u32) -> f32 {
    let rz = total(OF_RZ, column);
    let curvature = total(OF_CURVATURE, column);
    let goes_on = is_active(iteration, column) && rz > 0.0 && curvature > 0.0;
    let alpha = select(0.0, rz / max(curvature, LEAST), goes_on);
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
    return alpha;
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
