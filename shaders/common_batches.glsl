// The draw list of the compute rasteriser: one workgroup a batch, all points of a batch in one cell.

layout(std430, binding = POINTS_BINDING) readonly buffer Points { uint points[]; };
layout(std430, binding = BATCHES_BINDING) readonly buffer Batches { uvec4 batches[]; };  // first, count, cell, -
layout(std430, binding = CELLS_BINDING) readonly buffer Cells { vec4 cells[]; };         // view position of step (0,0,0)

uniform uint first_batch;
uniform uint batch_count;

// The point this invocation draws; false where there is none.
bool batch_point(out uint index, out vec3 cell) {
    uint number = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    if (number >= batch_count) return false;
    uvec4 batch = batches[first_batch + number];
    index = batch.x + gl_LocalInvocationID.x;
    cell = cells[batch.z].xyz;
    return gl_LocalInvocationID.x < batch.y;
}
