// Sums over blocks of BLOCK x BLOCK pixels of the photographs' colours less those that they come over, 0..1, times their share;
// and of the share.  Reference implementation: model/reference/photo_colours.py, over_filled and over_network.
// FILLED: they come over the filled picture, else over the network's.
// COPIED: the network's output was copied to a texture, as in network_output.comp.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
#ifdef FILLED
uniform sampler2D filled;
#elif defined(COPIED)
uniform usampler2D copied;
#else
layout(std430, binding = NETWORK_BINDING) readonly buffer Output { uvec2 pixels[]; };
#endif
uniform sampler2D photographs;  // their colours and share
layout(rgba32f, binding = 0) uniform writeonly image2D apart;

void main() {
    ivec2 block = ivec2(gl_GlobalInvocationID.xy), size = textureSize(photographs, 0);
    if (any(greaterThanEqual(block, imageSize(apart)))) return;
    ivec2 first = block * BLOCK, last = min(first + BLOCK, size);
    vec4 sum = vec4(0.0);
    for (int y = first.y; y < last.y; ++y)
        for (int x = first.x; x < last.x; ++x) {
            vec4 photo = texelFetch(photographs, ivec2(x, y), 0);
#ifdef FILLED
            vec3 made = texelFetch(filled, ivec2(x, y), 0).rgb;
#else
#ifdef COPIED
            uvec2 words = texelFetch(copied, ivec2(x, y), 0).xy;
#else
            uvec2 words = pixels[uint(y) * uint(size.x) + uint(x)];
#endif
            vec3 made = clamp(vec3(unpackHalf2x16(words.x), unpackHalf2x16(words.y).x), 0.0, 1.0);
#endif
            sum += photo.a * vec4(photo.rgb - made, 1.0);
        }
    imageStore(apart, block, sum);
}
