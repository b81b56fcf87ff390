// Fields on the network of any mesh by conjugate gradients with multigrid by aggregation, all columns together. `twin.rs` does
// the same on the processor; `plan.rs` says where everything is. COLUMNS and other constants stand before this.
//
// Columns of a row lie side by side. Levels of many rows have a kernel for each step, in which all workgroups share the rows;
// one workgroup goes through all others. No sum depends on which thread is first, so a frame has the same bits in every run.

struct Level {
    rows: u32, slices: u32, columns: u32, aggregate: u32,
    member_ends: u32, members: u32, part_ends: u32, parts: u32,
    weights: u32, leak: u32, inverse: u32, residual: u32,
    swept: u32, correction: u32, left: u32, padding: u32,
}
struct Plan {
    levels: array<Level, MOST_LEVELS>,
    level_count: u32, first_of_tail: u32, weights: u32, links: u32,
    potential: u32, feed: u32, image: u32, allowed_at: u32,
    steps: vec2<u32>, padding: vec2<u32>,
}
// What a launch is about: a level, the iteration, and up to which iteration it goes.
struct Launch { level: u32, iteration: u32, end: u32, padding: u32 }
// What changed: where rows and feeds stand, a bit for each column to start from zero; and whether to solve, with how many
// iterations at most.
struct Scene { rows_at: u32, rows: u32, feeds_at: u32, feeds: u32, emptied: u32, is_solved: u32, most_iterations: u32, padding: u32 }

@group(0) @binding(0) var<uniform> launch: Launch;
@group(0) @binding(1) var<uniform> plan: Plan;
@group(0) @binding(2) var<storage, read> maps: array<u32>;
@group(0) @binding(3) var<storage, read_write> networks: array<f32>;
@group(0) @binding(4) var<storage, read_write> vectors: array<f32>;
@group(0) @binding(5) var<storage, read_write> holders: array<u32>;
@group(0) @binding(6) var<storage, read_write> scratch: array<f32>;
@group(0) @binding(7) var<storage, read> changes: array<u32>;
@group(0) @binding(8) var<storage, read_write> results: array<f32>;

const NO_HOLDER: u32 = 0xffffffffu;
const NO_AGGREGATE: u32 = 0xffffffffu;
const THREADS: u32 = 256u;
const SLICE: u32 = 32u;
// There is one scene, whose numbers begin where buffers do.
const scene: u32 = 0u;
const in_scratch: u32 = 0u;

// The share of this thread: every so many rows from the first on.
var<private> first: u32;
var<private> every: u32;
// The thread in its workgroup, and the workgroup.
var<private> thread: u32;
var<private> team: u32;

fn take_share(local: vec3<u32>, group: vec3<u32>, groups: vec3<u32>) {
    thread = local.x;
    team = group.x;
    first = group.x * THREADS + local.x;
    every = groups.x * THREADS;
}

fn wait() {
    storageBarrier();
    workgroupBarrier();
}

fn scene_header() -> Scene {
    return Scene(changes[0], changes[1], changes[2], changes[3], changes[4], changes[5], changes[6], 0u);
}

alias Values = array<f32, COLUMNS>;

fn values_at(vector: u32, row: u32) -> Values {
    var values: Values;
    let at = vector + row * COLUMNS;
    for (var column = 0u; column < COLUMNS; column++) { values[column] = vectors[at + column]; }
    return values;
}

fn store(vector: u32, row: u32, values: Values) {
    let at = vector + row * COLUMNS;
    for (var column = 0u; column < COLUMNS; column++) { vectors[at + column] = values[column]; }
}

// The first of a row's entries, and where its slice ends.
fn entries_of(level: Level, row: u32) -> vec2<u32> {
    let slice = level.slices + row / SLICE;
    return vec2<u32>(maps[slice] + row % SLICE, maps[slice + 1u]);
}
