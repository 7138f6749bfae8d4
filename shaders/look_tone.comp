// Exposure, white balance and brightness: one table of 256 levels a channel, on colours divided by their alpha.
// Reference implementation, to the byte: viewer.picture.look.toned.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform sampler2D picture;
uniform usampler2D curves;  // 256 x 1
layout(rgba8, binding = 0) uniform writeonly image2D result;

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, imageSize(result)))) return;
    ivec4 pixel = ivec4(round(texelFetch(picture, at, 0) * 255.0));
    ivec3 straight = min((pixel.rgb * 255 + pixel.a / 2) / max(pixel.a, 1), 255), colour;
    for (int c = 0; c < 3; ++c) colour[c] = int(texelFetch(curves, ivec2(straight[c], 0), 0)[c]);
    imageStore(result, at, vec4((colour * pixel.a + 127) / 255, pixel.a) / 255.0);
}
