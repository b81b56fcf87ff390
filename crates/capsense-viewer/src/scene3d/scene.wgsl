// Draws faces, lines, slices and bodies into a picture of their own. Colours are as on the screen (not linear) and are
// multiplied by alpha on their way out.

struct Globals {
    clip_from_sensor: mat4x4<f32>,
    // Where the camera stands; w is 1, or 0 where lines of sight are parallel.
    eye: vec4<f32>,
    // Into the picture.
    forward: vec4<f32>,
    // Width and height in pixels, pixels in a point of the screen, and how far lines are pulled to the front.
    picture: vec4<f32>,
    // What the ends of the colour map stand for, the distance of level lines, and the slice's alpha.
    scale: vec4<f32>,
    wire: vec4<f32>,
    map: array<vec4<f32>, 16>,
}

struct Body {
    sensor_from_body: mat4x4<f32>,
    colour: vec4<f32>,
    // x: 1 when selected.
    state: vec4<f32>,
}

@group(0) @binding(0) var<uniform> globals: Globals;
@group(1) @binding(0) var<uniform> body: Body;

fn towards_eye(position: vec3<f32>) -> vec3<f32> {
    return normalize(mix(-globals.forward.xyz, globals.eye.xyz - position, globals.eye.w));
}

// From 0.55 where light grazes a surface to 1 where it falls upright; it comes over the viewer's left shoulder.
fn lit(normal: vec3<f32>, position: vec3<f32>) -> f32 {
    let eye = towards_eye(position);
    let right = normalize(cross(vec3<f32>(0.0, 0.0, 1.0), eye) + vec3<f32>(1e-5, 0.0, 0.0));
    let light = normalize(eye + 0.45 * vec3<f32>(0.0, 0.0, 1.0) - 0.35 * right);
    return 0.55 + 0.45 * abs(dot(normal, light));
}

fn multiplied(colour: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(colour.rgb * colour.a, colour.a);
}

// ---- flat faces, with the sides of their triangles

struct FaceOut {
    @builtin(position) clip: vec4<f32>,
    @location(0) position: vec3<f32>,
    @location(1) colour: vec4<f32>,
    @location(2) corner: vec3<f32>,
    @location(3) @interpolate(flat) normal: vec4<f32>,
}

@vertex
fn face_vertex(
    @builtin(vertex_index) index: u32,
    @location(0) position: vec3<f32>,
    @location(1) normal: vec4<f32>,
    @location(2) colour: vec4<f32>,
) -> FaceOut {
    var out: FaceOut;
    out.clip = globals.clip_from_sensor * vec4<f32>(position, 1.0);
    out.position = position;
    out.colour = colour;
    let corner = index % 3u;
    out.corner = vec3<f32>(f32(corner == 0u), f32(corner == 1u), f32(corner == 2u));
    out.normal = normal;
    return out;
}

@fragment
fn face_fragment(in: FaceOut) -> @location(0) vec4<f32> {
    let steps = fwidth(in.corner);
    let shade = lit(in.normal.xyz, in.position);
    var colour = multiplied(vec4<f32>(in.colour.rgb * shade, in.colour.a));
    if in.normal.w > 0.0 {
        // Pixels to the nearest side; where triangles are as small as pixels, sides fade.
        let apart = in.corner / max(steps, vec3<f32>(1e-9));
        let nearest = min(apart.x, min(apart.y, apart.z));
        let half_width = 0.5 * globals.picture.z;
        let small = clamp(1.6 - 3.0 * max(steps.x, max(steps.y, steps.z)), 0.25, 1.0);
        let side = small * (1.0 - smoothstep(half_width - 0.5, half_width + 0.5, nearest));
        let wire = multiplied(globals.wire) * side;
        colour = wire + colour * (1.0 - wire.a);
    }
    if colour.a < 0.004 {
        discard;
    }
    return colour;
}

// ---- lines as quads with soft sides

struct LineOut {
    @builtin(position) clip: vec4<f32>,
    @location(0) colour: vec4<f32>,
    // Pixels from the middle, and half the width.
    @location(1) @interpolate(linear) across: vec2<f32>,
}

