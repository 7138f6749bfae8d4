// Averaging in sparse places: how much a measured pixel counts in the fill.  BLOCKS: of each block the share of measured pixels, and
// the sums of their depth features and of the squares of these, over the number of pixels.  Else the weight of each pixel, from its
// noise and these, interpolated between the blocks' centres: a pixel nearer than most around it keeps its weight.
// Reference implementation: model/reference/pull_push.py.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform sampler2D mask;        // keep-mask or confidence
uniform sampler2D depth;
uniform float feature_scale;   // 1 / (focal length in pixels x point spacing)
#ifdef BLOCKS
layout(rgba32f, binding = 0) uniform writeonly image2D blocks;
#else
uniform sampler2D blocks;
uniform sampler2D level;       // noise level of each measured pixel
uniform vec2 ramp;             // square of the distance between points from which some are averaged, and slope of the share
uniform float per_level;       // averaged points for each square of that level, where points are sparse
layout(r32f, binding = 0) uniform writeonly image2D averaged;
#endif

float feature(ivec2 at) {
    return clamp(log2(texelFetch(depth, at, 0).x * feature_scale) * FEATURE_SCALE, -FEATURE_LIMIT, FEATURE_LIMIT);
}

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
#ifdef BLOCKS
    if (any(greaterThanEqual(at, imageSize(blocks)))) return;
    ivec2 start = at * BLOCK, stop = min(start + BLOCK, textureSize(mask, 0));
    vec3 held = vec3(0.0);
    for (int y = start.y; y < stop.y; ++y)
        for (int x = start.x; x < stop.x; ++x)
            if (texelFetch(mask, ivec2(x, y), 0).x > 0.0) {
                float f = feature(ivec2(x, y));
                held += vec3(1.0, f, f * f);
            }
    imageStore(blocks, at, vec4(held / float((stop.x - start.x) * (stop.y - start.y)), 0.0));
#else
    if (any(greaterThanEqual(at, imageSize(averaged)))) return;
    float weight = texelFetch(mask, at, 0).x;
    if (weight > 0.0) {
        vec2 place = max((vec2(at) + 0.5) / float(BLOCK) - 0.5, 0.0), along = fract(place);
        ivec2 last = textureSize(blocks, 0) - 1, a = min(ivec2(place), last), b = min(a + 1, last);
        vec3 above = mix(texelFetch(blocks, a, 0).xyz, texelFetch(blocks, ivec2(b.x, a.y), 0).xyz, along.x);
        vec3 below = mix(texelFetch(blocks, ivec2(a.x, b.y), 0).xyz, texelFetch(blocks, b, 0).xyz, along.x);
        vec3 around = mix(above, below, along.y);
        float density = max(around.x, 1e-6), mean = around.y / density;
        float spread = sqrt(max(around.z / density - mean * mean, 0.0));
        float near = clamp((mean - feature(at) - NEAR_SPREAD * spread) * NEAR_SCALE, 0.0, 1.0);
        float sparse = clamp((1.0 / density - ramp.x) * ramp.y, 0.0, 1.0), noise = texelFetch(level, at, 0).x;
        weight /= 1.0 + sparse * (1.0 - near) * per_level * noise * noise;
    }
    imageStore(averaged, at, vec4(weight));
#endif
}
