// Affinity of inverse depth of each pixel, 0..1, before the least of 3 x 3 is taken: where the surface is certain.
// Reference implementation: model/reference/photo_colours.py, certainty.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform sampler2D depth;  // view-space z of the filled picture, 0 where it is not opaque
layout(r32f, binding = 0) uniform writeonly image2D certain;

float inverse_at(ivec2 at, ivec2 size) {
    float z = texelFetch(depth, clamp(at, ivec2(0), size - 1), 0).x;
    return z > 0.0 ? 1.0 / z : 0.0;
}

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy), size = imageSize(certain);
    if (any(greaterThanEqual(at, size))) return;
    float z = texelFetch(depth, at, 0).x, sure = 0.0;
    if (z > 0.0) {
        float middle = 2.0 / z, bend = 0.0;
        for (int k = 0; k < 4; ++k) {
            ivec2 aside = BEND_AT * ivec2(k == 1 ? 0 : 1, k == 0 ? 0 : k == 3 ? -1 : 1);
            bend = max(bend, abs(inverse_at(at - aside, size) + inverse_at(at + aside, size) - middle));
        }
        sure = clamp(2.0 - bend * z / BEND, 0.0, 1.0);
    }
    imageStore(certain, at, vec4(sure));
}
