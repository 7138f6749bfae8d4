// Hole test: dilation of the cells in which something is measured, by a number of cells on each side.
// Reference implementation: model/reference/hole_test.py.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
layout(r8, binding = 0) uniform writeonly image2D wider;
uniform sampler2D window;  // more than 0 where something is
uniform int by;            // no more than the window is wide, or cells between would be missed

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy), last = textureSize(window, 0) - 1;
    if (any(greaterThan(at, last))) return;
    float most = 0.0;
    for (int y = -1; y <= 1; ++y)
        for (int x = -1; x <= 1; ++x)  // beyond the picture: the cell at its border, which the window holds anyway
            most = max(most, texelFetch(window, clamp(at + by * ivec2(x, y), ivec2(0), last), 0).x);
    imageStore(wider, at, vec4(most > 0.0 ? 1.0 : 0.0));
}
