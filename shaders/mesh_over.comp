// A picture of points with meshes by depth: what is nearer covers what is farther, in integers.
// Reference implementation, to the byte: composed in viewer/render/meshes/mesh_layers.py.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform sampler2D picture;     // premultiplied
uniform sampler2D depth;       // of the picture, view-space z; 0 and +inf: unknown, behind everything
uniform sampler2D mask;        // pixels whose depth counts
uniform int masked;            // 0: all pixels
uniform sampler2D opaque;      // nearest opaque mesh, premultiplied
uniform sampler2D opaque_depth;
uniform sampler2D clear;       // nearest mesh that is not opaque
uniform sampler2D clear_depth;
layout(rgba8, binding = 0) uniform writeonly image2D result;

#define FAR uintBitsToFloat(0x7F800000u)  // +inf; before GLSL 4.5 no constant expression

ivec4 bytes(sampler2D source, ivec2 at) {
    return ivec4(round(texelFetch(source, at, 0) * 255.0));
}

ivec4 over(ivec4 top, ivec4 below) {
    return top + (below * (255 - top.a) + 127) / 255;
}

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, imageSize(result)))) return;
    ivec4 points = bytes(picture, at), solid = bytes(opaque, at), glass = bytes(clear, at);
    float points_z = texelFetch(depth, at, 0).x;
    if (!(points_z > 0.0) || (masked != 0 && texelFetch(mask, at, 0).x < 0.5)) points_z = FAR;
    float solid_z = texelFetch(opaque_depth, at, 0).x, glass_z = texelFetch(clear_depth, at, 0).x;
    bool solid_first = solid_z < points_z;
    ivec4 pair = solid_first ? over(solid, points) : over(points, solid);
    ivec4 made = pair;
    if (glass.a > 0) {
        if (glass_z < min(points_z, solid_z)) made = over(glass, pair);
        else if (glass_z < max(points_z, solid_z)) made = solid_first ? over(over(solid, glass), points)
                                                                      : over(over(points, glass), solid);
        else made = over(pair, glass);
    }
    imageStore(result, at, vec4(made) / 255.0);
}
