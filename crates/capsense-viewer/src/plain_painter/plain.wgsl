// Draws egui's triangles: colours as on the screen (not linear), multiplied by alpha.

struct Locals {
    // Width and height of the window in points.
    size: vec2<f32>,
    unused: vec2<f32>,
}

@group(0) @binding(0) var<uniform> locals: Locals;
@group(1) @binding(0) var picture: texture_2d<f32>;
@group(1) @binding(1) var picture_sampler: sampler;

struct Out {
    @builtin(position) clip: vec4<f32>,
    @location(0) part: vec2<f32>,
    @location(1) colour: vec4<f32>,
}

@vertex
fn plain_vertex(
    @location(0) position: vec2<f32>,
    @location(1) part: vec2<f32>,
    @location(2) colour: vec4<f32>,
) -> Out {
    let place = 2.0 * position / locals.size - 1.0;
    var out: Out;
    out.clip = vec4<f32>(place.x, -place.y, 0.0, 1.0);
    out.part = part;
    out.colour = colour;
    return out;
}

@fragment
fn mixed_fragment(in: Out) -> @location(0) vec4<f32> {
    return in.colour * textureSample(picture, picture_sampler, in.part);
}

// For what has no texture and hides what is behind it.
@fragment
fn opaque_fragment(in: Out) -> @location(0) vec4<f32> {
    return vec4<f32>(in.colour.rgb, 1.0);
}
