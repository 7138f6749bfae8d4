// Pixels between measured pixels around each block of BLOCK x BLOCK pixels: from their share of 3 x 3 blocks.
// Reference implementation: model/reference/photo_colours.py, spacing_in_pixels.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform sampler2D mask;  // above 0.5 where measured
layout(r32f, binding = 0) uniform writeonly image2D grid;

void main() {
    ivec2 block = ivec2(gl_GlobalInvocationID.xy), size = textureSize(mask, 0);
    if (any(greaterThanEqual(block, imageSize(grid)))) return;
    ivec2 first = max((block - 1) * BLOCK, 0), last = min((block + 2) * BLOCK, size);
    int count = 0;
    for (int y = first.y; y < last.y; ++y)
        for (int x = first.x; x < last.x; ++x) count += texelFetch(mask, ivec2(x, y), 0).x > 0.5 ? 1 : 0;
    ivec2 extent = last - first;
    imageStore(grid, block, vec4(sqrt(float(extent.x * extent.y) / float(max(count, 1)))));
}
