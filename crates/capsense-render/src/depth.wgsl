// Orthographic projection of one object; depth is written by fixed function.
// Rows of clip_from_object are computed in double precision on the CPU, one set per instance (object).

struct Vertex {
    @location(0) position: vec3<f32>,
    @location(1) row_x: vec4<f32>,
    @location(2) row_y: vec4<f32>,
    @location(3) row_z: vec4<f32>,
}

@vertex
fn project(vertex: Vertex) -> @invariant @builtin(position) vec4<f32> {
    let p = vec4<f32>(vertex.position, 1.0);
    return vec4<f32>(dot(vertex.row_x, p), dot(vertex.row_y, p), dot(vertex.row_z, p), 1.0);
}
