// Fields on a lattice by conjugate gradients with geometric multigrid, all columns together. `twin.rs` does the same on the
// processor and says what each step is; `plan.rs` says where everything is. COLUMNS and other constants stand before this.
//
// Every step is a function over a share of the nodes. Large scenes have a kernel for each step, in which all workgroups
// share the nodes; small ones, and coarse levels, go through all steps in one workgroup, with barriers in between. Nothing
// depends on how many scenes there are: each has its own numbers everywhere.

struct Grid { counts: vec3<u32>, nodes: u32, at: u32, stride: u32, padding: vec2<u32> }
struct Level { grid: u32, residual: u32, correction: u32, stride: u32 }
struct Transfer { grids: vec4<u32>, coarse: vec3<u32>, padding: u32, fine: vec3<u32>, padding_too: u32 }
struct Plan {
    grids: array<Grid, MOST_GRIDS>,
    levels: array<Level, MOST_LEVELS>,
    transfers: array<Transfer, MOST_LEVELS>,
    level_count: u32, potential: u32, image: u32, feed: u32,
    steps: vec2<u32>, leak: u32, first_of_tail: u32,
    network_len: u32, vectors_len: u32, scratch_len: u32, allowed_at: u32,
}
// What a launch is about: a level, an axis or a colour, the iteration, and up to which iteration it goes.
struct Launch { level: u32, axis: u32, iteration: u32, end: u32 }
// What changed in a scene: where rows and feeds stand, a bit for each column to start from zero; and whether to solve, with how
// many iterations at most.
// The rest is about objects that are found here: how many, where they stand, whether they are to be found anew, a bit for each
// column that they have, and whether they were ever found.
struct Scene {
    rows_at: u32, rows: u32, feeds_at: u32, feeds: u32, emptied: u32, is_solved: u32, most_iterations: u32,
    objects: u32, objects_at: u32, is_placed: u32, columns: u32, is_found: u32,
}

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
const THREADS: u32 = 256u;
const RED: u32 = 0u;
const BLACK: u32 = 1u;

// Which scene, and where its values begin.
var<private> scene: u32;
var<private> in_networks: u32;
var<private> in_vectors: u32;
var<private> in_holders: u32;
var<private> in_scratch: u32;
// The share of this thread: every so many nodes from the first on.
var<private> first: u32;
var<private> every: u32;
// The thread in its workgroup, and the workgroup.
var<private> thread: u32;
var<private> team: u32;

var<workgroup> shared_flag: u32;

fn take_share(local: vec3<u32>, group: vec3<u32>, groups: vec3<u32>) {
    thread = local.x;
    team = group.x;
    first = group.x * THREADS + local.x;
    every = groups.x * THREADS;
    scene = group.y;
    in_networks = scene * plan.network_len;
    in_vectors = scene * plan.vectors_len;
    in_holders = scene * plan.grids[0].nodes;
    in_scratch = scene * plan.scratch_len;
}

fn wait() {
    storageBarrier();
    workgroupBarrier();
}
