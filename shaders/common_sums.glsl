// Whole-number colour sums: exact and independent of order, where floats break past 2^24.

layout(std430, binding = SUMS_BINDING) buffer Sums { uint sums[]; };  // red, green, blue, count

void add_colour(uint pixel, uint word) {
    atomicAdd(sums[4u * pixel], word & 0xFFu);
    atomicAdd(sums[4u * pixel + 1u], (word >> 8) & 0xFFu);
    atomicAdd(sums[4u * pixel + 2u], (word >> 16) & 0xFFu);
    atomicAdd(sums[4u * pixel + 3u], 1u);
}
