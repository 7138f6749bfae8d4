// Pull-push fill, push: what a block's weight leaves open comes from the coarser level.  Twin: model/pull_push.py.
#include "common_pyramid.glsl"

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform sampler2D value;
uniform sampler2D weight;
uniform sampler2D coarse;         // already filled
uniform int coarse_is_sum;        // 1: the coarsest level, still carrying its weight
uniform sampler2D whole_weight;
layout(rgba32f, binding = 0) uniform writeonly image2D out_value;

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, imageSize(out_value)))) return;
    float w = texelFetch(weight, at, 0).x;
    vec4 behind = bilinear(coarse, at);
    if (coarse_is_sum == 1) behind = behind / max(texelFetch(whole_weight, ivec2(0), 0).x, 1e-20);
    precise vec4 v = texelFetch(value, at, 0) + (1.0 - w) * behind;
    imageStore(out_value, at, v);
}
