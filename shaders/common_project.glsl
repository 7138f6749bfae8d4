// Packed point -> pixel and depth, by the same expressions in both rasterisers and in model/reference/projection.py.
// View frame: x right, y down, z forward, file units.  Nothing may be fused or reordered: hence precise.

layout(std140, binding = FRAME_BINDING) uniform Frame {
    vec4 axis_x;   // xyz: view x per step along the cell's x, y, z; w of axis_x: 1 where black points have no colour
    vec4 axis_y;   // w: of an orthographic camera, 1 / the depth at which lens gives its scale; 0: a pinhole
    vec4 axis_z;
    vec4 lens;     // fx, fy, cx, cy in pixels
    uvec4 size;    // width, height of the picture; first row and row count of this band
    vec4 soft;     // 1 + relative tolerance, absolute tolerance, pixel rounding (0 or 0.5), linear light (0 or 1)
};

struct Projected {
    uvec2 pixel;
    vec3 at;  // view frame
    float z;
    bool inside;
};

Projected project(uvec2 words, vec3 cell) {
    vec3 q = vec3(float(words.x & 0xFFFFu), float(words.x >> 16), float(words.y & 0xFFFFu));
    precise float x = cell.x + ((axis_x.x * q.x + axis_x.y * q.y) + axis_x.z * q.z);
    precise float y = cell.y + ((axis_y.x * q.x + axis_y.y * q.y) + axis_y.z * q.z);
    precise float z = cell.z + ((axis_z.x * q.x + axis_z.y * q.y) + axis_z.z * q.z);
    precise float inverse = axis_y.w > 0.0 ? axis_y.w : 1.0 / z;
    precise float u = lens.x * (x * inverse) + lens.z;
    precise float v = lens.y * (y * inverse) + lens.w;
    u += soft.z;
    v += soft.z;
    Projected p;
    p.z = z;
    p.at = vec3(x, y, z);
    // NaN and infinity fail every comparison, so that a point in the camera plane is outside.
    p.inside = z > 0.0 && u >= 0.0 && u < float(size.x) && v >= 0.0 && v < float(size.y);
    p.pixel = p.inside ? uvec2(u, v) : uvec2(0u);
    p.inside = p.inside && p.pixel.y >= size.z && p.pixel.y - size.z < size.w;
    return p;
}

// Soft z-buffer: the depth behind which a point is not averaged into its pixel.
float soft_limit(float nearest) {
    precise float relative = nearest * soft.x;
    precise float absolute = nearest + soft.y;
    return max(relative, absolute);
}
