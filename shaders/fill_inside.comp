// Which blocks are surrounded by measured ones, here or at a coarser level: in small blocks of each two consecutive
// neighbours at least one holds a point, in larger ones (STRICT) all eight, so that outlines stay tight.  What is not
// surrounded at any level is void and stays empty.  Twin: model/pull_push.py, surrounded.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
layout(r8, binding = 0) uniform writeonly image2D inside;
uniform sampler2D weight;
#ifndef TOP
uniform sampler2D coarse_inside;
#endif

float held(ivec2 at, ivec2 extent) {
    if (any(lessThan(at, ivec2(0))) || any(greaterThanEqual(at, extent))) return 0.0;
    return texelFetch(weight, at, 0).x;
}

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy), extent = textureSize(weight, 0);
    if (any(greaterThanEqual(at, extent))) return;
    float e = held(at + ivec2(1, 0), extent), se = held(at + ivec2(1, 1), extent), s = held(at + ivec2(0, 1), extent);
    float sw = held(at + ivec2(-1, 1), extent), w = held(at + ivec2(-1, 0), extent), nw = held(at + ivec2(-1, -1), extent);
    float n = held(at + ivec2(0, -1), extent), ne = held(at + ivec2(1, -1), extent);
#ifdef STRICT
    float least = min(min(min(e, se), min(s, sw)), min(min(w, nw), min(n, ne)));
#else
    float least = min(min(min(max(e, se), max(se, s)), min(max(s, sw), max(sw, w))),
                      min(min(max(w, nw), max(nw, n)), min(max(n, ne), max(ne, e))));
#endif
    float value = least > 0.0 ? 1.0 : 0.0;
#ifndef TOP
    value = max(value, texelFetch(coarse_inside, at >> 1, 0).x);
#endif
    imageStore(inside, at, vec4(value));
}
