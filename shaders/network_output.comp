// Copies the network's output, four half-precision channels a pixel (RGB and coverage, 0..1), into the texture that is shown.
// COPIED: the output was copied to a texture.
// PHOTOGRAPHS: their share of the filled picture is kept.
// BOUNDED: the filled picture's alpha is an upper bound: background stays background.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
#ifdef COPIED
uniform usampler2D copied;  // software OpenGL reads it in half the time of a storage block
#else
layout(std430, binding = NETWORK_BINDING) readonly buffer Output { uvec2 pixels[]; };
#endif
layout(rgba8, binding = 0) uniform writeonly image2D neural;
#ifdef BOUNDED
uniform sampler2D filled;
#endif
#ifdef PHOTOGRAPHS
uniform sampler2D photographs;
#endif

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy), extent = imageSize(neural);
    if (any(greaterThanEqual(at, extent))) return;
#ifdef COPIED
    uvec2 words = texelFetch(copied, at, 0).xy;
#else
    uvec2 words = pixels[uint(at.y) * uint(extent.x) + uint(at.x)];
#endif
    vec4 rgba = clamp(vec4(unpackHalf2x16(words.x), unpackHalf2x16(words.y)), 0.0, 1.0);
    float alpha = rgba.w;
#ifdef BOUNDED
    alpha *= texelFetch(filled, at, 0).w;
#endif
    vec3 colour = rgba.rgb * alpha;
#ifdef PHOTOGRAPHS
    colour = mix(colour, texelFetch(filled, at, 0).rgb, texelFetch(photographs, at, 0).x);
#endif
    imageStore(neural, at, vec4(colour, alpha));
}
