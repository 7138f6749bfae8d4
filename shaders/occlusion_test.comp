// Occlusion culling: is a cell hidden?  In each texel of the pyramid that the cell's rectangle covers, the highest inverse depth
// that the box of its points can have there is compared with the lowest inverse depth that hides.
// Flags: 1 could be visible, 2 drawn, and from bit ROUND_SHIFT on the round in which the cell is tested, 0 for those drawn without a
// test.  In the last round what is drawn is tested again, since more hides by then.
#include "common_project.glsl"
#include "common_occlusion.glsl"

layout(local_size_x = CELLS_A_GROUP) in;
layout(std430, binding = CELLS_BINDING) readonly buffer Cells { vec4 cells[]; };  // view position of step (0,0,0), box of points
layout(std430, binding = FLAGS_BINDING) buffer Flags { uint flags[]; };
layout(std430, binding = COMMANDS_BINDING) buffer Commands { uint commands[]; };
uniform uint tally;  // index in the commands of the count of hidden cells
uniform uint cell_count;
uniform uint number;  // of the round

// Three sides of a box, x lowest, as viewer/render/culling/cull_kernels.py packs them.
vec3 box_sides(uint code) {
    const uint mask = (1u << SHARE_BITS) - 1u;
    return vec3(code & mask, code >> SHARE_BITS & mask, code >> 2 * SHARE_BITS & mask);
}

// Upper bound of the inverse depth in a box, from its two sides across one axis.  All its points have axis.p >= low; with p = z ray
// this is 1/z <= axis.ray / low, affine in the picture (and likewise with high, where the camera is on that side).  xy: slope per
// pixel; z: value at pixel (0, 0), raised by the gain within ``half_side`` pixels and by the rounding of float32.
// A camera between the two sides gives no bound.
vec3 bound_of_sides(vec3 axis, vec3 corner, float first_step, float last_step, float half_side) {
    float begin = dot(axis, corner), scale = dot(axis, axis);
    float low = begin + scale * first_step, high = begin + scale * last_step;
    float slack = 1e-5 * (dot(abs(axis), abs(corner)) + scale * last_step);
    if (low <= slack && high >= -slack) return vec3(0.0, 0.0, 1e30);
    vec3 side = axis / (low > slack ? low - slack : high + slack);
    vec2 slope = side.xy / lens.xy;
    float size_of_terms = abs(side.z) + dot(abs(slope), abs(lens.zw) + vec2(size.xy));
    return vec3(slope, side.z - dot(slope, lens.zw + soft.z) + half_side * (abs(slope.x) + abs(slope.y)) + 1e-6 * size_of_terms);
}

bool hidden(vec4 cell) {
    const float steps = float(65536 >> SHARE_BITS);  // steps in one of the parts that a cell's side is divided into
    vec3 first_step = steps * box_sides(uint(cell.w));
    vec3 last_step = steps * (box_sides(uint(cell.w) >> 3 * SHARE_BITS) + 1.0) - 1.0;
    vec2 low = vec2(1e30), high = vec2(-1e30);
    float nearest = 1e30;
    for (uint corner = 0u; corner < 8u; ++corner) {
        vec3 q = mix(first_step, last_step, bvec3(corner & 1u, corner & 2u, corner & 4u));
        vec3 p = cell.xyz + vec3(dot(axis_x.xyz, q), dot(axis_y.xyz, q), dot(axis_z.xyz, q));
        if (!(p.z > 0.0)) return false;  // crosses the camera's plane
        vec2 at = lens.xy * (p.xy / p.z) + lens.zw + soft.z;
        low = min(low, at);
        high = max(high, at);
        nearest = min(nearest, p.z);
    }
    vec2 extent = vec2(size.xy);
    low = clamp(floor(low - 1.0), vec2(-1.0), extent);  // a pixel for rounding
    high = clamp(floor(high + 1.0), vec2(-1.0), extent);
    if (any(lessThan(high, vec2(0.0))) || any(greaterThanEqual(low, extent))) return true;  // outside the picture
    uvec2 first = uvec2(max(low, vec2(0.0))) >> BLOCK_SHIFT, last = uvec2(min(high, extent - 1.0)) >> BLOCK_SHIFT;
    uint level = 0u;
    while (any(greaterThan((last >> level) - (first >> level), uvec2(TEXELS - 1u)))) ++level;
    uvec4 there = levels[level];
    first >>= level;
    last >>= level;
    float side = float(1u << (level + uint(BLOCK_SHIFT))), half_side = 0.5 * side + 1.0;  // a pixel for rounding
    vec3 by_x = bound_of_sides(vec3(axis_x.x, axis_y.x, axis_z.x), cell.xyz, first_step.x, last_step.x, half_side);
    vec3 by_y = bound_of_sides(vec3(axis_x.y, axis_y.y, axis_z.y), cell.xyz, first_step.y, last_step.y, half_side);
    vec3 by_z = bound_of_sides(vec3(axis_x.z, axis_y.z, axis_z.z), cell.xyz, first_step.z, last_step.z, half_side);
    bool shows = false;
    for (uint y = first.y; y <= last.y; ++y)
        for (uint x = first.x; x <= last.x; ++x) {
            vec3 middle = vec3((vec2(x, y) + 0.5) * side, 1.0);
            float highest = min(min(1.0 / nearest, dot(by_x, middle)), min(dot(by_y, middle), dot(by_z, middle)));
            bool behind = pyramid[there.z + y * there.x + x] > highest * (1.0 + 1e-5);  // a margin above float32 rounding
            shows = shows || (highest > 0.0 && !behind);
        }
    return !shows;
}

void main() {
    uint cell = gl_WorkGroupID.y * gl_NumWorkGroups.x * CELLS_A_GROUP + gl_GlobalInvocationID.x;
    if (cell >= cell_count) return;
    uint flag = flags[cell];
    bool now = flag >> ROUND_SHIFT == number;
    if (!now && (number != uint(LAST) || (flag & 2u) == 0u)) return;
    bool away = hidden(cells[cell]);
    flags[cell] = flag & ~1u | (away ? 0u : now ? 3u : 1u);
    if (away && now) atomicAdd(commands[tally], 1u);
}
