// Integer colour sums of each pixel: exact and independent of order, where float32 sums would round past 2^24.
// Points that may have no colour (axis_x.w > 0, and black) occlude, and are not averaged.
// soft.w > 0: sums of 12-bit linear light; else of sRGB levels.
// Two sums share a word, red with green and blue with weight, because atomic operations are the main cost of a point.
// WIDE_SUMS, where the driver has 64-bit atomics: 32 bits for each sum.  Otherwise 16 bits for each.
// Overflow is counted in carries: a whole scan seen from afar can fall into a few pixels, and with station weights one
// addition of 16 bits is up to 61,425.

#ifdef WIDE_SUMS
layout(std430, binding = SUMS_BINDING) buffer Sums { int64_t sums[]; };  // 2 a pixel, low 32 bits first: red, green; blue, weight
#else
layout(std430, binding = SUMS_BINDING) buffer Sums { uint sums[]; };     // 2 a pixel, low 16 bits first: red, green; blue, weight
#endif
layout(std430, binding = CARRY_BINDING) buffer Carry {
    uint carried_groups[4];  // workgroups x, y, z of the pass over pixels with carries; x is 0 while there are none
    uint carries[];          // 4 a pixel, in units of 2^16 (WIDE_SUMS: 2^32): red, green, blue, weight
};
// Textures: software OpenGL takes twice as long for a word of a storage block.  SUMS_COPIED: the sums are in one as well.
layout(binding = TO_LINEAR_UNIT) uniform usampler2D to_linear;  // (256, 1), model/common/linear_light.py
layout(binding = TO_SRGB_UNIT) uniform usampler2D to_srgb;      // 4096 levels in rows of 64
#ifdef SUMS_COPIED
uniform usampler2D copied_sums;
#endif

uint linear(uint srgb) { return texelFetch(to_linear, ivec2(srgb, 0), 0).x; }

void add_pair(uint word, uint low, uint high) {
#ifdef WIDE_SUMS
    uint64_t more = uint64_t(high) << 32 | uint64_t(low);
    uint64_t before = uint64_t(atomicAdd(sums[word], int64_t(more)));  // the extension adds signed words only
    bool low_full = uint(before & 0xFFFFFFFFul) > ~low, high_full = before > ~more;
#else
    uint more = high << 16 | low, before = atomicAdd(sums[word], more);
    bool low_full = (before & 0xFFFFu) + low > 0xFFFFu, high_full = before > ~more;
#endif
    if (low_full) atomicAdd(carries[2u * word], 1u);
    if (high_full) atomicAdd(carries[2u * word + 1u], 1u);
    // Every writer writes the same value.  It is read first, because all invocations would queue at this one address.
    if ((low_full || high_full) && carried_groups[0] == 0u)
        atomicMax(carried_groups[0], (size.x + uint(TILE_X) - 1u) / uint(TILE_X));
}

// weight: 1..HEAVIEST, so that one addition to a sum fits 16 bits.
void add_colour(uint pixel, uint word, uint weight) {
    if (axis_x.w > 0.0 && (word & 0xFFFFFFu) == 0u) return;
    uvec3 colour = uvec3(word, word >> 8, word >> 16) & 0xFFu;
    if (soft.w > 0.0) colour = uvec3(linear(colour.x), linear(colour.y), linear(colour.z));
    add_pair(2u * pixel, colour.x * weight, colour.y * weight);
    add_pair(2u * pixel + 1u, colour.z * weight, weight);
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

#ifdef WIDE_SUMS
// The two sums of a word without carries.
uvec2 low_parts(uint word) { return uvec2(uint(uint64_t(sums[word]) & 0xFFFFFFFFul), uint(uint64_t(sums[word]) >> 32)); }

// The two sums of a word with its carries, 64 bits each: low and high word of the first, of the second.  A carry from the
// first sum was counted into the second.
uvec4 with_carries(uint word, uint low_carry, uint high_carry) {
    uvec2 parts = low_parts(word);
    return uvec4(parts.x, low_carry, parts.y - low_carry, high_carry - uint(parts.y < low_carry));
}

// sum / count, rounded half up.
uvec3 rounded(uvec3 sum, uint count) {
    uvec3 quotient = sum / count, rest = sum - quotient * count;
    return quotient + uvec3(greaterThanEqual(rest, count - rest));
}
#else
uvec2 low_parts(uint word) { return uvec2(sums[word] & 0xFFFFu, sums[word] >> 16); }

uvec4 with_carries(uint word, uint low_carry, uint high_carry) {
    uint high = high_carry << 16 | sums[word] >> 16;
    return uvec4(low_carry << 16 | (sums[word] & 0xFFFFu), low_carry >> 16,
                 high - low_carry, (high_carry >> 16) - uint(high < low_carry));
}

// sum / count, rounded half up, for a sum below 2^16.  Exact: the error of the float32 quotient is corrected.
uvec3 rounded(uvec3 sum, uint count) {
    uvec3 whole = sum + count / 2u, quotient = uvec3(vec3(whole) * (1.0 / float(count)));
    ivec3 rest = ivec3(whole - quotient * count);
    return quotient + uvec3(greaterThanEqual(rest, ivec3(count))) - uvec3(lessThan(rest, ivec3(0)));
}
#endif

uvec4 in_srgb(uvec3 mean, uint count) {
    if (soft.w > 0.0)
        for (int c = 0; c < 3; ++c) mean[c] = texelFetch(to_srgb, ivec2(mean[c] & 63u, mean[c] >> 6), 0).x;
    return uvec4(mean, count);
}

// Mean colour of a pixel in sRGB levels, rounded half up, and the sum of weights; zero where there is no point.
// Valid for pixels without carries.
uvec4 mean_colour(uint pixel) {
#ifdef SUMS_COPIED
    uvec2 words = texelFetch(copied_sums, ivec2(pixel % size.x, pixel / size.x), 0).xy;
    uvec2 first = uvec2(words.x & 0xFFFFu, words.x >> 16), second = uvec2(words.y & 0xFFFFu, words.y >> 16);
#else
    uvec2 first = low_parts(2u * pixel), second = low_parts(2u * pixel + 1u);
#endif
    uvec3 mean = rounded(uvec3(first, second.x), max(second.y, 1u));
    return in_srgb(min(mean, uvec3(4095u)), second.y);
}

// The same for a pixel with carries; false for any other.  Resets the carries for the next frame.
bool carried_colour(uint pixel, out uvec4 mean) {
    uvec4 carry = uvec4(carries[4u * pixel], carries[4u * pixel + 1u], carries[4u * pixel + 2u], carries[4u * pixel + 3u]);
    if (pixel == 0u) carried_groups[0] = 0u;
    if (carry == uvec4(0u)) return false;
    for (uint i = 0u; i < 4u; ++i) carries[4u * pixel + i] = 0u;
    uvec4 first = with_carries(2u * pixel, carry.x, carry.y), second = with_carries(2u * pixel + 1u, carry.z, carry.w);
    uint count = second.z;
    mean = in_srgb(uvec3(divided(first.y, first.x, count), divided(first.w, first.z, count),
                         divided(second.y, second.x, count)), count);
    return true;
}
