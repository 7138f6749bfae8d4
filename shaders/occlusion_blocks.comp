// Occlusion pyramid, level 0: the minimum over each block of the inverse depth below which a point not drawn yet shows nowhere:
// neither in its pixel, behind what is drawn there, nor through a gap, where the depth filter would remove it.
#include "common_project.glsl"

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
layout(std430, binding = PYRAMID_BINDING) writeonly buffer Pyramid { float pyramid[]; };  // as in common_occlusion.glsl
layout(std430, binding = KEYS_BINDING) readonly buffer Keys { uint keys[]; };  // written by raster_depth.comp
uniform sampler2D gaps;  // the filter's thresholds for blocks of 2x2 pixels
uniform uvec2 blocks;    // columns, rows

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(uvec2(at), blocks))) return;
    ivec2 last = ivec2(size.xy) - 1, first = at << BLOCK_SHIFT;
    float lowest = 1e38;
    for (int y = 0; y < 1 << BLOCK_SHIFT; y += 2)
        for (int x = 0; x < 1 << BLOCK_SHIFT; x += 2) {
            ivec2 low = min(first + ivec2(x, y), last), high = min(low + 1, last);  // the picture's edge is repeated
            ivec2 row = ivec2(low.y, high.y) * int(size.x);
            uint farthest = min(min(keys[row.x + low.x], keys[row.x + high.x]), min(keys[row.y + low.x], keys[row.y + high.x]));
            float drawn = farthest == 0u ? 0.0 : 1.0 / soft_limit(uintBitsToFloat(~farthest));
            lowest = min(lowest, max(texelFetch(gaps, low >> 1, 0).x, drawn));
        }
    pyramid[uint(at.y) * blocks.x + uint(at.x)] = lowest;
}
