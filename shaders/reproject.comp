// The neural picture of an earlier camera as the present one sees it, where both see the same surface; the filled picture
// elsewhere, smoothed as far as the network smoothed the earlier one, and as a bound: a moved colour leaves the range of the
// filled picture's 3 x 3 pixels around it by WIDER of it at most.
// Four pixels an invocation, which share what they read of the filled picture: software OpenGL pays for each fetch.
// Reference implementation: model/reference/reprojection.py.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform sampler2D filled;         // of the present camera, premultiplied
uniform sampler2D filled_depth;   // view-space z, 0 where it is not opaque
uniform sampler2D earlier;        // the earlier neural picture
uniform sampler2D earlier_depth;  // of its pixels
uniform mat3 turn;                // present view frame -> earlier view frame
uniform vec3 shift;               // the present camera in the earlier view frame
uniform vec4 ray;                 // 1 / fx, 1 / fy, -cx / fx, -cy / fy of the present camera
uniform vec4 lens;                // fx, fy, cx, cy of the earlier camera
uniform float smoothing;          // how far a pixel moves to the mean of its 3 x 3
layout(rgba8, binding = 0) uniform writeonly image2D result;
layout(std430, binding = COMMANDS_BINDING) buffer Tally { uint moved; };  // of the pixels counted, those that were moved

// A picture between its pixels' centres, its border repeated.
vec4 between(sampler2D picture, vec2 pixel, ivec2 extent) {
    return textureLod(picture, clamp(pixel, vec2(0.5), vec2(extent) - 0.5) / vec2(extent), 0.0);
}

vec4 near(ivec2 at, ivec2 size) {
    return texelFetch(filled, clamp(at, ivec2(0), size - 1), 0);
}

// at: a pixel of the result.  base, z: of the filled picture there.  low, high: of its 3 x 3 pixels.
void write(ivec2 at, ivec2 extent, vec4 base, float z, vec3 low, vec3 high) {
    if (any(greaterThanEqual(at, extent))) return;
    vec3 there = turn * (vec3((vec2(at) + 0.5) * ray.xy + ray.zw, 1.0) * z) + shift;
    vec2 pixel = lens.xy * (there.xy / there.z) + lens.zw;
    ivec2 texel = ivec2(floor(pixel)), bounds = textureSize(earlier, 0);
    float trust = 0.0;
    bool inside = all(greaterThanEqual(texel, ivec2(0))) && all(lessThan(texel, bounds));
    if (z > 0.0 && there.z > 0.0 && inside) {
        float known = texelFetch(earlier_depth, texel, 0).x;
        float apart = abs(known - there.z) / min(known, there.z);
        float nearer = clamp((MOST_NEARER - there.z / z) / FADES_OVER, 0.0, 1.0);
        if (known > 0.0) trust = clamp(2.0 - 2.0 * apart / SAME_DEPTH, 0.0, 1.0) * nearer;
        vec3 colour = between(earlier, pixel, bounds).rgb;
        vec3 beyond = WIDER * (high - low);
        base.rgb = mix(base.rgb, clamp(colour, low - beyond, high + beyond), SHARE * trust);
    }
    imageStore(result, at, base);
    if (trust > 0.0 && (at.x | at.y) % COUNTED == 0) atomicAdd(moved, 1u);
}

void main() {
    ivec2 at = 2 * ivec2(gl_GlobalInvocationID.xy), extent = imageSize(result);
    if (any(greaterThanEqual(at, extent))) return;
    ivec2 size = textureSize(filled, 0);
    // Range of three pixels above each other, for each of four columns and both rows of the four pixels.
    vec4 own[4];
    vec3 low[8], high[8];
    vec4 sums[8];
    for (int x = 0; x < 4; ++x) {
        vec4 a = near(at + ivec2(x - 1, -1), size), b = near(at + ivec2(x - 1, 0), size);
        vec4 c = near(at + ivec2(x - 1, 1), size), d = near(at + ivec2(x - 1, 2), size);
        vec3 lower = min(b.rgb, c.rgb), upper = max(b.rgb, c.rgb);
        low[x] = min(a.rgb, lower);
        high[x] = max(a.rgb, upper);
        low[4 + x] = min(lower, d.rgb);
        high[4 + x] = max(upper, d.rgb);
        sums[x] = a + b + c;
        sums[4 + x] = b + c + d;
        if (x == 1 || x == 2) {
            own[x - 1] = b;
            own[x + 1] = c;
        }
    }
    for (int y = 0; y < 2; ++y)
        for (int x = 0; x < 2; ++x) {
            int first = 4 * y + x;
            vec4 mean = sums[first] + sums[first + 1] + sums[first + 2], base = own[2 * y + x];
            if (mean.a > 0.0) base.rgb = mix(base.rgb, mean.rgb * (base.a / mean.a), smoothing);
            write(at + ivec2(x, y), extent, base, texelFetch(filled_depth, at + ivec2(x, y), 0).x,
                  min(min(low[first], low[first + 1]), low[first + 2]), max(max(high[first], high[first + 1]), high[first + 2]));
        }
}
