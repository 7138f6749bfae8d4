// Depth filter, coming up: the inverse depth below which a pixel of each block is hidden by the blocks around it, or by
// those around a coarser block.  At level 0 (BASE) the comparison itself: the keep-mask and the filtered picture.
// Twin: model/depth_filter.py, _hiding_threshold and _auto.
#include "common_pyramid.glsl"

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform sampler2D level;   // BASE: view-space z; else near (x) and support (y)
uniform sampler2D coarse;  // thresholds of the next coarser level
#ifdef BASE
uniform sampler2D raw;
layout(r8, binding = 0) uniform writeonly image2D mask;
layout(rgba8, binding = 1) uniform writeonly image2D filtered;
#else
layout(r32f, binding = 0) uniform writeonly image2D threshold;
#endif
uniform vec3 tolerance;    // 1 - tolerance x strength, slope share x strength, unused

vec2 block(ivec2 at, ivec2 extent) {
    if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, extent))) return vec2(0.0);
#ifdef BASE
    float z = texelFetch(level, at, 0).x;
    return isinf(z) ? vec2(0.0) : vec2(1.0 / z, 1.0);
#else
    return texelFetch(level, at, 0).xy;
#endif
}

float narrower(float best, float a, float b) {
    return a > 0.0 && b > 0.0 ? min(best, abs(a - b) * 0.5) : best;
}

float hiding_threshold(ivec2 at, ivec2 extent, vec2 own) {
    vec2 e = block(at + ivec2(1, 0), extent), se = block(at + ivec2(1, 1), extent);
    vec2 s = block(at + ivec2(0, 1), extent), sw = block(at + ivec2(-1, 1), extent);
    vec2 w = block(at + ivec2(-1, 0), extent), nw = block(at + ivec2(-1, -1), extent);
    vec2 n = block(at + ivec2(0, -1), extent), ne = block(at + ivec2(1, -1), extent);
    // In every direction something: of each two consecutive neighbours the nearer one, of those the farthest.
    float front = min(min(min(max(e.x, se.x), max(se.x, s.x)), min(max(s.x, sw.x), max(sw.x, w.x))),
                      min(min(max(w.x, nw.x), max(nw.x, n.x)), min(max(n.x, ne.x), max(ne.x, e.x))));
    if (front <= 0.0) return 0.0;
    float across = narrower(narrower(narrower(EMPTY, e.x, w.x), ne.x, nw.x), se.x, sw.x);
    float along = narrower(narrower(narrower(EMPTY, s.x, n.x), sw.x, nw.x), se.x, ne.x);
    precise float limit = front * SAME_SURFACE_FACTOR;
    bool shared_surface = own.x >= limit;
    float count = shared_surface ? own.y : 0.0;
    count += e.x >= limit ? e.y : 0.0;
    count += se.x >= limit ? se.y : 0.0;
    count += s.x >= limit ? s.y : 0.0;
    count += sw.x >= limit ? sw.y : 0.0;
    count += w.x >= limit ? w.y : 0.0;
    count += nw.x >= limit ? nw.y : 0.0;
    count += n.x >= limit ? n.y : 0.0;
    count += ne.x >= limit ? ne.y : 0.0;
    precise float slope = (across + along) * tolerance.y;
    precise float value = front * tolerance.x - slope;
    bool sparse = count < SUPPORT_LIMIT || (shared_surface && count < SUPPORT_LIMIT_SHARED);
    return sparse ? max(value, 0.0) : 0.0;
}

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy), extent = textureSize(level, 0);
    if (any(greaterThanEqual(at, extent))) return;
    vec2 own = block(at, extent);
#ifdef BASE
    bool keep = own.x > 0.0;  // an empty pixel needs no neighbours looked at
    if (keep) keep = own.x >= texelFetch(coarse, at >> 1, 0).x && own.x >= hiding_threshold(at, extent, own);
    vec4 colour = texelFetch(raw, at, 0);
    keep = keep && colour.a > 0.0;  // what has no colour hides, and shows nothing
    imageStore(mask, at, vec4(keep ? 1.0 : 0.0));
    imageStore(filtered, at, keep ? colour : vec4(0.0));
#else
    float value = hiding_threshold(at, extent, own);
#ifndef TOP
    value = max(value, texelFetch(coarse, at >> 1, 0).x);
#endif
    imageStore(threshold, at, vec4(value));
#endif
}
