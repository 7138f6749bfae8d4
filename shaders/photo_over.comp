// Lays the photographs' colours over the filled picture.  Reference implementation: model/reference/photo_colours.py, over_filled;
// viewer/render/photographs/photo_over_loops.py does the same on the processor.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
#include "common_blocks.glsl"
#include "common_contradicted.glsl"
uniform sampler2D photographs;  // their colours and share
layout(rgba8, binding = 0) uniform image2D filled;
layout(r8, binding = 1) uniform writeonly image2D share;

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, imageSize(filled)))) return;
    vec4 photo = texelFetch(photographs, at, 0);
    float part = photo.a > 0.0 ? photo.a * uncontradicted(mean_apart(at)) : 0.0;
    imageStore(share, at, vec4(part));
    if (part <= 0.0) return;
    vec4 old = imageLoad(filled, at);
    imageStore(filled, at, vec4(mix(old.rgb, photo.rgb, part), old.a));
}
