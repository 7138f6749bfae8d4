// Noise level of each measured pixel, an input of the network: the standard deviation of its mean colour.
// The noise of a single point, by place (the nearest voxel of a lattice) and brightness (a curve, linear between knots), is divided
// by the square root of how many points were averaged.  0 where nothing is kept.  Reference implementation: model/reference/noise_level.py.

layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
uniform sampler2D raw;
uniform sampler2D depth;   // view-space z
uniform sampler2D weight;  // sum of the pixel's point weights, MAX_AVERAGED at most, / 255
uniform sampler2D mask;    // keep-mask or confidence
uniform sampler3D sigma;   // standard deviation of a single point where the curve is 1
uniform vec4 lens;         // fx, fy, cx, cy in pixels
uniform float parallel;    // of an orthographic camera, the depth at which lens gives its scale; 0: a pinhole
uniform mat3 to_lattice;   // view space to voxels
uniform vec3 eye;          // camera position, in voxels
uniform float curve[KNOTS];
uniform float scale;
uniform float point_weight;  // the weight that counts as one point
layout(r16f, binding = 0) uniform writeonly image2D level;

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, imageSize(level)))) return;
    float sigma_of_mean = 0.0;
    if (texelFetch(mask, at, 0).x > 0.0) {
        float z = texelFetch(depth, at, 0).x;
        vec3 view = vec3((vec2(at) + 0.5 - lens.zw) / lens.xy * (parallel > 0.0 ? parallel : z), z);
        ivec3 voxel = ivec3(clamp(floor(eye + to_lattice * view), vec3(0.0), vec3(textureSize(sigma, 0) - 1)));
        float knot = dot(texelFetch(raw, at, 0).rgb, vec3(LUMA_R, LUMA_G, LUMA_B)) * float(KNOTS - 1);
        int below = min(int(knot), KNOTS - 2);
        float factor = mix(curve[below], curve[below + 1], knot - float(below));
        float points = max(floor(texelFetch(weight, at, 0).x * 255.0 + 0.5) / point_weight, 1.0);
        sigma_of_mean = scale * factor * texelFetch(sigma, voxel, 0).x * inversesqrt(points);
    }
    imageStore(level, at, vec4(sigma_of_mean));
}
