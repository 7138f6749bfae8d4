// Pull-push fill, pull: weighted sums of the four children, the weight at most 1.  Twin: model/pull_push.py.
// Colours carry their weight; the fourth channel is the depth feature (model/project.py, depth_feature).
#include "common_fill.glsl"

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
layout(rgba32f, binding = 0) uniform writeonly image2D coarse_value;
layout(r32f, binding = 1) uniform writeonly image2D coarse_weight;
#ifndef BASE
uniform sampler2D value;
uniform sampler2D weight;
#endif

void child(ivec2 at, ivec2 extent, out vec4 v, out float w) {
    v = vec4(0.0);
    w = 0.0;
    if (any(greaterThanEqual(at, extent))) return;
#ifdef BASE
    w = measured(at, v);
#else
    w = texelFetch(weight, at, 0).x;
    v = texelFetch(value, at, 0);
#endif
}

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, imageSize(coarse_value)))) return;
#ifdef BASE
    ivec2 extent = textureSize(mask, 0);
#else
    ivec2 extent = textureSize(value, 0);
#endif
    vec4 p, q, r, s;
    float a, b, c, d;
    child(2 * at, extent, p, a);
    child(2 * at + ivec2(1, 0), extent, q, b);
    child(2 * at + ivec2(0, 1), extent, r, c);
    child(2 * at + ivec2(1, 1), extent, s, d);
    precise float total = (a + b) + (c + d);
    precise vec4 sum = (p + q) + (r + s);
    precise float scale = total > 1.0 ? 1.0 / total : 1.0;
    precise vec4 scaled = sum * scale;
    imageStore(coarse_value, at, scaled);
    imageStore(coarse_weight, at, vec4(min(total, 1.0)));
}
