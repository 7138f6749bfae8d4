// Self-test of `pointglass doctor`: do compute shaders and buffers work?
// MODE 0: mixes integer words in place.  MODE 1: writes a known pattern of half floats.  MODE 2: reads half floats as integers.

layout(local_size_x = 64) in;

layout(std430, binding = IN_BINDING) buffer Source { uint source[]; };
layout(std430, binding = OUT_BINDING) buffer Target { uint target[]; };

uniform uint count;  // words of source

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i >= count) {
        return;
    }
#if MODE == 0
    target[i] = source[i] * 1664525u + (i ^ 1013904223u);
#elif MODE == 1
    source[i] = packHalf2x16(vec2((2u * i) % 1021u, (2u * i + 1u) % 1021u));
#else
    vec2 pair = unpackHalf2x16(source[i]);
    target[2u * i] = uint(pair.x);
    target[2u * i + 1u] = uint(pair.y);
#endif
}
