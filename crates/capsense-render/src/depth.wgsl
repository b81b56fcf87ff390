// Orthographic projection of one object, and the depth of a triangle at a pixel's centre.
// Rows of clip_from_object are computed in double precision on the CPU, one set per instance (object).
//
// An image must not depend on where its tile is in the atlas. Rasterisers round corners to parts of a pixel and interpolate depth in
// the coordinates of the atlas, which moves what is seen of faces along the rays from tile to tile by more than rounding. So corners
// are rounded here, in coordinates from the tile's middle, in which depth is found as well, from the corners as they are.

struct Object {
    @location(0) row_x: vec4<f32>,
    @location(1) row_y: vec4<f32>,
    @location(2) row_z: vec4<f32>,
    // Parts of a pixel in a unit of clip space, across and down.
    @location(3) parts: vec2<f32>,
    // The tile's middle in the atlas, in pixels.
    @location(4) middle: vec2<f32>,
}

// Three coordinates of each vertex, and three vertices of each triangle.
@group(0) @binding(0) var<storage, read> coordinates: array<f32>;
@group(0) @binding(1) var<storage, read> corners: array<u32>;

struct Drawn {
    @invariant @builtin(position) place: vec4<f32>,
    @location(0) @interpolate(flat) middle: vec2<f32>,
    // The triangle's first corner: from the tile's middle, in pixels, and its depth; by how much depth grows with each pixel; and the
    // depths that the triangle has.
    @location(1) @interpolate(flat) corner: vec3<f32>,
    @location(2) @interpolate(flat) slope: vec2<f32>,
    @location(3) @interpolate(flat) depths: vec2<f32>,
}

// To what corners are rounded: as finely as rasterisers do at least.
const PARTS: f32 = 256.0;

// Where a corner is in clip space.
fn projected(object: Object, corner: u32) -> vec3<f32> {
    let at = 3u * corners[corner];
    let p = vec4<f32>(coordinates[at], coordinates[at + 1u], coordinates[at + 2u], 1.0);
    return vec3<f32>(dot(object.row_x, p), dot(object.row_y, p), dot(object.row_z, p));
}

// The same in pixels across and down from the tile's middle, and depths.
fn in_pixels(object: Object, corner: u32) -> vec3<f32> {
    let place = projected(object, corner);
    return vec3<f32>(place.xy * object.parts / vec2<f32>(PARTS, -PARTS), place.z);
}

@vertex
fn project(@builtin(vertex_index) index: u32, object: Object) -> Drawn {
    let first = index - index % 3u;
    let own = projected(object, index);
    let a = in_pixels(object, first);
    let b = in_pixels(object, first + 1u) - a;
    let c = in_pixels(object, first + 2u) - a;
    var drawn: Drawn;
    drawn.place = vec4<f32>(round(own.xy * object.parts) / object.parts, own.z, 1.0);
    drawn.middle = object.middle;
    drawn.corner = a;
    // One of no area is not drawn.
    let area = b.x * c.y - c.x * b.y;
    drawn.slope = vec2<f32>(b.z * c.y - c.z * b.y, c.z * b.x - b.z * c.x) / select(area, 1.0, area == 0.0);
    drawn.depths = a.z + vec2<f32>(min(0.0, min(b.z, c.z)), max(0.0, max(b.z, c.z)));
    return drawn;
}

@fragment
fn depth(drawn: Drawn) -> @builtin(frag_depth) f32 {
    let way = drawn.place.xy - drawn.middle - drawn.corner.xy;
    return clamp(drawn.corner.z + dot(drawn.slope, way), drawn.depths.x, drawn.depths.y);
}
