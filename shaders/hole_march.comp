// Ray march: what the ray of each square of RAY_BLOCK pixels meets in the lattice of occupied blocks
// (viewer/render/culling/occupancy.py): nothing, occupied blocks (TOUCHED), or one in the middle of a surface (IN_SURFACE).  An empty block
// stores the distance to the nearest occupied one, in blocks, so that most of a ray is skipped in a few steps.
// Reference implementation: model/reference/ray_march.py.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
layout(r8ui, binding = 0) uniform writeonly uimage2D met;
uniform usampler3D codes;
uniform mat3 to_world;  // columns: the view frame's x, y, z in world axes
uniform vec4 lens;      // fx, fy, cx, cy in pixels
uniform vec3 eye;       // in blocks from the lattice's corner
uniform float parallel; // of an orthographic camera, the depth in blocks at which lens gives its scale; 0: a pinhole
uniform float sparse;   // view-space z in blocks, up to which the middle of a surface decides

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, imageSize(met)))) return;
    precise vec2 place = (vec2(at) + 0.5) * float(RAY_BLOCK);
    precise vec2 image = (place - lens.zw) / lens.xy;
    precise vec3 across = to_world[0] * image.x + to_world[1] * image.y;
    precise vec3 turned = across + to_world[2];
    precise vec3 from = eye;
    if (parallel > 0.0) {
        turned = to_world[2];
        from = eye + across * parallel;
    }
    float size = max(abs(turned.x), max(abs(turned.y), abs(turned.z)));
    precise vec3 ray = turned / size;
    precise float until = sparse * size;
    ivec3 last = textureSize(codes, 0) - 1;
    vec3 away = mix(ray, vec3(1e-12), lessThan(abs(ray), vec3(1e-12)));  // parallel to a side: meets it far away
    precise vec3 a = (-from) / away, b = (vec3(last + 1) - from) / away;
    vec3 enters = min(a, b), leaves = max(a, b);
    precise float t = max(max(enters.x, max(enters.y, enters.z)), START);
    float end = min(leaves.x, min(leaves.y, leaves.z));
    precise float since = START_IN_SURFACE + (START_IN_SURFACE - START) * min(ray.z, 0.0);
    uint found = uint(NOTHING);
    for (int looks = 0; looks < MAX_STEPS && t < end; ++looks) {
        precise vec3 spot = from + t * ray;
        uint code = texelFetch(codes, clamp(ivec3(floor(spot)), ivec3(0), last), 0).x;
        bool held = code == uint(INNER) || code == uint(LOOSE);
        if (code == uint(INNER) && t >= since && t < until) {
            found = uint(IN_SURFACE);
            break;
        }
        if (held) found = uint(TOUCHED);
        precise float next = t + (held ? STEP : max(float(code) - 1.0, STEP));
        t = next;
        if (found == uint(TOUCHED) && t >= until) break;
    }
    imageStore(met, at, uvec4(found));
}
