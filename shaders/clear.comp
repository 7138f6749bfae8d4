// Words of a buffer to zero, in turn with what else the GPU does.  To write them from the host would be to wait for it.
layout(local_size_x = CLEAR_LANES) in;
layout(std430, binding = KEYS_BINDING) writeonly buffer Words { uint words[]; };
uniform uint count;

void main() {
    uint stride = gl_NumWorkGroups.x * uint(CLEAR_LANES);
    for (uint i = gl_GlobalInvocationID.x; i < count; i += stride) words[i] = 0u;
}
