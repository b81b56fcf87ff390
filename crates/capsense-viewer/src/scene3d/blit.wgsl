// Copies the picture of the scene, pixel by pixel, into the window.

@group(0) @binding(0) var picture: texture_2d<f32>;

struct BlitOut {
    @builtin(position) clip: vec4<f32>,
    @location(0) part: vec2<f32>,
}

// A triangle that covers the viewport.
@vertex
fn blit_vertex(@builtin(vertex_index) index: u32) -> BlitOut {
    let corner = vec2<f32>(f32(index & 1u), f32(index >> 1u)) * 2.0;
    var out: BlitOut;
    out.clip = vec4<f32>(corner * 2.0 - 1.0, 0.0, 1.0);
    out.part = vec2<f32>(corner.x, 1.0 - corner.y);
    return out;
}

fn pixel(part: vec2<f32>) -> vec4<f32> {
    let size = vec2<f32>(textureDimensions(picture));
    let place = clamp(part * size, vec2<f32>(0.0), size - 1.0);
    return textureLoad(picture, vec2<i32>(place), 0);
}

@fragment
fn blit_fragment(in: BlitOut) -> @location(0) vec4<f32> {
    return pixel(in.part);
}

// For windows that take linear colours and turn them into those of the screen.
@fragment
fn blit_fragment_linear(in: BlitOut) -> @location(0) vec4<f32> {
    let colour = pixel(in.part);
    let low = colour.rgb / 12.92;
    let high = pow((colour.rgb + 0.055) / 1.055, vec3<f32>(2.4));
    return vec4<f32>(select(high, low, colour.rgb < vec3<f32>(0.04045)), colour.a);
}
