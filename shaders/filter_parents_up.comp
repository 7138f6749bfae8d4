// The paper's depth filter, towards finer levels: each pixel is compared with its parent, and rejected ones are refilled
// (PUBLISHED: as in the published code, else as in the paper's text).  At level 0 (BASE) it writes the keep-mask.
// NPBG: one comparison with the nearest depth of the pixel's block.  Reference implementation: model/reference/depth_filter.py, _parents.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform sampler2D level;   // z; BASE: +inf where empty, else EMPTY
uniform sampler2D coarse;  // z of the coarser level, refilled; NPBG: of the only level
uniform vec3 tolerance;    // parent ratio, edge threshold, NPBG depth
uniform int shift_by;      // NPBG: levels between
#ifdef BASE
uniform sampler2D raw;
layout(r8, binding = 0) uniform writeonly image2D mask;
layout(rgba8, binding = 1) uniform writeonly image2D filtered;
#else
layout(r32f, binding = 0) uniform writeonly image2D refilled;
#endif

float parent(ivec2 at, ivec2 extent) {
    return texelFetch(coarse, clamp(at, ivec2(0), extent - 1), 0).x;
}

float reference(ivec2 at, ivec2 extent) {
    float own = parent(at, extent), farthest = own;
    precise float laplacian;
#ifdef PUBLISHED
    laplacian = ((parent(at + ivec2(-1, 0), extent) + parent(at + ivec2(1, 0), extent))
        + (parent(at + ivec2(0, -1), extent) + parent(at + ivec2(0, 1), extent))) - 4.0 * own;
    for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx) farthest = max(farthest, parent(at + ivec2(dx, dy), extent));
    return laplacian > tolerance.y ? farthest : own;
#else
    const ivec2 ring[8] = ivec2[](ivec2(1, 0), ivec2(1, 1), ivec2(0, 1), ivec2(-1, 1), ivec2(-1, 0), ivec2(-1, -1), ivec2(0, -1), ivec2(1, -1));
    laplacian = 0.0;
    for (int k = 0; k < 8; ++k) {
        float z = parent(at + ring[k], extent);
        if (z >= EMPTY) continue;
        if (ring[k].x == 0 || ring[k].y == 0) laplacian += z - own;
        farthest = max(farthest, z);
    }
    precise float limit = tolerance.y * own;
    return own < EMPTY && abs(laplacian) > limit ? farthest : own;
#endif
}

#ifndef BASE
float refill(ivec2 at, ivec2 extent) {
    ivec2 up = at >> 1, side = 2 * (at & 1) - 1;
    float a = parent(up, extent), b = parent(up + ivec2(side.x, 0), extent);
    float c = parent(up + ivec2(0, side.y), extent), d = parent(up + side, extent);
#ifdef PUBLISHED
    precise float value = ((9.0 * a + 3.0 * b) + (3.0 * c + d)) * 0.0625;
    return value;
#else
    vec4 known = vec4(lessThan(vec4(a, b, c, d), vec4(EMPTY)));
    precise float weight = ((9.0 * known.x + 3.0 * known.y) + (3.0 * known.z + known.w)) * 0.0625;
    precise float value = ((9.0 * (known.x > 0.0 ? a : 0.0) + 3.0 * (known.y > 0.0 ? b : 0.0))
        + (3.0 * (known.z > 0.0 ? c : 0.0) + (known.w > 0.0 ? d : 0.0))) * 0.0625;
    return weight > 0.0 ? value / weight : EMPTY;
#endif
}
#endif

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy), extent = textureSize(level, 0), above = textureSize(coarse, 0);
    if (any(greaterThanEqual(at, extent))) return;
    float z = texelFetch(level, at, 0).x;
    bool keep = z < EMPTY && !isinf(z);
#ifdef NPBG
    precise float behind = z - texelFetch(coarse, at >> shift_by, 0).x;
    keep = keep && behind <= tolerance.z;
#else
    precise float limit = tolerance.x * reference(at >> 1, above);
    keep = keep && z <= limit;
#endif
#ifdef BASE
    vec4 colour = texelFetch(raw, at, 0);
    keep = keep && colour.a > 0.0;  // points without colour occlude and are not shown
    imageStore(mask, at, vec4(keep ? 1.0 : 0.0));
    imageStore(filtered, at, keep ? colour : vec4(0.0));
#else
    imageStore(refilled, at, vec4(keep ? z : refill(at, above)));
#endif
}
