// The pyramid of what hides: inverse depths below which nothing shows, 0 where anything would.  Level 0 has blocks of
// 2^BLOCK_SHIFT pixels a side, each level above the lowest of 2x2.  All levels in one buffer.

layout(std430, binding = PYRAMID_BINDING) buffer Pyramid { float pyramid[]; };

uniform uvec4 levels[LEVELS];  // columns, rows, where it begins
