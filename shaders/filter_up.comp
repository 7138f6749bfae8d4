// Depth filter, towards finer levels: the inverse depth below which a pixel of each block is hidden by the blocks around it, or by
// those around a coarser block.  Reference implementation: model/reference/depth_filter.py, _auto.
#include "common_filter.glsl"

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform sampler2D level;   // as filter_down.comp writes it
#ifndef TOP
uniform sampler2D coarse;  // thresholds of the next coarser level
#endif
layout(r32f, binding = 0) uniform writeonly image2D threshold;
uniform vec3 tolerance;    // as in hiding_threshold
uniform int mirror;        // 1: the picture is mirrored at its border; 0: it is empty beyond it

vec2 block(ivec2 at, ivec2 extent) {
    if (mirror == 1) {
        ivec2 last = extent - 1;
        return texelFetch(level, clamp(last - abs(last - abs(at)), ivec2(0), last), 0).xy;
    }
    if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, extent))) return vec2(0.0);
    return texelFetch(level, at, 0).xy;
}

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy), extent = textureSize(level, 0);
    if (any(greaterThanEqual(at, extent))) return;
    float value = hiding_threshold(
        block(at, extent), block(at + ivec2(1, 0), extent), block(at + ivec2(1, 1), extent), block(at + ivec2(0, 1), extent),
        block(at + ivec2(-1, 1), extent), block(at + ivec2(-1, 0), extent), block(at + ivec2(-1, -1), extent),
        block(at + ivec2(0, -1), extent), block(at + ivec2(1, -1), extent), tolerance);
#ifndef TOP
    value = max(value, texelFetch(coarse, at >> 1, 0).x);
#endif
    imageStore(threshold, at, vec4(value));
}
