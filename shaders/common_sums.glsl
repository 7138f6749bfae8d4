// Whole-number colour sums: exact and independent of order, where floats break past 2^24.
// Black points may have no colour (axis_x.w > 0): they hide, and are not averaged.
// soft.w > 0: sums of 12-bit linear light; else of sRGB levels.  Two sums share a word, since atomics are what a point costs
// most; what does not fit 16 bits is carried: a whole scan seen from afar can lie in a few pixels.

layout(std430, binding = SUMS_BINDING) buffer Sums { uint sums[]; };       // a pixel, 16 bits each, low first: red, green; blue, count
layout(std430, binding = CARRY_BINDING) buffer Carry {
    uint carried_groups[4];  // workgroups x, y, z of the pass over what was carried; x is 0 until something is
    uint carries[];          // a pixel, times 2^16: red, green, blue, count
};
layout(std430, binding = LIGHT_BINDING) readonly buffer Light {            // model/common/linear_light.py
    uint to_linear[256];
    uint to_srgb[1024];  // four levels a word, the first in the lowest bits
};

void add_pair(uint word, uint low, uint high) {
    uint more = high << 16 | low, before = atomicAdd(sums[word], more);
    bool low_full = (before & 0xFFFFu) + low > 0xFFFFu, high_full = before > ~more;
    if (low_full) atomicAdd(carries[2u * word], 1u);
    if (high_full) atomicAdd(carries[2u * word + 1u], 1u);
    if (low_full || high_full) atomicMax(carried_groups[0], (size.x + uint(TILE_X) - 1u) / uint(TILE_X));
}

// weight: 1..HEAVIEST, so that what is added to a sum at once fits 16 bits.
void add_colour(uint pixel, uint word, uint weight) {
    if (axis_x.w > 0.0 && (word & 0xFFFFFFu) == 0u) return;
    uvec3 colour = uvec3(word, word >> 8, word >> 16) & 0xFFu;
    if (soft.w > 0.0) colour = uvec3(to_linear[colour.x], to_linear[colour.y], to_linear[colour.z]);
    add_pair(2u * pixel, colour.x * weight, colour.y * weight);
    add_pair(2u * pixel + 1u, colour.z * weight, weight);
}

// A word's two sums, 64 bits each: low's low and high word, high's.  A carry from low has been counted into high.
uvec4 unpacked(uint word, uint low_carry, uint high_carry) {
    uint high = high_carry << 16 | word >> 16;
    return uvec4(low_carry << 16 | (word & 0xFFFFu), low_carry >> 16,
                 high - low_carry, (high_carry >> 16) - uint(high < low_carry));
}

// sum / count, rounded half up, for a sum below 2^16.  Exact: what floats may err by is put right.
uvec3 rounded(uvec3 sum, uint count) {
    uvec3 whole = sum + count / 2u, quotient = uvec3(vec3(whole) * (1.0 / float(count)));
    ivec3 rest = ivec3(whole - quotient * count);
    return quotient + uvec3(greaterThanEqual(rest, ivec3(count))) - uvec3(lessThan(rest, ivec3(0)));
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

uvec4 in_srgb(uvec3 mean, uint count) {
    if (soft.w > 0.0)
        for (int c = 0; c < 3; ++c) mean[c] = (to_srgb[mean[c] >> 2] >> (8u * (mean[c] & 3u))) & 0xFFu;
    return uvec4(mean, count);
}

// Mean colour of a pixel in sRGB levels, rounded half up, and the weight of what was added; zero where nothing was.
// Of pixels that nothing was carried of; the others get any colour.
uvec4 mean_colour(uint pixel) {
    uvec2 words = uvec2(sums[2u * pixel], sums[2u * pixel + 1u]);
    uint count = words.y >> 16;
    uvec3 mean = rounded(uvec3(words.x & 0xFFFFu, words.x >> 16, words.y & 0xFFFFu), max(count, 1u));
    return in_srgb(min(mean, uvec3(4095u)), count);
}

// The same of a pixel that something was carried of; false where nothing was.  Leaves the carries empty for the next frame.
bool carried_colour(uint pixel, out uvec4 mean) {
    uvec4 carry = uvec4(carries[4u * pixel], carries[4u * pixel + 1u], carries[4u * pixel + 2u], carries[4u * pixel + 3u]);
    if (pixel == 0u) carried_groups[0] = 0u;
    if (carry == uvec4(0u)) return false;
    for (uint i = 0u; i < 4u; ++i) carries[4u * pixel + i] = 0u;
    uvec4 first = unpacked(sums[2u * pixel], carry.x, carry.y), second = unpacked(sums[2u * pixel + 1u], carry.z, carry.w);
    uint count = second.z;
    mean = in_srgb(uvec3(divided(first.y, first.x, count), divided(first.w, first.z, count),
                         divided(second.y, second.x, count)), count);
    return true;
}
