// Levels of the fill's pyramid, with their borders repeated.

vec4 fetch_clamped(sampler2D image, ivec2 at, ivec2 extent) {
    return texelFetch(image, clamp(at, ivec2(0), extent - 1), 0);
}

const vec4 CORNERS = vec4(9.0, 3.0, 3.0, 1.0);

// A coarser level interpolated to a finer pixel's centre, from the four values around it, the nearest first: weights 9, 3, 3
// and 1 of 16, summed in the order of model/reference/pyramid.py.
vec4 corner_sum(vec4 a, vec4 b, vec4 c, vec4 d) {
    precise vec4 sum = ((9.0 * a + 3.0 * b) + (3.0 * c + d)) * 0.0625;
    return sum;
}