@vertex
fn line_vertex(
    @builtin(vertex_index) index: u32,
    @location(0) start: vec3<f32>,
    @location(1) width: f32,
    @location(2) end: vec3<f32>,
    @location(3) colour: vec4<f32>,
) -> LineOut {
    var from_clip = globals.clip_from_sensor * vec4<f32>(start, 1.0);
    var to_clip = globals.clip_from_sensor * vec4<f32>(end, 1.0);
    // Cut off what lies behind the camera, or its ends would be on the wrong side.
    let near = 1e-4;
    if from_clip.w < near && to_clip.w > near {
        from_clip = mix(from_clip, to_clip, (near - from_clip.w) / (to_clip.w - from_clip.w));
    } else if to_clip.w < near && from_clip.w > near {
        to_clip = mix(to_clip, from_clip, (near - to_clip.w) / (from_clip.w - to_clip.w));
    }
    let half_picture = 0.5 * globals.picture.xy;
    let along = (to_clip.xy / to_clip.w - from_clip.xy / from_clip.w) * half_picture;
    let length = max(length(along), 1e-6);
    let sideways = vec2<f32>(-along.y, along.x) / length;
    // Below one pixel, lines get fainter rather than thinner.
    let pixels = width * globals.picture.z;
    let half_width = 0.5 * max(pixels, 1.0) + 0.75;
    let side = select(-1.0, 1.0, index % 2u == 1u);
    var clip = select(from_clip, to_clip, index >= 2u);
    let offset = sideways * side * half_width / half_picture;
    clip = vec4<f32>(clip.xy + offset * clip.w, clip.z - globals.picture.w * clip.w, clip.w);
    var out: LineOut;
    out.clip = clip;
    out.colour = vec4<f32>(colour.rgb, colour.a * min(pixels, 1.0));
    out.across = vec2<f32>(side * half_width, 0.5 * max(pixels, 1.0));
    return out;
}

@fragment
fn line_fragment(in: LineOut) -> @location(0) vec4<f32> {
    let cover = clamp(in.across.y + 0.5 - abs(in.across.x), 0.0, 1.0);
    return multiplied(vec4<f32>(in.colour.rgb, in.colour.a * cover));
}

// ---- a slice through the field

struct SliceOut {
    @builtin(position) clip: vec4<f32>,
    @location(0) value: f32,
}

@vertex
fn slice_vertex(@location(0) position: vec3<f32>, @location(1) value: f32) -> SliceOut {
    var out: SliceOut;
    out.clip = globals.clip_from_sensor * vec4<f32>(position, 1.0);
    out.value = value;
    return out;
}

@fragment
fn slice_fragment(in: SliceOut) -> @location(0) vec4<f32> {
    let part = clamp((in.value - globals.scale.x) / (globals.scale.y - globals.scale.x), 0.0, 1.0);
    let place = part * 15.0;
    let below = min(u32(place), 14u);
    var colour = mix(globals.map[below].rgb, globals.map[below + 1u].rgb, place - f32(below));
    // Level lines, a pixel wide; where they are too close to tell apart they fade.
    let level = in.value / globals.scale.z;
    let step = max(fwidth(level), 1e-6);
    let apart = abs(fract(level - 0.5) - 0.5) / step;
    let line = (1.0 - smoothstep(0.2, 1.0, apart)) * clamp(1.2 - 3.0 * step, 0.0, 1.0);
    // Where there is hardly a field, one sees what is behind.
    let alpha = globals.scale.w * mix(0.05, 0.96, smoothstep(0.0, 0.16, part));
    let ink = select(vec3<f32>(1.0), vec3<f32>(0.0), part > 0.55);
    let on_scale = f32(in.value < globals.scale.y && level > 0.5);
    colour = mix(colour, ink, 0.32 * line * on_scale);
    return multiplied(vec4<f32>(colour, alpha));
}

// ---- bodies, half transparent

struct BodyOut {
    @builtin(position) clip: vec4<f32>,
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
}

@vertex
fn body_vertex(@location(0) position: vec3<f32>, @location(1) normal: vec3<f32>) -> BodyOut {
    let place = body.sensor_from_body * vec4<f32>(position, 1.0);
    var out: BodyOut;
    out.clip = globals.clip_from_sensor * place;
    out.position = place.xyz;
    out.normal = (body.sensor_from_body * vec4<f32>(normal, 0.0)).xyz;
    return out;
}

@fragment
fn body_fragment(in: BodyOut) -> @location(0) vec4<f32> {
    let normal = normalize(in.normal);
    let upright = abs(dot(normal, towards_eye(in.position)));
    // Glass: what is seen at a grazing angle is thicker.
    let rim = pow(1.0 - upright, 2.5);
    let colour = body.colour.rgb * lit(normal, in.position) + 0.10 * body.state.x;
    return multiplied(vec4<f32>(min(colour, vec3<f32>(1.0)), min(body.colour.a + 0.45 * rim, 1.0)));
}
