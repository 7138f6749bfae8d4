// What photographs show of a picture, and their share as alpha.  Reference implementation:
// model/reference/photo_colours.py; viewer/render/photographs/photo_loops.py does the same on the processor.
// A workgroup finds the depths of its pixels and the photographs whose frustum meets them, which changes no pixel.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
#include "common_photographs.glsl"
#include "common_blocks.glsl"
uniform sampler2D depth;    // view-space z of the filled picture, 0 where it is not opaque
uniform sampler2D certain;  // of photo_surface.comp
uniform sampler2D grid;     // of photo_spacing.comp
uniform vec4 lens;          // fx, fy, cx, cy in pixels
uniform int photographs;    // records
uniform sampler2D filled;
layout(rgba8, binding = 0) uniform writeonly image2D colours;

shared uint near_bits, far_bits;  // of positive depths, which have the order of their bits
shared int count;
shared int candidates[MOST_PHOTOGRAPHS];

float certainty(ivec2 at, ivec2 size) {
    float least = 1.0;
    for (int k = 0; k < 9; ++k)
        least = min(least, texelFetch(certain, clamp(at + ivec2(k % 3, k / 3) - 1, ivec2(0), size - 1), 0).x);
    return least;
}

vec3 place_of(ivec2 at) { return vec3((vec2(at) + 0.5 - lens.zw) / lens.xy, 1.0) * texelFetch(depth, at, 0).x; }

// Whether the block of the view frustum around this workgroup lies outside a photograph's frustum.
bool outside(int photo, float near, float far) {
    if (whole(photo, KIND) != PINHOLE) return false;
    ivec2 first = ivec2(gl_WorkGroupID.xy) * ivec2(TILE_X, TILE_Y);
    vec4 own = lens_of(photo);
    int all_out = 31;
    for (int corner = 0; corner < 8; ++corner) {
        vec2 pixel = vec2(first + ivec2(corner & 1, corner >> 1 & 1) * ivec2(TILE_X, TILE_Y));
        vec3 p = in_photograph(photo, vec3((pixel - lens.zw) / lens.xy, 1.0) * ((corner & 4) != 0 ? near : far));
        float d = -p.z;
        int out_of = (d <= 0.0 ? 1 : 0) + (own.z * d + own.x * p.x < 0.0 ? 2 : 0) + (own.w * d - own.y * p.y < 0.0 ? 8 : 0);
        out_of += ((float(whole(photo, WIDTH)) - own.z) * d - own.x * p.x < 0.0 ? 4 : 0);
        out_of += ((float(whole(photo, HEIGHT)) - own.w) * d + own.y * p.y < 0.0 ? 16 : 0);
        all_out &= out_of;
    }
    return all_out != 0;
}

// Column and row of a place in a photograph's frame; x below 0 where it does not show it.
vec2 projected(int photo, vec3 p) {
    vec4 own = lens_of(photo);
    vec2 size = vec2(whole(photo, WIDTH), whole(photo, HEIGHT)), at;
    if (whole(photo, KIND) == PINHOLE) {
        if (p.z >= 0.0) return vec2(-1.0);
        at = own.zw + vec2(-p.x, p.y) / p.z * own.xy;
    } else {
        float flat_distance = length(p.xy);
        if (flat_distance <= 0.0) return vec2(-1.0);
        at = own.zw - vec2(atan(p.y, p.x), whole(photo, KIND) == SPHERICAL ? atan(p.z, flat_distance) : p.z / flat_distance)
            * own.xy;
        if (whole(photo, AROUND) != 0) at.x -= floor(at.x / size.x) * size.x;
    }
    return all(greaterThanEqual(at, vec2(0.0))) && all(lessThan(at, size)) ? at : vec2(-1.0);
}

// Colour of a photograph, bilinear in one mip level, times its gains; x below 0 where a texel holds nothing.
vec3 sampled(int photo, vec2 at, float footprint) {
    int level = 0, levels = whole(photo, LEVELS);
    ivec2 size = ivec2(whole(photo, WIDTH), whole(photo, HEIGHT)), full = size;
    for (float limit = 0.70710678; level < levels - 1 && footprint <= limit; ++level, limit *= 0.5) size = (size + 1) / 2;
    vec2 place = at * (vec2(size) / vec2(full)) - 0.5, low = floor(place), t = place - low;
    ivec2 a = ivec2(low), b = a + 1;
    int first = whole(photo, LEVEL + level);
    if (whole(photo, AROUND) != 0) {
        a.x = a.x < 0 ? a.x + size.x : a.x;
        b.x = b.x >= size.x ? b.x - size.x : b.x;
    }
    a = clamp(a, ivec2(0), size - 1);
    b = clamp(b, ivec2(0), size - 1);
    uint one = words[first + a.y * size.x + a.x], two = words[first + a.y * size.x + b.x];
    uint below = words[first + b.y * size.x + a.x], last = words[first + b.y * size.x + b.x];
    if ((one & two & below & last) >> 24 != 255u) return vec3(-1.0);
    vec3 upper = mix(unpackUnorm4x8(one).rgb, unpackUnorm4x8(two).rgb, t.x);
    vec3 lower = mix(unpackUnorm4x8(below).rgb, unpackUnorm4x8(last).rgb, t.x);
    return 255.0 * mix(upper, lower, t.y) * three(photo, GAINS);
}

