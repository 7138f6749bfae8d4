// Pull-push fill, push: the part of a block that its weight leaves open is filled from the coarser level.
// BACKGROUND: of the coarser level's four values, those clearly nearer than the farthest are left out where the gap is too wide
// for their surface.  NOISE: a noise level is pushed along.  Reference implementation: model/reference/pull_push.py.
#include "common_pyramid.glsl"
#include "common_fill.glsl"

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform sampler2D value;
uniform sampler2D weight;
uniform sampler2D coarse;         // already filled
uniform int coarse_is_sum;        // 1: the coarsest level, still carrying its weight
uniform sampler2D whole_weight;
layout(rgba32f, binding = 0) uniform writeonly image2D out_value;
#ifdef NOISE
uniform sampler2D noise;
uniform sampler2D coarse_noise;
layout(r32f, binding = 1) uniform writeonly image2D out_noise;
#endif

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, imageSize(out_value)))) return;
    ivec2 extent = textureSize(coarse, 0), above = at >> 1, side = 2 * (at & 1) - 1;
    ivec2 beside = above + ivec2(side.x, 0), beyond = above + ivec2(0, side.y), across = above + side;
    vec4 a = fetch_clamped(coarse, above, extent), b = fetch_clamped(coarse, beside, extent);
    vec4 c = fetch_clamped(coarse, beyond, extent), d = fetch_clamped(coarse, across, extent);
    float unit = coarse_is_sum == 1 ? max(texelFetch(whole_weight, ivec2(0), 0).x, 1e-20) : 1.0;
#ifdef BACKGROUND
    precise vec4 shares = background(vec4(a.w, b.w, c.w, d.w)) * CORNERS;
    precise float total = (shares.x + shares.y) + (shares.z + shares.w);
    precise vec4 behind = ((shares.x * a + shares.y * b) + (shares.z * c + shares.w * d)) / total;
#else
    vec4 shares = CORNERS;
    const float total = 16.0;
    vec4 behind = corner_sum(a, b, c, d);
#endif
    float open = 1.0 - texelFetch(weight, at, 0).x;
    precise vec4 v = texelFetch(value, at, 0) + open * (behind / unit);
    imageStore(out_value, at, v);
#ifdef NOISE
    vec4 n = vec4(fetch_clamped(coarse_noise, above, extent).x, fetch_clamped(coarse_noise, beside, extent).x,
                  fetch_clamped(coarse_noise, beyond, extent).x, fetch_clamped(coarse_noise, across, extent).x);
    float level = texelFetch(noise, at, 0).x + open * (dot(shares, n) / (total * unit));
    imageStore(out_noise, at, vec4(level));
#endif
}
