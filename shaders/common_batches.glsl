// The draw list of the compute rasteriser.  A workgroup draws ROWS batches; all points of a batch are in one cell, and LANES
// invocations share them.
// THREADS: software OpenGL gives each of its threads one contiguous stretch of the workgroups, and some stretches have much more to
// do than others.  Here they are interleaved, STRETCH at a time, so that neighbours in the picture stay together.
// APPENDED: the list that occlusion_append.comp made of one page; its command holds its length.

layout(std430, binding = POINTS_BINDING) readonly buffer Points { uint points[]; };
layout(std430, binding = BATCHES_BINDING) readonly buffer Batches { uvec4 batches[]; };  // first, count, cell, -
layout(std430, binding = CELLS_BINDING) readonly buffer Cells { vec4 cells[]; };         // view position of step (0,0,0)
#ifdef APPENDED
layout(std430, binding = COMMANDS_BINDING) readonly buffer Commands { uvec4 commands[]; };  // groups x, y, z, batches
uniform uint page;
#else
uniform uint batch_count;
#endif
uniform uint first_batch;

// The batches of this workgroup: from the first up to the second.
uvec2 batches_here() {
    uint number = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
#ifdef THREADS
    const uint threads = uint(THREADS), stretch = uint(STRETCH);
    uint rounds = gl_NumWorkGroups.x * gl_NumWorkGroups.y / (threads * stretch), dealt = number / stretch;
    if (dealt < rounds * threads) number = (dealt % rounds * threads + dealt / rounds) * stretch + number % stretch;
#endif
#ifdef APPENDED
    uint batch_count = commands[page].w;
#endif
    return first_batch + min(uvec2(number, number + 1u) * uint(ROWS), uvec2(batch_count));
}
