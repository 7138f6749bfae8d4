// Copies the network's output, four half-precision channels a pixel (RGB and coverage, 0..1), into the texture that is shown.
// COPIED: the output was copied to a texture.
// PHOTOGRAPHS: their colours come over it, as far as they count, which COUNTED writes.  Reference implementation of this:
// model/reference/photo_colours.py, over_network.
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
#include "common_blocks.glsl"
#include "common_contradicted.glsl"
uniform sampler2D photographs;  // their colours and share
uniform sampler2D grid;         // of photo_spacing.comp
#endif
#ifdef COUNTED
layout(r8, binding = 1) uniform writeonly image2D counted;
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
#ifdef PHOTOGRAPHS
    vec4 photo = texelFetch(photographs, at, 0);
    float share = 0.0;  // its border is softened: ragged ones are seen
    if (photo.a > 0.0)
        for (int k = 0; k < 9; ++k)
            share += texelFetch(photographs, clamp(at + ivec2(k % 3, k / 3) - 1, ivec2(0), extent - 1), 0).a / 9.0;
    float sparse = clamp((between_blocks(grid, at).x - DENSE_FROM) / (DENSE_TO - DENSE_FROM), 0.0, 1.0);
    vec3 mean = mean_apart(at), seen = clamp(photo.rgb - mean * (1.0 - sparse), 0.0, 1.0), apart = abs(seen - rgba.rgb);
    float agree = clamp((APART_TO - 255.0 * max(apart.r, max(apart.g, apart.b))) / (APART_TO - APART_FROM), 0.0, 1.0);
    float counts = share * mix(OVER_FROM, OVER_TO, sparse) * mix(agree, 1.0, sparse);
    counts *= uncontradicted(mean);
    rgba.rgb = mix(rgba.rgb, seen, counts);
#endif
#ifdef COUNTED
    imageStore(counted, at, vec4(counts));
#endif
    imageStore(neural, at, vec4(rgba.rgb * alpha, alpha));
}
