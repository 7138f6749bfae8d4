// One view over a vertical gradient, in a part of the canvas.  The view is premultiplied by alpha.  INTERPOLATED: its size
// differs from the picture's (a lower internal resolution).
// Textures have row 0 on top, the canvas row 0 at the bottom.  Integers, so that the host can repeat it exactly.

uniform sampler2D view;
uniform sampler2D rows;     // the background's colour of each row: one pixel wide, as high as the picture
uniform ivec2 origin;       // lower left corner of the picture on the canvas
uniform ivec2 size;         // of the picture, pixels

out vec4 colour;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy) - origin;
    ivec2 texel = ivec2(at.x, size.y - 1 - at.y);
#ifdef INTERPOLATED
    vec4 value = textureLod(view, (vec2(texel) + 0.5) / vec2(size), 0.0);
#else
    vec4 value = texelFetch(view, texel, 0);
#endif
    ivec4 pixel = ivec4(round(value * 255.0));
    ivec3 background = ivec3(round(texelFetch(rows, ivec2(0, texel.y), 0).rgb * 255.0));
    ivec3 product = background * (255 - pixel.a) + 127;
    ivec3 behind = (product + 1 + (product >> 8)) >> 8;  // product / 255, exact below 65536; a division is slow in software
    colour = vec4(vec3(min(pixel.rgb + behind, 255)) / 255.0, 1.0);
}
