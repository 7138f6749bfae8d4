// Depth filters of the paper and of NPBG++, towards coarser levels: 2x2 min-pooling of z; EMPTY where there is no point.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
layout(r32f, binding = 0) uniform writeonly image2D coarse;
uniform sampler2D fine;

float child(ivec2 at, ivec2 extent) {
    if (any(greaterThanEqual(at, extent))) return EMPTY;
    float z = texelFetch(fine, at, 0).x;
    return isinf(z) ? EMPTY : z;
}

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy), extent = textureSize(fine, 0);
    if (any(greaterThanEqual(at, imageSize(coarse)))) return;
    imageStore(coarse, at, vec4(min(min(child(2 * at, extent), child(2 * at + ivec2(1, 0), extent)),
                                    min(child(2 * at + ivec2(0, 1), extent), child(2 * at + ivec2(1, 1), extent)))));
}
