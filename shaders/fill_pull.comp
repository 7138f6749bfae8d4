// Pull-push fill, pull: weighted sums of the four children; the weight is at most 1.  Values are stored times their weight; the
// fourth channel is the depth feature (model/reference/projection.py, depth_feature).  BASE: the children are pixels.
// BACKGROUND: children clearly nearer than the farthest are left out where the gap is too wide for their surface.
// NOISE: a noise level is pulled along.  Reference implementation: model/reference/pull_push.py.
#include "common_fill.glsl"

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
layout(rgba32f, binding = 0) uniform writeonly image2D coarse_value;
layout(r32f, binding = 1) uniform writeonly image2D coarse_weight;
#ifdef NOISE
layout(r32f, binding = 2) uniform writeonly image2D coarse_noise;
#endif
#ifndef BASE
uniform sampler2D value;
uniform sampler2D weight;
#ifdef NOISE
uniform sampler2D noise;
#endif
#endif

void child(ivec2 at, ivec2 extent, out vec4 v, out float w, out float n) {
    v = vec4(0.0);
    w = n = 0.0;
    if (any(greaterThanEqual(at, extent))) return;
#ifdef BASE
    w = measured(at, v);
#ifdef NOISE
    if (w > 0.0) n = w * texelFetch(noise, at, 0).x;
#endif
#else
    w = texelFetch(weight, at, 0).x;
    v = texelFetch(value, at, 0);
#ifdef NOISE
    n = texelFetch(noise, at, 0).x;
#endif
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
    vec4 p, q, r, s, w, n;
    child(2 * at, extent, p, w.x, n.x);
    child(2 * at + ivec2(1, 0), extent, q, w.y, n.y);
    child(2 * at + ivec2(0, 1), extent, r, w.z, n.z);
    child(2 * at + ivec2(1, 1), extent, s, w.w, n.w);
#ifdef BACKGROUND
    vec4 features = mix(vec4(EMPTY_FEATURE), vec4(p.w, q.w, r.w, s.w) / max(w, vec4(1e-20)), greaterThan(w, vec4(0.0)));
    vec4 kept = background(features);
    precise vec4 kept_weight = kept * w, kept_noise = kept * n;
    precise vec4 kept_p = kept.x * p, kept_q = kept.y * q, kept_r = kept.z * r, kept_s = kept.w * s;
    w = kept_weight;
    n = kept_noise;
    p = kept_p;
    q = kept_q;
    r = kept_r;
    s = kept_s;
#endif
    precise float total = (w.x + w.y) + (w.z + w.w);
    precise vec4 sum = (p + q) + (r + s);
    precise float scale = total > 1.0 ? 1.0 / total : 1.0;
    precise vec4 scaled = sum * scale;
    imageStore(coarse_value, at, scaled);
    imageStore(coarse_weight, at, vec4(min(total, 1.0)));
#ifdef NOISE
    imageStore(coarse_noise, at, vec4(((n.x + n.y) + (n.z + n.w)) * scale));
#endif
}
