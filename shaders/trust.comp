// How far each measured pixel is trusted beside those around it, where points have weights.  Twin: model/station_weights.py.
// BLOCKS: sums of the weights, and of their squares, over blocks of pixels.  Else: a pixel's weight by the mean weight around
// it, in which each counts by its own weight; sums of whole numbers, interpolated in 256ths: exact in any order.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform sampler2D weight;  // of a pixel's points, HEAVIEST at most, / 255
uniform sampler2D mask;
#ifdef BLOCKS
layout(rg32f, binding = 0) uniform writeonly image2D sums;
#else
uniform sampler2D blocks;
layout(r8, binding = 0) uniform writeonly image2D trust;
#endif

float own(ivec2 at) {
    return texelFetch(mask, at, 0).x < 0.5 ? 0.0 : floor(texelFetch(weight, at, 0).x * 255.0 + 0.5);
}

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy), extent = textureSize(weight, 0);
#ifdef BLOCKS
    if (any(greaterThanEqual(at, imageSize(sums)))) return;
    vec2 total = vec2(0.0);
    ivec2 stop = min((at + 1) * TRUST_BLOCK, extent);
    for (int y = at.y * TRUST_BLOCK; y < stop.y; ++y)
        for (int x = at.x * TRUST_BLOCK; x < stop.x; ++x) {
            float w = own(ivec2(x, y));
            total += vec2(w, w * w);
        }
    imageStore(sums, at, vec4(total, 0.0, 0.0));
#else
    if (any(greaterThanEqual(at, extent))) return;
    float w = own(at), share = 0.0;
    if (w > 0.0) {
        vec2 place = (vec2(at) + 0.5) / float(TRUST_BLOCK) - 0.5, low = floor(place), along = place - low;
        ivec2 last = textureSize(blocks, 0) - 1, a = clamp(ivec2(low), ivec2(0), last), b = clamp(ivec2(low) + 1, ivec2(0), last);
        vec2 left = mix(texelFetch(blocks, a, 0).xy, texelFetch(blocks, ivec2(a.x, b.y), 0).xy, along.y);
        vec2 right = mix(texelFetch(blocks, ivec2(b.x, a.y), 0).xy, texelFetch(blocks, b, 0).xy, along.y);
        vec2 around = mix(left, right, along.x);
        share = floor(min(w * around.x / around.y, 1.0) * 255.0 + 0.5) / 255.0;
    }
    imageStore(trust, at, vec4(share));
#endif
}
