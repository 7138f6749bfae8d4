// Provenance tint: the picture's brightness in the colours of measured, repainted, filled and background pixels.
// Reference implementation, to the byte: viewer/picture/provenance_tint.py.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform sampler2D picture;
uniform sampler2D measured;  // the filtered view
uniform sampler2D mask;
uniform int kind;            // 0: raw, all pixels are measured; 1: filtered or filled; 2: neural, measured pixels are repainted
uniform ivec3 colours[4];    // by provenance: background, measured, repainted, filled
#ifdef PHOTOGRAPHS
uniform sampler2D photographs;  // their share of each pixel
uniform ivec3 photographed;
uniform bool keeps_measured;  // measured pixels are shown as measured
#endif
layout(rgba8, binding = 0) uniform writeonly image2D result;

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, imageSize(result)))) return;
    ivec4 pixel = ivec4(round(texelFetch(picture, at, 0) * 255.0));
    bool kept = kind == 0 || texelFetch(mask, at, 0).x > 0.5;
    ivec3 colour = colours[3];
    if (pixel.a == 0) colour = colours[0];
#ifdef PHOTOGRAPHS
    else if (!(kept && keeps_measured) && texelFetch(photographs, at, 0).x > 0.5) colour = photographed;
#endif
    else if (kept && kind != 2) colour = colours[1];
    else if (kept) {
        ivec3 change = abs(pixel.rgb - ivec3(round(texelFetch(measured, at, 0).rgb * 255.0)));
        int amount = min(max(max(change.r, change.g), change.b), FULLY_REPAINTED);
        colour = (colours[1] * (FULLY_REPAINTED - amount) + colours[2] * amount + FULLY_REPAINTED / 2) / FULLY_REPAINTED;
    }
    int grey = (54 * pixel.r + 183 * pixel.g + 19 * pixel.b) >> 8;
    imageStore(result, at, vec4((ivec3(grey * (256 - TINT)) + colour * TINT + 128) >> 8, 255) / 255.0);
}
