// Depth filter, level 0: the keep-mask and the filtered picture.  Four pixels an invocation, which share their neighbours and the
// block above them: software OpenGL pays for each fetch.  Reference implementation: model/depth_filter.py, _auto.
#include "common_filter.glsl"

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform sampler2D level;   // view-space z, +inf where empty
uniform sampler2D coarse;  // thresholds of level 1
uniform sampler2D raw;
layout(r8, binding = 0) uniform writeonly image2D mask;
layout(rgba8, binding = 1) uniform writeonly image2D filtered;
uniform vec3 tolerance;    // as in hiding_threshold; the third is unused

vec2 pixel(ivec2 at, ivec2 extent) {
    if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, extent))) return vec2(0.0);
    float z = texelFetch(level, at, 0).x;
    return isinf(z) ? vec2(0.0) : vec2(1.0 / z, 1.0);
}

void write(ivec2 at, ivec2 extent, vec2 own, float threshold) {
    if (any(greaterThanEqual(at, extent))) return;
    vec4 colour = texelFetch(raw, at, 0);
    bool keep = own.x > 0.0 && own.x >= threshold && colour.a > 0.0;  // points without colour occlude and are not shown
    imageStore(mask, at, vec4(keep ? 1.0 : 0.0));
    imageStore(filtered, at, keep ? colour : vec4(0.0));
}

void main() {
    ivec2 at = 2 * ivec2(gl_GlobalInvocationID.xy), extent = textureSize(level, 0);
    if (any(greaterThanEqual(at, extent))) return;
    vec2 a[4], b[4], c[4], d[4];  // four rows
    for (int x = 0; x < 4; ++x) {
        a[x] = pixel(at + ivec2(x - 1, -1), extent);
        b[x] = pixel(at + ivec2(x - 1, 0), extent);
        c[x] = pixel(at + ivec2(x - 1, 1), extent);
        d[x] = pixel(at + ivec2(x - 1, 2), extent);
    }
    vec2 t = tolerance.xy;
    float above = texelFetch(coarse, at >> 1, 0).x;
    float p = hiding_threshold(b[1], b[2], c[2], c[1], c[0], b[0], a[0], a[1], a[2], t);
    float q = hiding_threshold(b[2], b[3], c[3], c[2], c[1], b[1], a[1], a[2], a[3], t);
    float r = hiding_threshold(c[1], c[2], d[2], d[1], d[0], c[0], b[0], b[1], b[2], t);
    float s = hiding_threshold(c[2], c[3], d[3], d[2], d[1], c[1], b[1], b[2], b[3], t);
    write(at, extent, b[1], max(p, above));
    write(at + ivec2(1, 0), extent, b[2], max(q, above));
    write(at + ivec2(0, 1), extent, c[1], max(r, above));
    write(at + ivec2(1, 1), extent, c[2], max(s, above));
}
