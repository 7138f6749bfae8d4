// Occlusion pyramid, a coarser level: the minimum of each 2x2 of the level below.
#include "common_occlusion.glsl"

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform uint level;

void main() {
    uvec2 at = gl_GlobalInvocationID.xy;
    uvec4 fine = levels[level - 1u], coarse = levels[level];
    if (at.x >= coarse.x || at.y >= coarse.y) return;
    uvec2 low = 2u * at, high = min(low + 1u, fine.xy - 1u);
    float a = pyramid[fine.z + low.y * fine.x + low.x], b = pyramid[fine.z + low.y * fine.x + high.x];
    float c = pyramid[fine.z + high.y * fine.x + low.x], d = pyramid[fine.z + high.y * fine.x + high.x];
    pyramid[coarse.z + at.y * coarse.x + at.x] = min(min(a, b), min(c, d));
}
