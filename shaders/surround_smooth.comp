// How many, weighted, of the cells around one see something in every direction: along rows first (ROWS), then along columns.
// Whole numbers throughout.  Twin: model/surrounded.py.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
layout(r16f, binding = 0) uniform writeonly image2D smoothed;
#ifdef ROWS
uniform usampler2D seen;
#else
uniform sampler2D rows;
#endif

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy), last = imageSize(smoothed) - 1;
    if (any(greaterThan(at, last))) return;
    float sum = 0.0;
    for (int tap = 1 - SIDE; tap < SIDE; ++tap) {
#ifdef ROWS
        float value = texelFetch(seen, clamp(at + ivec2(tap, 0), ivec2(0), last), 0).x == 0xFFFFu ? 1.0 : 0.0;
#else
        float value = texelFetch(rows, clamp(at + ivec2(0, tap), ivec2(0), last), 0).x;
#endif
        sum += float(SIDE - abs(tap)) * value;
    }
    imageStore(smoothed, at, vec4(sum));
}
