// Compute rasteriser, first pass: nearest depth of each pixel, as inverted bits so that an empty pixel is 0.
#include "common_project.glsl"
#include "common_batches.glsl"
#ifdef EDITED
#include "common_attributes.glsl"
#include "common_edits.glsl"
#include "common_marks.glsl"
#endif

layout(local_size_x = LANES) in;
layout(std430, binding = KEYS_BINDING) buffer Keys { uint keys[]; };

void main() {
    uvec2 mine = batches_here();
    for (uint number = mine.x; number < mine.y; ++number) {
        uvec4 batch = batches[number];
        vec3 cell = cells[batch.z].xyz;
        for (uint i = gl_LocalInvocationID.x; i < batch.y; i += LANES) {
            uint index = batch.x + i;
            Projected p = project(uvec2(points[3u * index], points[3u * index + 1u]), cell);
            if (!p.inside) continue;
#ifdef EDITED
            if (dropped(p.at, points[3u * index + 1u], points[3u * index + 2u] >> 24, mark_of(index))) continue;
#endif
            uint pixel = (p.pixel.y - size.z) * size.x + p.pixel.x;
            uint key = ~floatBitsToUint(p.z);
            if (keys[pixel] < key) atomicMax(keys[pixel], key);  // the plain read first saves most atomics
        }
    }
}
