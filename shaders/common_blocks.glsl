// Values of blocks of BLOCK x BLOCK pixels at a pixel: bilinear between their middles.
// Reference implementation: model/reference/photo_colours.py, between_blocks.
vec4 between_blocks(sampler2D grid, ivec2 at) {
    vec2 place = (vec2(at) + 0.5) / float(BLOCK) - 0.5;
    ivec2 low = ivec2(floor(place)), last = textureSize(grid, 0) - 1;
    vec2 t = place - vec2(low);
    ivec2 a = clamp(low, ivec2(0), last), b = clamp(low + 1, ivec2(0), last);
    vec4 upper = mix(texelFetch(grid, a, 0), texelFetch(grid, ivec2(b.x, a.y), 0), t.x);
    return mix(upper, mix(texelFetch(grid, ivec2(a.x, b.y), 0), texelFetch(grid, b, 0), t.x), t.y);
}
