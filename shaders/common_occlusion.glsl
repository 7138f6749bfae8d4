// The occlusion pyramid: inverse depths below which no point shows; 0 where any would.  Level 0 has blocks of 2^BLOCK_SHIFT
// pixels a side; each coarser level has the minimum of 2x2.  All levels are in one buffer.

layout(std430, binding = PYRAMID_BINDING) buffer Pyramid { float pyramid[]; };

uniform uvec4 levels[LEVELS];  // columns, rows, first element
