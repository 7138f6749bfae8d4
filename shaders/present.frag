// One view, or two split at a pixel column, over a plain background.  Views come premultiplied: their colour is already as
// much of a pixel's as is covered.
// Textures have row 0 on top, the canvas row 0 at the bottom.  Whole numbers, so that the host can repeat it exactly.

uniform sampler2D left;
uniform sampler2D right;
uniform int column;        // first pixel of the right side
uniform ivec3 background;  // 0..255

out vec4 colour;

void main() {
    ivec2 size = textureSize(left, 0);
    ivec2 at = ivec2(gl_FragCoord.xy);
    ivec2 texel = ivec2(at.x, size.y - 1 - at.y);
    vec4 value = at.x < column ? texelFetch(left, texel, 0) : texelFetch(right, texel, 0);
    ivec4 pixel = ivec4(round(value * 255.0));
    ivec3 over = min(pixel.rgb + (background * (255 - pixel.a) + 127) / 255, 255);
    colour = vec4(vec3(over) / 255.0, 1.0);
}