float apart(vec3 a, vec3 b) { return dot(abs(a - b), vec3(1.0)); }

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy), size = imageSize(colours);
    bool inside = all(lessThan(at, size));
    if (gl_LocalInvocationIndex == 0u) {
        near_bits = 0x7f800000u;
        far_bits = 0u;
        count = 0;
    }
    barrier();
    float z = inside ? texelFetch(depth, at, 0).x : 0.0, sure = 0.0, spacing = 1.0;
    if (z > 0.0) {
        spacing = between_blocks(grid, at).x;
        sure = certainty(at, size) * clamp((SPARSE_TO - spacing) / (SPARSE_TO - SPARSE_FROM), 0.0, 1.0);
    }
    if (sure > 0.0) {
        atomicMin(near_bits, floatBitsToUint(z));
        atomicMax(far_bits, floatBitsToUint(z));
    }
    barrier();
    if (far_bits != 0u && gl_LocalInvocationIndex == 0u)  // in their order, so that equal weights have one winner
        for (int photo = 0; photo < photographs; ++photo)
            if (!outside(photo, uintBitsToFloat(near_bits), uintBitsToFloat(far_bits))) candidates[count++] = photo;
    barrier();
    if (!inside) return;
    if (sure <= 0.0 || count == 0) {
        imageStore(colours, at, vec4(0.0));
        return;
    }
    vec3 place = place_of(at), view = normalize(place);
    ivec2 last = size - 1;
    vec3 normal = cross(
        place_of(ivec2(min(at.x + NORMAL_AT, last.x), at.y)) - place_of(ivec2(max(at.x - NORMAL_AT, 0), at.y)),
        place_of(ivec2(at.x, min(at.y + NORMAL_AT, last.y))) - place_of(ivec2(at.x, max(at.y - NORMAL_AT, 0))));
    float steepness = length(normal);
    normal = steepness > 0.0 ? normal / steepness : vec3(0.0);
    vec3 weights = vec3(0.0), confident = vec3(0.0);
    ivec3 who = ivec3(0);
    vec3 where[3];  // column, row, footprint
    where[0] = where[1] = where[2] = vec3(0.0);
    for (int k = 0; k < count; ++k) {
        int photo = candidates[k];
        vec2 pixel = projected(photo, in_photograph(photo, place));
        if (pixel.x < 0.0) continue;
        vec3 ray = from_photograph(photo, place);
        float far = length(ray), wide = float(whole(photo, WIDTH)), high = float(whole(photo, HEIGHT));
        ray /= far;
        ivec2 map = ivec2(whole(photo, MAP_WIDTH), whole(photo, MAP_HEIGHT));
        ivec2 texel = min(ivec2(pixel * (vec2(map) / vec2(wide, high))), map - 1);
        float nearest = uintBitsToFloat(words[whole(photo, MAP) + texel.y * map.x + texel.x]);
        float visible = clamp(2.0 - (far / nearest - 1.0) / HIDDEN, 0.0, 1.0);
        float footprint = far / number(photo, LENS) * lens.x / z;
        float fine = clamp((COARSE_TO - footprint / spacing) / (COARSE_TO - COARSE_FROM), 0.0, 1.0);
        float facing = abs(dot(ray, normal));
        float steep = clamp((facing - GRAZING_FROM) / (GRAZING_TO - GRAZING_FROM), 0.0, 1.0);
        float confidence = sure * visible * fine * steep * number(photo, PRESENCE);
        float border = min(pixel.y, high - pixel.y);
        if (whole(photo, AROUND) == 0) border = min(border, min(pixel.x, wide - pixel.x));
        float inner = AT_BORDER + (1.0 - AT_BORDER) * min(border / (BORDER * wide), 1.0);
        float weight = confidence * facing * inner / ((LEAST_ANGLE + 1.0 - clamp(dot(ray, view), -1.0, 1.0)) * footprint);
        if (!(weight > weights.z)) continue;
        vec3 shown = vec3(pixel, footprint);
        int rank = weight > weights.x ? 0 : weight > weights.y ? 1 : 2;
        if (rank < 2) {
            weights.z = weights.y; confident.z = confident.y; who.z = who.y; where[2] = where[1];
        }
        if (rank < 1) {
            weights.y = weights.x; confident.y = confident.x; who.y = who.x; where[1] = where[0];
        }
        weights[rank] = weight; confident[rank] = confidence; who[rank] = photo; where[rank] = shown;
    }
    vec3 seen[4];
    seen[3] = floor(255.0 * texelFetch(filled, at, 0).rgb + 0.5);
    for (int k = 0; k < 3; ++k) {
        seen[k] = weights[k] > 0.0 ? sampled(who[k], where[k].xy, where[k].z) : vec3(0.0);
        if (weights[k] <= 0.0 || seen[k].x < 0.0) {
            weights[k] = confident[k] = 0.0;
            seen[k] = vec3(0.0);
        }
    }
    vec4 all = vec4(weights, POINTS_VOTE * max(weights.x, max(weights.y, weights.z)));
    float least = 1e30, part = max(confident.x, max(confident.y, confident.z));
    vec3 middle = seen[3];
    for (int j = 0; j < 4; ++j) {
        float cost = 0.0;
        for (int k = 0; k < 4; ++k) cost += all[k] * apart(seen[k], seen[j]);
        if (all[j] > 0.0 && cost < least) {
            least = cost;
            middle = seen[j];
        }
    }
    float total = 0.0;
    vec3 mean = vec3(0.0);
    for (int k = 0; k < 3; ++k) {
        vec3 off = abs(seen[k] - middle);
        float agrees = 1.0 + pow(max(off.x, max(off.y, off.z)) / AGREES, 2.0), weight = weights[k] / (agrees * agrees);
        total += weight;
        mean += weight * seen[k];
    }
    mean = total > 0.0 ? clamp(mean / total, 0.0, 255.0) : vec3(0.0);
    imageStore(colours, at, vec4(mean / 255.0, total > 0.0 ? part : 0.0));
}
