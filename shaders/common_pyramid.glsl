// Levels of the fill's pyramid, their borders repeated.

vec4 fetch_clamped(sampler2D image, ivec2 at, ivec2 extent) {
    return texelFetch(image, clamp(at, ivec2(0), extent - 1), 0);
}

// A coarser level at a finer pixel's centre, from the four values around it, the nearest first: weights 9, 3, 3, 1 of 16, summed
// as model/pyramid.py does.
vec4 corner_sum(vec4 a, vec4 b, vec4 c, vec4 d) {
    precise vec4 sum = ((9.0 * a + 3.0 * b) + (3.0 * c + d)) * 0.0625;
    return sum;
}

vec4 bilinear(sampler2D coarse, ivec2 fine) {
    ivec2 extent = textureSize(coarse, 0), at = fine >> 1, side = 2 * (fine & 1) - 1;
    vec4 a = fetch_clamped(coarse, at, extent), b = fetch_clamped(coarse, at + ivec2(side.x, 0), extent);
    vec4 c = fetch_clamped(coarse, at + ivec2(0, side.y), extent), d = fetch_clamped(coarse, at + side, extent);
    return corner_sum(a, b, c, d);
}
