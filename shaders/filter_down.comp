// Depth filter, towards coarser levels: nearest inverse depth of each block, how many level-0 pixels lie on its surface and how
// many of its children hold them (common_filter.glsl).  Reference implementation: model/reference/depth_filter.py, _near_pyramid.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
layout(rg32f, binding = 0) uniform writeonly image2D coarse;
#ifdef FROM_KEYS
layout(std430, binding = KEYS_BINDING) readonly buffer Keys { uint keys[]; };  // written by raster_depth.comp
uniform ivec2 size;
#else
uniform sampler2D fine;  // BASE: view-space z, +inf where empty; else as written here
#endif

vec2 child(ivec2 at, ivec2 extent) {
    if (any(greaterThanEqual(at, extent))) return vec2(0.0);
#ifdef FROM_KEYS
    uint key = keys[at.y * extent.x + at.x];
    return key == 0u ? vec2(0.0) : vec2(1.0 / uintBitsToFloat(~key), CHILDREN);
#elif defined(BASE)
    float z = texelFetch(fine, at, 0).x;
    return isinf(z) ? vec2(0.0) : vec2(1.0 / z, CHILDREN);
#else
    return texelFetch(fine, at, 0).xy;
#endif
}

// A child's part of the sum: its pixels, and itself.
float part(vec2 child, float limit) {
    return child.x >= limit && child.y > 0.0 ? floor(child.y * (1.0 / CHILDREN)) * CHILDREN + 1.0 : 0.0;
}

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, imageSize(coarse)))) return;
#ifdef FROM_KEYS
    ivec2 extent = size;
#else
    ivec2 extent = textureSize(fine, 0);
#endif
    vec2 a = child(2 * at, extent), b = child(2 * at + ivec2(1, 0), extent);
    vec2 c = child(2 * at + ivec2(0, 1), extent), d = child(2 * at + ivec2(1, 1), extent);
    float top = max(max(a.x, b.x), max(c.x, d.x)), bottom = min(min(a.x, b.x), min(c.x, d.x));
    precise float twist = (a.x - b.x) - (c.x - d.x);
    precise float twist_limit = TWIST * top;
    precise float slope = min(abs(a.x - b.x), abs(c.x - d.x)) + min(abs(a.x - c.x), abs(b.x - d.x));
    bool planar = bottom > 0.0 && abs(twist) <= twist_limit && slope <= STEEPEST * top;
    precise float same = top * SAME_SURFACE_FACTOR;
    precise float limit = same - (planar ? slope : 0.0);
    float support = part(a, limit) + part(b, limit) + part(c, limit) + part(d, limit);
    imageStore(coarse, at, vec4(top, support, 0.0, 0.0));
}
