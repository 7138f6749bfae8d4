// Hole test, directions: in which of sixteen directions something is measured, at this distance or (unless FIRST) a nearer one.
// Reference implementation: model/reference/hole_test.py.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
layout(r32ui, binding = 0) uniform uimage2D seen;  // a bit for each direction
uniform sampler2D window;  // more than 0 where something is in the window around the cell
uniform int stride;         // cells from one of the sixteen windows to the next

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy), last = textureSize(window, 0) - 1;
    if (any(greaterThan(at, last))) return;
#ifdef FIRST
    uint found = 0u;
#else
    uint found = imageLoad(seen, at).x;
    if (found == 0xFFFFu) return;
#endif
    uint direction = 1u;
    for (int y = -2; y <= 2; ++y)
        for (int x = -2; x <= 2; x += y == -2 || y == 2 ? 1 : 4) {
            ivec2 there = clamp(at + stride * ivec2(x, y), ivec2(0), last);
            if (texelFetch(window, there, 0).x > 0.0) found |= direction;
            direction <<= 1;
        }
    imageStore(seen, at, uvec4(found));
}
