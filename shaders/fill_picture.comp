// Pull-push fill, level 0: the filled picture.  Its alpha is the opacity that hole_coverage.comp found, and 1 in directions that
// the scan encloses (viewer/render/culling/enclosed_directions.py; ALIKE: the state of all directions in view, where it is one).
// NETWORK: also the network's input, eight half-precision channels a pixel (channels last): filled RGB, keep-mask or confidence,
// filled depth feature, filled noise level (NOISE; else 0), 1 where the network must keep what is filled (SEALED, or far inside
// a hole), 1 - alpha.
// DEPTH: also the view-space z of the filled picture, 0 where it is not opaque.
// Four pixels an invocation, which share the level above: software OpenGL pays for each fetch.
// Reference implementation: model/reference/pull_push.py.
#include "common_pyramid.glsl"
#include "common_fill.glsl"

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform sampler2D coarse;         // already filled
uniform int coarse_is_sum;        // 1: the coarsest level, still carrying its weight
uniform sampler2D whole_weight;
uniform usampler2D holes;         // written by hole_coverage.comp
#ifndef ALIKE
uniform isampler2D closed;        // state of each direction, 0 for background: six cube faces one above the other
uniform mat3 to_world;            // columns: the view frame's x, y, z in world axes
uniform vec4 lens;                // fx, fy, cx, cy in pixels
#endif
layout(rgba8, binding = 0) uniform writeonly image2D filled;
#ifdef DEPTH
layout(r32f, binding = 1) uniform writeonly image2D filled_depth;
#endif
#ifdef NETWORK
layout(std430, binding = NETWORK_BINDING) writeonly buffer Input { uvec4 pixels[]; };
#endif
#ifdef NOISE
uniform sampler2D coarse_noise;   // already filled
#endif

#ifndef ALIKE
// The cube face and cell of a direction, as viewer/render/culling/enclosed_directions.py numbers them.
ivec2 cell_of(vec3 d) {
    vec3 a = abs(d);
    int axis = a.x >= a.y && a.x >= a.z ? 0 : (a.y >= a.z ? 1 : 2);
    float along = d[axis], u = d[(axis + 1) % 3] / abs(along), v = d[(axis + 2) % 3] / abs(along);
    int face = 2 * axis + (along < 0.0 ? 1 : 0), side = textureSize(closed, 0).x;
    ivec2 cell = clamp(ivec2((vec2(u, v) * 0.5 + 0.5) * float(side)), ivec2(0), ivec2(side - 1));
    return ivec2(cell.x, face * side + cell.y);
}

int closed_towards(ivec2 at) {
    vec3 ray = to_world * vec3((vec2(at) + 0.5 - lens.zw) / lens.xy, 1.0);
    return texelFetch(closed, cell_of(ray), 0).x;
}
#endif

// at: a pixel.  behind, behind_noise: the level above, interpolated to its centre.  whole: the weight of the whole picture.
// hole: the pixel's byte in ``holes``.
void write(ivec2 at, ivec2 extent, vec4 behind, float behind_noise, float whole, uint hole) {
    if (any(greaterThanEqual(at, extent))) return;
    vec4 v;
    float w = measured(at, v);
    if (w < 1.0) {
        precise vec4 mixed = v + (1.0 - w) * behind;
        v = mixed;
    }
#ifdef ALIKE
    const int direction = ALIKE;
#else
    int direction = closed_towards(at);
#endif
    // Where nothing is measured in the whole picture, the coarsest level has weight zero and the picture stays empty.
    float cover = direction != 0 || w > 0.0 ? 1.0 : float(hole >> 1 & 0x7Fu) / 127.0;
    float alpha = whole == 0.0 ? 0.0 : cover;
    imageStore(filled, at, vec4(v.xyz * alpha, alpha));
#ifdef DEPTH
    imageStore(filled_depth, at, vec4(alpha == 1.0 ? exp2(v.w / FEATURE_SCALE) / feature_scale : 0.0));
#endif
#ifdef NETWORK
    bool sealed = direction == SEALED || (direction == 0 && (hole & 1u) != 0u);
    float level = 0.0;
#ifdef NOISE
    if (w > 0.0) level = w * texelFetch(noise, at, 0).x;
    if (w < 1.0) level += (1.0 - w) * behind_noise;
#endif
    pixels[uint(at.y) * uint(extent.x) + uint(at.x)] =
        uvec4(packHalf2x16(v.xy), packHalf2x16(vec2(v.z, w)), packHalf2x16(vec2(v.w, level)),
              packHalf2x16(vec2(sealed ? 1.0 : 0.0, 1.0 - alpha)));
#endif
}

void main() {
    ivec2 above = ivec2(gl_GlobalInvocationID.xy), at = 2 * above, extent = textureSize(mask, 0);
    if (any(greaterThanEqual(at, extent))) return;
    ivec2 bounds = textureSize(coarse, 0);
    float whole = texelFetch(whole_weight, ivec2(0), 0).x;
    float unit = coarse_is_sum == 1 ? max(whole, 1e-20) : 1.0;
    vec4 own = fetch_clamped(coarse, above, bounds);
    vec4 e = fetch_clamped(coarse, above + ivec2(1, 0), bounds), w = fetch_clamped(coarse, above - ivec2(1, 0), bounds);
    vec4 s = fetch_clamped(coarse, above + ivec2(0, 1), bounds), n = fetch_clamped(coarse, above - ivec2(0, 1), bounds);
    vec4 se = fetch_clamped(coarse, above + ivec2(1, 1), bounds), nw = fetch_clamped(coarse, above - ivec2(1, 1), bounds);
    vec4 ne = fetch_clamped(coarse, above + ivec2(1, -1), bounds), sw = fetch_clamped(coarse, above - ivec2(1, -1), bounds);
#if !defined(ALIKE) || ALIKE == 0
    uint hole = texelFetch(holes, above >> 1, 0)[(above.x & 1) + 2 * (above.y & 1)];
#else
    const uint hole = 0u;  // every direction is closed
#endif
#ifdef NOISE
    // The same nine values of the noise level: row by row, so that a quadrant's are two neighbouring pairs.
    vec3 up, level, down;
    for (int x = 0; x < 3; ++x) {
        up[x] = fetch_clamped(coarse_noise, above + ivec2(x - 1, -1), bounds).x;
        level[x] = fetch_clamped(coarse_noise, above + ivec2(x - 1, 0), bounds).x;
        down[x] = fetch_clamped(coarse_noise, above + ivec2(x - 1, 1), bounds).x;
    }
    vec3 upper = (3.0 * level + up) * (0.0625 / unit), lower = (3.0 * level + down) * (0.0625 / unit);
    vec4 noises = vec4(3.0 * upper.y + upper.x, 3.0 * upper.y + upper.z, 3.0 * lower.y + lower.x, 3.0 * lower.y + lower.z);
#else
    const vec4 noises = vec4(0.0);
#endif
    write(at, extent, corner_sum(own, w, n, nw) / unit, noises.x, whole, hole);
    write(at + ivec2(1, 0), extent, corner_sum(own, e, n, ne) / unit, noises.y, whole, hole >> 8);
    write(at + ivec2(0, 1), extent, corner_sum(own, w, s, sw) / unit, noises.z, whole, hole >> 16);
    write(at + ivec2(1, 1), extent, corner_sum(own, e, s, se) / unit, noises.w, whole, hole >> 24);
}
