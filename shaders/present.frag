// One view, or two split at a pixel column, over a vertical gradient.  Views come premultiplied: their colour is already as
// much of a pixel's as is covered.
// Textures have row 0 on top, the canvas row 0 at the bottom.  Whole numbers, so that the host can repeat it exactly.

uniform sampler2D left;
uniform sampler2D right;
uniform int column;        // first pixel of the right side
uniform ivec3 top, bottom;  // the background's sRGB at the two edges, 0..255; equal where it is plain

out vec4 colour;

void main() {
    ivec2 size = textureSize(left, 0);
    ivec2 at = ivec2(gl_FragCoord.xy);
    ivec2 texel = ivec2(at.x, size.y - 1 - at.y);
    vec4 value = at.x < column ? texelFetch(left, texel, 0) : texelFetch(right, texel, 0);
    ivec4 pixel = ivec4(round(value * 255.0));
    int place = 2 * texel.y + 1, whole = 2 * size.y;  // in halves of a row, from the top
    ivec3 background = (top * (whole - place) + bottom * place + size.y) / whole;
    ivec3 over = min(pixel.rgb + (background * (255 - pixel.a) + 127) / 255, 255);
    colour = vec4(vec3(over) / 255.0, 1.0);
}
