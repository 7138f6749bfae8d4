// Compute rasteriser, second pass: colour sums and counts of the points within the soft z-buffer's tolerance.
#include "common_project.glsl"
#include "common_batches.glsl"
#include "common_stations.glsl"
#include "common_sums.glsl"
#ifdef EDITED
#include "common_attributes.glsl"
#include "common_edits.glsl"
#include "common_marks.glsl"
#endif

layout(local_size_x = LANES) in;
layout(std430, binding = KEYS_BINDING) readonly buffer Keys { uint keys[]; };

void main() {
    uvec2 mine = batches_here();
    for (uint number = mine.x; number < mine.y; ++number) {
        uvec4 batch = batches[number];
        vec3 cell = cells[batch.z].xyz;
        for (uint i = gl_LocalInvocationID.x; i < batch.y; i += LANES) {
            uint index = batch.x + i;
            Projected p = project(uvec2(points[3u * index], points[3u * index + 1u]), cell);
            if (!p.inside) continue;
            uint pixel = (p.pixel.y - size.z) * size.x + p.pixel.x;
            if (p.z > soft_limit(uintBitsToFloat(~keys[pixel]))) continue;
            uint word = points[3u * index + 2u];
#ifdef EDITED
            uint second = points[3u * index + 1u], mark = mark_of(index);
            if (dropped(p.at, second, word >> 24, mark)) continue;
            word = recoloured(second, word, p.at, mark);
#endif
            add_colour(pixel, word, point_weight(p.at, word));
        }
    }
}
