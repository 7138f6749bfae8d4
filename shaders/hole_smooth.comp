// Weighted count of the cells around each cell that are holes: along rows first (ROWS), then along columns.
// A cell is a hole where something is measured in every direction (AROUND).  Outdoors (MARCHED) its ray must also have touched
// an occupied block; and it is a hole in any case where its ray met the middle of a surface.  All sums are integers.
// Reference implementation: model/reference/hole_test.py.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
layout(r16f, binding = 0) uniform writeonly image2D smoothed;
#ifdef ROWS
#ifdef AROUND
uniform usampler2D seen;
#endif
#ifdef MARCHED
uniform usampler2D met;  // as hole_march.comp leaves it
#endif
#else
uniform sampler2D rows;
#endif

#ifdef ROWS
float hole(ivec2 at) {
#ifdef AROUND
    bool all = texelFetch(seen, at, 0).x == 0xFFFFu;
#else
    const bool all = false;
#endif
#ifdef MARCHED
    uint ray = texelFetch(met, at >> RAY_SHIFT, 0).x;
    return ray == uint(IN_SURFACE) || (all && ray == uint(TOUCHED)) ? 1.0 : 0.0;
#else
    return all ? 1.0 : 0.0;
#endif
}
#endif

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy), last = imageSize(smoothed) - 1;
    if (any(greaterThan(at, last))) return;
    float sum = 0.0;
    for (int tap = 1 - SIDE; tap < SIDE; ++tap) {
#ifdef ROWS
        float value = hole(clamp(at + ivec2(tap, 0), ivec2(0), last));
#else
        float value = texelFetch(rows, clamp(at + ivec2(0, tap), ivec2(0), last), 0).x;
#endif
        sum += float(SIDE - abs(tap)) * value;
    }
    imageStore(smoothed, at, vec4(sum));
}
