// Point primitives, second pass: colour sums of the points within the soft z-buffer's tolerance.
#include "common_project.glsl"
#include "common_sums.glsl"

uniform sampler2D nearest;

flat in float point_z;
flat in uint point_colour;
flat in uint point_counts;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    if (point_z > soft_limit(texelFetch(nearest, pixel, 0).x)) return;
    add_colour(uint(pixel.y) * size.x + uint(pixel.x), point_colour, point_counts);
}
