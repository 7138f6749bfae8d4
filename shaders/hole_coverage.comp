// Hole test: opacity of each empty pixel of a cell of 4x4.  It is opaque in a gap of a few pixels: where, in its block of 2x2
// or 4x4 (BLOCKS 2) pixels, of each two consecutive neighbours at least one holds a point.  Elsewhere it depends on how many of the
// cells around it are holes: transparent up to BACKGROUND_BELOW of KERNEL_SUM, then rising linearly.
// A byte a pixel, a component for each 2x2 pixels.  The upper seven bits are the opacity; the lowest is set far inside a hole,
// where all cells around are holes.  Reference implementation: model/reference/hole_test.py.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
layout(rgba32ui, binding = 0) uniform writeonly uimage2D holes;
uniform sampler2D blocks;  // of 2x2 pixels: more than 0 where one is measured
#if BLOCKS == 2
uniform sampler2D cells;   // of 4x4
#endif
uniform sampler2D around;  // of KERNEL_SUM, how many cells near one are holes

float held(sampler2D level, ivec2 at) {
    if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, textureSize(level, 0)))) return 0.0;
    return texelFetch(level, at, 0).x;
}

bool between(float e, float se, float s, float sw, float w, float nw, float n, float ne) {
    return min(min(min(max(e, se), max(se, s)), min(max(s, sw), max(sw, w))),
               min(min(max(w, nw), max(nw, n)), min(max(n, ne), max(ne, e)))) > 0.0;
}

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, imageSize(holes)))) return;
    uvec4 found = uvec4(0u);
    float b[16];  // the cell's four blocks and those around them
    for (int k = 0; k < 16; ++k) b[k] = held(blocks, 2 * at + ivec2(k & 3, k >> 2) - 1);
    for (int k = 0; k < 4; ++k) {
        int m = 5 + (k & 1) + 4 * (k >> 1);
        if (between(b[m + 1], b[m + 5], b[m + 4], b[m + 3], b[m - 1], b[m - 5], b[m - 4], b[m - 3]))
            found[k] = 0xFEFEFEFEu;
    }
#if BLOCKS == 2
    if (between(held(cells, at + ivec2(1, 0)), held(cells, at + ivec2(1, 1)), held(cells, at + ivec2(0, 1)),
                held(cells, at + ivec2(-1, 1)), held(cells, at + ivec2(-1, 0)), held(cells, at + ivec2(-1, -1)),
                held(cells, at + ivec2(0, -1)), held(cells, at + ivec2(1, -1)))) found = uvec4(0xFEFEFEFEu);
#endif
    // Linear between the centres of cells.  All values are multiples of 1/64, and sums are exact.
    ivec2 last = imageSize(holes) - 1;
    float near[9];
    for (int k = 0; k < 9; ++k) near[k] = texelFetch(around, clamp(at + ivec2(k % 3, k / 3) - 1, ivec2(0), last), 0).x;
    for (int y = 0; y < 4; ++y) {
        float share = y == 0 || y == 3 ? 0.375 : 0.125;
        int above = y < 2 ? 0 : 6;
        vec3 row = (1.0 - share) * vec3(near[3], near[4], near[5]) + share * vec3(near[above], near[above + 1], near[above + 2]);
        vec4 pixels = row.y * vec4(0.625, 0.875, 0.875, 0.625) + vec4(row.x, row.x, row.z, row.z) * vec4(0.375, 0.125, 0.125, 0.375);
        precise vec4 level = (pixels - float(BACKGROUND_BELOW)) * COVER_SLOPE;
        uvec4 cover = uvec4(clamp(level, 0.0, 127.0) + 0.5) << 1 | uvec4(equal(pixels, vec4(float(KERNEL_SUM))));
        int left = 2 * (y >> 1), to = 16 * (y & 1);  // in a gap of a few pixels all coverage bits are set already
        found[left] |= (cover.x | cover.y << 8) << to;
        found[left + 1] |= (cover.z | cover.w << 8) << to;
    }
    imageStore(holes, at, uvec4(found));
}
