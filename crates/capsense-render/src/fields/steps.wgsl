// Kernels: one for each step of a large scene.

@compute @workgroup_size(256)
fn step_empty(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    empty_columns();
}

@compute @workgroup_size(256)
fn step_changes(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    take_changes();
}

@compute @workgroup_size(256)
fn step_coarsen(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    coarsen(launch.level, launch.axis);
}

@compute @workgroup_size(256)
fn step_residual(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    find_residual();
}

@compute @workgroup_size(256)
fn step_relax(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    if (any_active(launch.iteration)) { relax(launch.level, launch.axis); }
}

@compute @workgroup_size(256)
fn step_leave(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    if (any_active(launch.iteration)) { leave_red(launch.level); }
}

@compute @workgroup_size(256)
fn step_restrict(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    if (any_active(launch.iteration)) { restrict_residual(launch.level); }
}

@compute @workgroup_size(256)
fn step_prolong(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    if (any_active(launch.iteration)) { prolong(launch.level); }
}

@compute @workgroup_size(256)
fn step_rz(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    sum_rz();
}

@compute @workgroup_size(256)
fn step_direction(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    find_direction(launch.iteration);
}

@compute @workgroup_size(256)
fn step_advance(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    advance(launch.iteration);
}

@compute @workgroup_size(256)
fn step_evaluate(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    evaluate();
}

// In one workgroup for each scene from here on.

@compute @workgroup_size(256)
fn step_collect(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    collect(launch.end);
}

@compute @workgroup_size(256)
fn step_coarsen_tail(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    coarsen_from(plan.first_of_tail);
}

@compute @workgroup_size(256)
fn step_tail(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    cycle_from(plan.first_of_tail);
}

@compute @workgroup_size(256)
fn whole_scene(@builtin(local_invocation_id) local: vec3<u32>, @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    take_share(local, group, groups);
    if (launch.iteration == 0u) {
        take_changes();
        wait();
        empty_columns();
        wait();
        coarsen_from(0u);
        find_residual();
        wait();
    }
    for (var iteration = launch.iteration; iteration < launch.end; iteration++) {
        if (thread == 0u) { shared_flag = select(0u, 1u, any_active(iteration)); }
        if (workgroupUniformLoad(&shared_flag) == 1u) {
            cycle_from(0u);
            sum_rz();
            wait();
            find_direction(iteration);
            wait();
        }
        advance(iteration);
        wait();
    }
    evaluate();
    wait();
    collect(launch.end);
}
