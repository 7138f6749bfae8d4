// Whole-number colour sums: exact and independent of order, where floats break past 2^24.
// Black points may have no colour (axis_x.w > 0): they hide, and are not averaged.
// soft.w > 0: sums of 12-bit linear light; else of sRGB levels.  Two sums share a word, since atomics are what a point costs
// most; what does not fit 16 bits is carried: a whole scan seen from afar can lie in a few pixels.

layout(std430, binding = SUMS_BINDING) buffer Sums { uint sums[]; };       // a pixel, 16 bits each, low first: red, green; blue, count
layout(std430, binding = CARRY_BINDING) buffer Carry { uint carries[]; };  // a pixel, times 2^16: red, green, blue, count
layout(std430, binding = LIGHT_BINDING) readonly buffer Light {            // model/light.py
    uint to_linear[256];
    uint to_srgb[1024];  // four levels a word, the first in the lowest bits
};

void add_pair(uint word, uint low, uint high) {
    uint more = high << 16 | low, before = atomicAdd(sums[word], more);
    bool low_full = (before & 0xFFFFu) + low > 0xFFFFu, high_full = before > ~more;
    if (low_full) atomicAdd(carries[2u * word], 1u);
    if (high_full) atomicAdd(carries[2u * word + 1u], 1u);
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

// Mean colour of a pixel in sRGB levels, rounded half up, and the weight of what was added; zero where nothing was.
// Leaves the carries empty for the next frame: few pixels have any, and clearing all of them would cost more.
uvec4 mean_colour(uint pixel) {
    uvec2 words = uvec2(sums[2u * pixel], sums[2u * pixel + 1u]);
    uvec4 carry = uvec4(carries[4u * pixel], carries[4u * pixel + 1u], carries[4u * pixel + 2u], carries[4u * pixel + 3u]);
    uint count = words.y >> 16;
    uvec3 mean;
    if (carry == uvec4(0u)) {
        uint divisor = max(count, 1u);
        mean = (uvec3(words.x & 0xFFFFu, words.x >> 16, words.y & 0xFFFFu) + divisor / 2u) / divisor;
    } else {
        for (uint i = 0u; i < 4u; ++i) carries[4u * pixel + i] = 0u;
        uvec4 first = unpacked(words.x, carry.x, carry.y), second = unpacked(words.y, carry.z, carry.w);
        count = second.z;
        mean = uvec3(divided(first.y, first.x, count), divided(first.w, first.z, count), divided(second.y, second.x, count));
    }
    if (soft.w > 0.0)
        for (int c = 0; c < 3; ++c) mean[c] = (to_srgb[mean[c] >> 2] >> (8u * (mean[c] & 3u))) & 0xFFu;
    return uvec4(mean, count);
}
