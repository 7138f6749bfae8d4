// Point primitives, first pass: nearest depth through MIN blending.

flat in float point_z;
layout(location = 0) out float depth;

void main() {
    depth = point_z;
}
