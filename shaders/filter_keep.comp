// Depth filter, level 0: the keep-mask and the filtered picture.  Four pixels an invocation, which share their neighbours and the
// block above them: software OpenGL pays for each fetch.  Nine pixels are always few, and never clumped: points are not counted.
// Reference implementation: model/reference/depth_filter.py, _auto.
#include "common_filter.glsl"

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform sampler2D level;   // view-space z, +inf where empty
uniform sampler2D coarse;  // thresholds of level 1
uniform sampler2D raw;
layout(r8, binding = 0) uniform writeonly image2D mask;
layout(rgba8, binding = 1) uniform writeonly image2D filtered;
uniform vec3 tolerance;    // as in behind; the third is unused

float pixel(ivec2 at, ivec2 extent) {
    if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, extent))) return 0.0;
    float z = texelFetch(level, at, 0).x;
    return isinf(z) ? 0.0 : 1.0 / z;
}

float threshold_of(float e, float se, float s, float sw, float w, float nw, float n, float ne) {
    return behind(front_around(e, se, s, sw, w, nw, n, ne), slope_around(e, se, s, sw, w, nw, n, ne), tolerance.xy);
}

void write(ivec2 at, ivec2 extent, float own, float threshold) {
    if (any(greaterThanEqual(at, extent))) return;
    vec4 colour = texelFetch(raw, at, 0);
    bool keep = own > 0.0 && own >= threshold && colour.a > 0.0;  // points without colour occlude and are not shown
    imageStore(mask, at, vec4(keep ? 1.0 : 0.0));
    imageStore(filtered, at, keep ? colour : vec4(0.0));
}

void main() {
    ivec2 at = 2 * ivec2(gl_GlobalInvocationID.xy), extent = textureSize(level, 0);
    if (any(greaterThanEqual(at, extent))) return;
    float a[4], b[4], c[4], d[4];  // four rows
    for (int x = 0; x < 4; ++x) {
        a[x] = pixel(at + ivec2(x - 1, -1), extent);
        b[x] = pixel(at + ivec2(x - 1, 0), extent);
        c[x] = pixel(at + ivec2(x - 1, 1), extent);
        d[x] = pixel(at + ivec2(x - 1, 2), extent);
    }
    float above = texelFetch(coarse, at >> 1, 0).x;
    float p = threshold_of(b[2], c[2], c[1], c[0], b[0], a[0], a[1], a[2]);
    float q = threshold_of(b[3], c[3], c[2], c[1], b[1], a[1], a[2], a[3]);
    float r = threshold_of(c[2], d[2], d[1], d[0], c[0], b[0], b[1], b[2]);
    float s = threshold_of(c[3], d[3], d[2], d[1], c[1], b[1], b[2], b[3]);
    write(at, extent, b[1], max(p, above));
    write(at + ivec2(1, 0), extent, b[2], max(q, above));
    write(at + ivec2(0, 1), extent, c[1], max(r, above));
    write(at + ivec2(1, 1), extent, c[2], max(s, above));
}
