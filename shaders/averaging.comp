// Averaging in sparse places: how much a measured pixel counts in the fill.  COUNTS: the share of measured pixels of each block.
// Else the weight of each pixel, from its noise and the density interpolated between the blocks' centres.
// Reference implementation: model/reference/pull_push.py.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform sampler2D mask;    // keep-mask or confidence
#ifdef COUNTS
layout(r32f, binding = 0) uniform writeonly image2D shares;
#else
uniform sampler2D shares;
uniform sampler2D level;   // noise level of each measured pixel
uniform float per_level;   // averaged points for each square of that level, where points are sparse
layout(r32f, binding = 0) uniform writeonly image2D averaged;
#endif

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
#ifdef COUNTS
    if (any(greaterThanEqual(at, imageSize(shares)))) return;
    ivec2 start = at * BLOCK, stop = min(start + BLOCK, textureSize(mask, 0));
    float held = 0.0;
    for (int y = start.y; y < stop.y; ++y)
        for (int x = start.x; x < stop.x; ++x) held += texelFetch(mask, ivec2(x, y), 0).x > 0.0 ? 1.0 : 0.0;
    imageStore(shares, at, vec4(held / float((stop.x - start.x) * (stop.y - start.y))));
#else
    if (any(greaterThanEqual(at, imageSize(averaged)))) return;
    float weight = texelFetch(mask, at, 0).x;
    if (weight > 0.0) {
        vec2 place = max((vec2(at) + 0.5) / float(BLOCK) - 0.5, 0.0), along = fract(place);
        ivec2 last = textureSize(shares, 0) - 1, a = min(ivec2(place), last), b = min(a + 1, last);
        float above = mix(texelFetch(shares, a, 0).x, texelFetch(shares, ivec2(b.x, a.y), 0).x, along.x);
        float below = mix(texelFetch(shares, ivec2(a.x, b.y), 0).x, texelFetch(shares, b, 0).x, along.x);
        float apart = 1.0 / max(mix(above, below, along.y), 1e-6);
        float sparse = clamp((apart - DENSE_SQUARE) * SPARSE_SCALE, 0.0, 1.0), noise = texelFetch(level, at, 0).x;
        weight /= 1.0 + sparse * per_level * noise * noise;
    }
    imageStore(averaged, at, vec4(weight));
#endif
}
