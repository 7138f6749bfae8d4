// Points as discs of several pixels: each pixel takes the nearest point whose disc covers it.
// Reference implementation: viewer.picture.look.enlarged.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform sampler2D picture;
uniform sampler2D depth;     // view-space z, +inf where there is no point
#ifdef MASKED
uniform sampler2D mask;      // pixels that count
#endif
uniform isampler2D offsets;  // from a point to the pixels of its disc, the point itself first
layout(rgba8, binding = 0) uniform writeonly image2D result;
layout(r32f, binding = 1) uniform writeonly image2D nearest;

float depth_at(ivec2 at) {
#ifdef MASKED
    if (texelFetch(mask, at, 0).x <= 0.5) return uintBitsToFloat(0x7F800000u);
#endif
    return texelFetch(depth, at, 0).x;
}

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy), size = imageSize(result), from = at;
    if (any(greaterThanEqual(at, size))) return;
    float front = depth_at(at);
    int count = textureSize(offsets, 0).x;
    for (int i = 1; i < count; ++i) {
        ivec2 there = at - texelFetch(offsets, ivec2(i, 0), 0).xy;
        if (any(lessThan(there, ivec2(0))) || any(greaterThanEqual(there, size))) continue;
        float z = depth_at(there);
        if (z < front) {
            front = z;
            from = there;
        }
    }
    imageStore(result, at, texelFetch(picture, from, 0));
    imageStore(nearest, at, vec4(front));
}
