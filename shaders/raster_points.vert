// Point-primitive rasteriser: emits the centre of the pixel that project() chooses, so that the hardware's rounding cannot choose
// another one.
#include "common_project.glsl"
#include "common_stations.glsl"
#ifdef EDITED
#include "common_attributes.glsl"
#include "common_edits.glsl"
#endif

in uvec3 in_point;
in vec3 in_cell;
#ifdef MARKED
in uint in_mark;
#endif

flat out float point_z;
flat out uint point_colour;
flat out uint point_counts;

void main() {
    Projected p = project(in_point.xy, in_cell);
#ifdef EDITED
#ifdef MARKED
    uint mark = mark_entry(in_mark);
#else
    uint mark = 0u;
#endif
    p.inside = p.inside && !dropped(p.at, in_point.y, in_point.z >> 24, mark);
#endif
    vec2 centre = (vec2(p.pixel.x, p.pixel.y - size.z) + 0.5) / vec2(size.x, size.w);
    gl_Position = p.inside ? vec4(2.0 * centre - 1.0, 0.0, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
    gl_PointSize = 1.0;
    point_z = p.z;
#ifdef EDITED
    point_colour = recoloured(in_point.y, in_point.z, p.at, mark);
#else
    point_colour = in_point.z;
#endif
    point_counts = point_weight(p.at, in_point.z);
}
