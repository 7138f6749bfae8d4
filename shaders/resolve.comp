// Sums and nearest depths of one band -> the raw picture and its depth (view-space z, +inf where empty).
// SUMS_COPIED: sums and keys were copied to textures, which software OpenGL reads faster.
// CARRIED: only pixels whose sums overflowed, which are few in most pictures.
#include "common_project.glsl"
#include "common_sums.glsl"

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
#if defined(FROM_KEYS) && defined(SUMS_COPIED)
uniform usampler2D copied_keys;
#elif defined(FROM_KEYS)
layout(std430, binding = KEYS_BINDING) readonly buffer Keys { uint keys[]; };
#else
uniform sampler2D nearest;
#endif
layout(rgba8, binding = 0) uniform writeonly image2D colour;
layout(r32f, binding = 1) uniform writeonly image2D depth;
layout(r8, binding = 2) uniform writeonly image2D weight;

void main() {
    uvec2 pixel = gl_GlobalInvocationID.xy;
    if (pixel.x >= size.x || pixel.y >= size.w) return;
    uint index = pixel.y * size.x + pixel.x;
#ifdef CARRIED
    uvec4 mean;
    if (!carried_colour(index, mean)) return;
#else
    uvec4 mean = mean_colour(index);
#endif
    ivec2 at = ivec2(pixel.x, pixel.y + size.z);
    imageStore(colour, at, vec4(vec3(mean.rgb) / 255.0, mean.w > 0u ? 1.0 : 0.0));
    imageStore(weight, at, vec4(float(min(mean.w, uint(MAX_AVERAGED))) / 255.0));
#ifndef CARRIED
#ifdef FROM_KEYS
#ifdef SUMS_COPIED
    uint key = texelFetch(copied_keys, ivec2(pixel), 0).x;
#else
    uint key = keys[index];
#endif
    float z = key == 0u ? uintBitsToFloat(0x7F800000u) : uintBitsToFloat(~key);
#else
    float z = texelFetch(nearest, ivec2(pixel), 0).x;
#endif
    imageStore(depth, at, vec4(z));
#endif
}
