// Whole-number colour sums: exact and independent of order, where floats break past 2^24.
// Black points may have no colour (axis_x.w > 0): they hide, and are not averaged.
// soft.w > 0: sums of 12-bit linear light, of which a million fit 32 bits; else of sRGB levels.  What does not fit is carried:
// a whole scan seen from afar can lie in a few pixels.

layout(std430, binding = SUMS_BINDING) buffer Sums { uint sums[]; };  // red, green, blue, count
layout(std430, binding = CARRY_BINDING) buffer Carry { uint carries[]; };  // times 2^32; red 10 bits, green 11, blue 11
layout(std430, binding = LIGHT_BINDING) readonly buffer Light {       // model/light.py
    uint to_linear[256];
    uint to_srgb[1024];  // four levels a word, the first in the lowest bits
};

void add_colour(uint pixel, uint word) {
    if (axis_x.w > 0.0 && (word & 0xFFFFFFu) == 0u) return;
    uvec3 colour = uvec3(word, word >> 8, word >> 16) & 0xFFu;
    if (soft.w > 0.0) colour = uvec3(to_linear[colour.x], to_linear[colour.y], to_linear[colour.z]);
    uint carried = 0u;
    if (atomicAdd(sums[4u * pixel], colour.x) > ~colour.x) carried += 1u;
    if (atomicAdd(sums[4u * pixel + 1u], colour.y) > ~colour.y) carried += 1u << 10;
    if (atomicAdd(sums[4u * pixel + 2u], colour.z) > ~colour.z) carried += 1u << 21;
    if (carried != 0u) atomicAdd(carries[pixel], carried);
    atomicAdd(sums[4u * pixel + 3u], 1u);
}

// (high 2^32 + low) / count, rounded half up, for a quotient below 2^12.
uint divided(uint high, uint low, uint count) {
    uint quotient = 0u, over, under;
    for (uint bit = 2048u; bit > 0u; bit >>= 1) {
        umulExtended(quotient | bit, count, over, under);
        if (over < high || (over == high && under <= low)) quotient |= bit;
    }
    umulExtended(quotient, count, over, under);
    uint rest = low - under;
    return quotient + uint(rest >= count - rest);
}

// Mean colour of a pixel in sRGB levels, rounded half up; zero where nothing was added.
uvec4 mean_colour(uint pixel) {
    uint count = sums[4u * pixel + 3u];
    uvec3 sum = uvec3(sums[4u * pixel], sums[4u * pixel + 1u], sums[4u * pixel + 2u]);
    uint divisor = max(count, 1u);
    uvec3 mean = sum / divisor;
    mean += uvec3(greaterThanEqual(2u * (sum - mean * divisor), uvec3(divisor)));  // sum + count / 2 could overflow
    if (count == 0u) mean = uvec3(0u);
    uint carried = carries[pixel];
    if (carried != 0u)
        mean = uvec3(divided(carried & 1023u, sum.x, count), divided((carried >> 10) & 2047u, sum.y, count),
                     divided(carried >> 21, sum.z, count));
    if (soft.w > 0.0)
        for (int c = 0; c < 3; ++c) mean[c] = (to_srgb[mean[c] >> 2] >> (8u * (mean[c] & 3u))) & 0xFFu;
    return uvec4(mean, count);
}
