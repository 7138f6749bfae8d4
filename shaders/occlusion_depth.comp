// The depth drawn so far, as resolve.comp will write it.
layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
layout(std430, binding = KEYS_BINDING) readonly buffer Keys { uint keys[]; };
layout(r32f, binding = 0) uniform writeonly image2D depth;

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy), extent = imageSize(depth);
    if (any(greaterThanEqual(at, extent))) return;
    uint key = keys[at.y * extent.x + at.x];
    imageStore(depth, at, vec4(uintBitsToFloat(key == 0u ? 0x7F800000u : ~key)));
}
