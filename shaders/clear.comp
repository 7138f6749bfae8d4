// Zeroes a buffer in the order of the other GPU work.  Writing zeros from the host would wait for that work.
layout(local_size_x = CLEAR_LANES) in;
layout(std430, binding = KEYS_BINDING) writeonly buffer Words { uint words[]; };
uniform uint count;

void main() {
    uint stride = gl_NumWorkGroups.x * uint(CLEAR_LANES);
    for (uint i = gl_GlobalInvocationID.x; i < count; i += stride) words[i] = 0u;
}
