// Kernels: one for each step.

@compute @workgroup_size(256)
fn network_changes(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    take_changes();
}

@compute @workgroup_size(256)
fn network_empty(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    empty_columns();
}

@compute @workgroup_size(256)
fn network_coarsen(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    coarsen(launch.level);
}

@compute @workgroup_size(256)
fn network_coarsen_tail(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    coarsen_from(plan.first_of_tail);
}

@compute @workgroup_size(256)
fn network_residual(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    find_residual();
}

@compute @workgroup_size(256)
fn network_restrict(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    restrict_residual(launch.level, any_active(launch.iteration));
}

@compute @workgroup_size(256)
fn network_tail(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    cycle_from(plan.first_of_tail);
}

@compute @workgroup_size(256)
fn network_prolong(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    if (any_active(launch.iteration)) { prolong(launch.level); }
}

@compute @workgroup_size(256)
fn network_prolong_finest(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    prolong_finest(any_active(launch.iteration));
}

@compute @workgroup_size(256)
fn network_direction(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    find_direction(launch.iteration);
}

@compute @workgroup_size(256)
fn network_advance(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    advance(launch.iteration);
}

@compute @workgroup_size(256)
fn network_evaluate(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    evaluate();
}

@compute @workgroup_size(256)
fn network_collect(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    collect(launch.end);
}
