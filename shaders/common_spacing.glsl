// Pixels between measured pixels at a pixel, bilinear between blocks of photo_spacing.comp.
// Reference implementation: model/reference/photo_colours.py, spacing_in_pixels.
uniform sampler2D grid;

float spacing_at(ivec2 at) {
    vec2 place = (vec2(at) + 0.5) / float(BLOCK) - 0.5;
    ivec2 low = ivec2(floor(place)), last = textureSize(grid, 0) - 1;
    vec2 t = place - vec2(low);
    ivec2 a = clamp(low, ivec2(0), last), b = clamp(low + 1, ivec2(0), last);
    float upper = mix(texelFetch(grid, a, 0).x, texelFetch(grid, ivec2(b.x, a.y), 0).x, t.x);
    return mix(upper, mix(texelFetch(grid, ivec2(a.x, b.y), 0).x, texelFetch(grid, b, 0).x, t.x), t.y);
}
