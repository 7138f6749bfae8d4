// Occlusion culling: the batches of one page and round whose cells were found visible go to a second list, with the indirect command
// that draws it.
layout(local_size_x = CELLS_A_GROUP) in;
layout(std430, binding = BATCHES_BINDING) readonly buffer Batches { uvec4 batches[]; };
layout(std430, binding = APPENDED_BINDING) writeonly buffer Appended { uvec4 appended[]; };
layout(std430, binding = FLAGS_BINDING) readonly buffer Flags { uint flags[]; };
layout(std430, binding = COMMANDS_BINDING) buffer Commands { uint commands[]; };  // groups x, y, z, batches of each list
uniform uint first_batch;
uniform uint batch_count;
uniform uint list;   // of a page and round
uniform uint tally;  // index in the commands of the count of hidden cells; the count of hidden points follows

void main() {
    uint number = gl_WorkGroupID.y * gl_NumWorkGroups.x * CELLS_A_GROUP + gl_GlobalInvocationID.x;
    if (number >= batch_count) return;
    uvec4 batch = batches[first_batch + number];
    if ((flags[batch.z] & 2u) == 0u) {
        atomicAdd(commands[tally + 1u], batch.y);
        return;
    }
    uint place = atomicAdd(commands[4u * list + 3u], 1u);
    appended[first_batch + place] = batch;
    uint group = place / uint(ROWS);
    atomicMax(commands[4u * list], min(group + 1u, uint(MAX_GROUPS)));
    atomicMax(commands[4u * list + 1u], group / uint(MAX_GROUPS) + 1u);
}
