// The potential around a right angle of a conductor: `Places::potentials` of core's `occupancy/near_field/field.rs`.

// By a third of the exponent, then by Halley's method: WGSL has no cube root, and promises little of powers.
fn cube_root(x: f32) -> f32 {
    var root = bitcast<f32>(bitcast<u32>(x) / 3u + 709958130u);
    for (var step = 0u; step < 2u; step++) {
        let cube = root * root * root;
        root *= (cube + 2.0 * x) / (2.0 * cube + x);
    }
    return root;
}

// r^(2/3) sin(2θ/3) at so much before either face, θ from one to the other; zero in the object.
fn potential_before(p: f32, q: f32) -> f32 {
    if (!(p > 0.0 || q > 0.0)) { return 0.0; }
    let squared = p * p + q * q + 1e-30;
    // From the bisector outside, angles are φ = θ - 3π/4; cos(φ/3) by Newton's method on 4c³ - 3c = cos φ.
    let cosine = 0.70710678 * (p + q) / sqrt(squared);
    var third = 0.8660 + cosine * (0.1871 - 0.0531 * cosine);
    for (var step = 0u; step < 2u; step++) {
        let square = third * third;
        third -= (third * (4.0 * square - 3.0) - cosine) / (12.0 * square - 3.0);
    }
    return cube_root(squared) * (2.0 * third * third - 1.0);
}
