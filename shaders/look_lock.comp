// Measured pixels from the filtered view, all others from the picture.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform sampler2D picture;
uniform sampler2D measured;  // the filtered view
uniform sampler2D mask;
layout(rgba8, binding = 0) uniform writeonly image2D result;

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, imageSize(result)))) return;
    bool kept = texelFetch(mask, at, 0).x > 0.5;
    imageStore(result, at, kept ? texelFetch(measured, at, 0) : texelFetch(picture, at, 0));
}
