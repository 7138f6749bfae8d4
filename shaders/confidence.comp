// Confidence of each measured pixel relative to its neighbours, where points have station weights; and the pixel's colour,
// moved towards the tone of more confident neighbours.  Reference implementation: model/reference/station_weights.py, confidence_of and
// match_tone.  Four passes, each from the one before:
// WEIGHTS: sums of the weights and of their squares over blocks of pixels.
// SHARES: a pixel's weight relative to the weighted mean weight around it.
// TONES: over blocks, the colour sums of confident and of other pixels, each with the sum of its confidence.
// PICTURE: the colours; and the confidence, raised where few neighbours are more confident.
// All sums are of integers and interpolated in 256ths; nothing may be fused or reordered: hence precise.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
#if defined(WEIGHTS) || defined(SHARES)
uniform sampler2D weight;  // of a pixel's points / 255
uniform sampler2D mask;
#else
uniform sampler2D raw;
uniform sampler2D share;
#endif
#ifdef WEIGHTS
layout(rg32f, binding = 0) uniform writeonly image2D sums;
#elif defined(SHARES)
uniform sampler2D sums;
layout(r8, binding = 0) uniform writeonly image2D share;
#elif defined(TONES)
layout(rgba32f, binding = 0) uniform writeonly image2D more;
layout(rgba32f, binding = 1) uniform writeonly image2D less;
#else
uniform sampler2D more;
uniform sampler2D less;
layout(rgba8, binding = 0) uniform writeonly image2D toned;
layout(r8, binding = 1) uniform writeonly image2D confidence;
#endif

#if defined(WEIGHTS) || defined(SHARES)
float own(ivec2 at) {
    if (texelFetch(mask, at, 0).x < 0.5) return 0.0;
    return min(floor(texelFetch(weight, at, 0).x * 255.0 + 0.5), float(HEAVIEST));
}
#else
// Confidence in 255ths (x), and what it lacks to 255 at measured pixels (y).
vec2 parts(ivec2 at) {
    float certain = floor(texelFetch(share, at, 0).x * 255.0 + 0.5);
    return vec2(certain, certain > 0.0 ? 255.0 - certain : 0.0);
}

vec3 levels(ivec2 at) {
    return floor(texelFetch(raw, at, 0).xyz * 255.0 + 0.5);
}
#endif

#if !defined(WEIGHTS) && !defined(TONES)
// Block sums interpolated between the blocks' centres, borders repeated.
vec4 around(sampler2D blocks, ivec2 at) {
    vec2 place = (vec2(at) + 0.5) / float(CONFIDENCE_BLOCK) - 0.5, low = floor(place), along = place - low;
    ivec2 last = textureSize(blocks, 0) - 1, a = clamp(ivec2(low), ivec2(0), last), b = clamp(ivec2(low) + 1, ivec2(0), last);
    vec2 back = 1.0 - along;
    precise vec4 left = texelFetch(blocks, a, 0) * back.y + texelFetch(blocks, ivec2(a.x, b.y), 0) * along.y;
    precise vec4 right = texelFetch(blocks, ivec2(b.x, a.y), 0) * back.y + texelFetch(blocks, b, 0) * along.y;
    precise vec4 sum = left * back.x + right * along.x;
    return sum;
}
#endif

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
#if defined(WEIGHTS) || defined(TONES)
#ifdef WEIGHTS
    ivec2 extent = textureSize(weight, 0), blocks = imageSize(sums);
#else
    ivec2 extent = textureSize(raw, 0), blocks = imageSize(more);
#endif
    if (any(greaterThanEqual(at, blocks))) return;
    vec4 first = vec4(0.0), second = vec4(0.0);
    ivec2 stop = min((at + 1) * CONFIDENCE_BLOCK, extent);
    for (int y = at.y * CONFIDENCE_BLOCK; y < stop.y; ++y)
        for (int x = at.x * CONFIDENCE_BLOCK; x < stop.x; ++x) {
#ifdef WEIGHTS
            float w = own(ivec2(x, y));
            first.xy += vec2(w, w * w);
#else
            vec2 part = parts(ivec2(x, y));
            vec4 colour = vec4(levels(ivec2(x, y)), 1.0);
            first += colour * floor(part.x * part.x / 256.0 + 0.5);  // squared: many of low confidence must not outweigh a few
            second += colour * part.y;
#endif
        }
#ifdef WEIGHTS
    imageStore(sums, at, first);
#else
    imageStore(more, at, first);
    imageStore(less, at, second);
#endif
#elif defined(SHARES)
    if (any(greaterThanEqual(at, textureSize(weight, 0)))) return;
    float w = own(at), found = 0.0;
    if (w > 0.0) {
        vec2 all = around(sums, at).xy;
        precise float relative = (w * all.x) / all.y;
        found = floor(min(relative, 1.0) * 255.0 + 0.5) / 255.0;
    }
    imageStore(share, at, vec4(found));
#else
    if (any(greaterThanEqual(at, textureSize(raw, 0)))) return;
    vec2 part = parts(at);
    vec3 tone = levels(at);
    float settled = part.x;
    if (part.y > 0.0) {
        vec4 high = around(more, at), low = around(less, at);
        precise vec3 apart = high.xyz / max(high.w, 1.0) - low.xyz / max(low.w, 1.0);
        precise vec3 moved = tone + (part.y * apart) / 255.0;
        precise float sum = part.x + part.y * (CONFIDENCE_HALF_SUM / (CONFIDENCE_HALF_SUM + high.w));
        tone = floor(clamp(moved, 0.0, 255.0) + 0.5);
        settled = floor(sum + 0.5);
    }
    imageStore(toned, at, vec4(tone / 255.0, 1.0));
    imageStore(confidence, at, vec4(settled / 255.0));
#endif
}
