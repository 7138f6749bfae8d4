// No depth filter: every pixel that holds a point is kept.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform sampler2D level;  // view-space z, +inf where empty
uniform sampler2D raw;
layout(r8, binding = 0) uniform writeonly image2D mask;
layout(rgba8, binding = 1) uniform writeonly image2D filtered;

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, textureSize(level, 0)))) return;
    bool keep = !isinf(texelFetch(level, at, 0).x);
    vec4 colour = texelFetch(raw, at, 0);
    keep = keep && colour.a > 0.0;  // points without colour occlude and are not shown
    imageStore(mask, at, vec4(keep ? 1.0 : 0.0));
    imageStore(filtered, at, keep ? colour : vec4(0.0));
}
