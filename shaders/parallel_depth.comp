// Of an orthographic picture, the depth that passes made for pinholes take: differences of depth become the ratios that a pinhole
// has which sees the same scale.  Reference implementation: model/reference/parallel_depth.py.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform sampler2D depth;  // view-space z, +inf where empty
uniform vec3 scale;       // depth at which the picture has its scale; middle of the scene's depths; exponent a unit of depth
layout(r32f, binding = 0) uniform writeonly image2D made;

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, imageSize(made)))) return;
    float z = texelFetch(depth, at, 0).x;
    imageStore(made, at, vec4(isinf(z) ? z : scale.x * exp2(clamp((z - scale.y) * scale.z, -MOST_DOUBLINGS, MOST_DOUBLINGS))));
}
