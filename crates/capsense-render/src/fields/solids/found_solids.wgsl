// What the functions of solids ask for, where kernels find objects: `occupancy.wgsl`.

// Behind what `occupancy.wgsl` keeps of a node: its wedge.
const WEDGE: u32 = 4u;

fn solid_word(object: u32, number: u32) -> u32 { return object_word(object, OWN + number); }

fn tree_number(at: u32) -> f32 { return sources[at]; }

fn plane_of(axis: u32, index: u32) -> vec3<f32> {
    let at = plane_at(axis, index);
    return bitcast<vec3<f32>>(vec3<u32>(tables[at], tables[at + 1u], tables[at + 2u]));
}

fn dual_length_of(axis: u32, index: u32) -> f32 { return bitcast<f32>(tables[plane_at(axis, index) + 5u]); }

fn plane_counts() -> vec3<u32> { return plan.grids[0].counts; }

fn is_sensors(node: u32) -> bool { return owner_of(node) != FREE; }

fn is_homogeneous(node: u32) -> bool {
    return (tables[lattice.alike_at + node / 32u] & (1u << (node % 32u))) != 0u;
}

fn wedge_of(node: u32) -> Wedge {
    let at = FOUND * (in_holders + node) + WEDGE;
    return of_words(vec4<u32>(found[at], found[at + 1u], found[at + 2u], found[at + 3u]));
}

// What all nodes that objects are near make of edges of conductors.
fn find_wedges() {
    if (!take_objects()) { return; }
    let grid = plan.grids[0];
    for (var node = first; node < grid.nodes; node += every) {
        let place = place_of(grid, node);
        var wedge = NO_WEDGE;
        if (conductor_at(node) == NO_OBJECT && is_near_any(place)) { wedge = wedge_at(star_at(node, place)); }
        let at = FOUND * (in_holders + node) + WEDGE;
        let words = in_words(wedge);
        for (var word = 0u; word < 4u; word++) { found[at + word] = words[word]; }
    }
}

@compute @workgroup_size(256)
fn step_wedges(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    find_wedges();
}
