// One view, or two split at a pixel column, over a vertical gradient, in a part of the canvas.  Views are premultiplied by
// alpha.  A view whose size differs from the picture's (a lower internal resolution) is interpolated.
// Textures have row 0 on top, the canvas row 0 at the bottom.  Integers, so that the host can repeat it exactly.

uniform sampler2D left;
uniform sampler2D right;
uniform ivec2 origin;       // lower left corner of the picture on the canvas
uniform ivec2 size;         // of the picture, pixels
uniform int column;         // first pixel of the right side
uniform ivec3 top, bottom;  // the background's sRGB at the two edges, 0..255; equal where it is plain

out vec4 colour;

vec4 view(sampler2D side, ivec2 texel) {
    if (textureSize(side, 0) == size) return texelFetch(side, texel, 0);
    return textureLod(side, (vec2(texel) + 0.5) / vec2(size), 0.0);
}

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy) - origin;
    ivec2 texel = ivec2(at.x, size.y - 1 - at.y);
    vec4 value = at.x < column ? view(left, texel) : view(right, texel);
    ivec4 pixel = ivec4(round(value * 255.0));
    int place = 2 * texel.y + 1, whole = 2 * size.y;  // in halves of a row, from the top
    ivec3 background = (top * (whole - place) + bottom * place + size.y) / whole;
    ivec3 over = min(pixel.rgb + (background * (255 - pixel.a) + 127) / 255, 255);
    colour = vec4(vec3(over) / 255.0, 1.0);
}
