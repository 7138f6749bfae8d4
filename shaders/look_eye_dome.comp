// Eye-dome lighting (Boucheny 2009): pixels behind their neighbours are darkened.
// Reference implementation: viewer.picture.look.eye_dome.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform sampler2D picture;
uniform sampler2D depth;  // view-space z, +inf where there is no point
uniform float gain;
uniform int radius;       // pixels to the eight neighbours
layout(rgba8, binding = 0) uniform writeonly image2D result;

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy), size = imageSize(result);
    if (any(greaterThanEqual(at, size))) return;
    vec4 pixel = texelFetch(picture, at, 0);
    float z = texelFetch(depth, at, 0).x, total = 0.0;
    if (!isinf(z)) {
        for (int y = -1; y <= 1; ++y)
            for (int x = -1; x <= 1; ++x) {
                ivec2 there = at + ivec2(x, y) * radius;
                if ((x == 0 && y == 0) || any(lessThan(there, ivec2(0))) || any(greaterThanEqual(there, size))) continue;
                float other = texelFetch(depth, there, 0).x;
                if (!isinf(other)) total += max(0.0, log2(z / other));
            }
        pixel.rgb *= exp(-gain * total / 8.0);
    }
    imageStore(result, at, pixel);
}
