// How far photographs differ, on average around a pixel, from what they come over, and whether that contradicts them: 0 where it
// does, to 1.  After common_blocks.glsl.  Reference implementation: model/reference/photo_colours.py, CONTRADICTED.
uniform sampler2D block_apart;  // of photo_apart.comp

vec3 mean_apart(ivec2 at) {
    vec4 around = between_blocks(block_apart, at);
    return around.rgb / max(around.a, 1e-6);
}

float uncontradicted(vec3 mean) {
    float apart = 255.0 * max(abs(mean.r), max(abs(mean.g), abs(mean.b)));
    return clamp((CONTRADICTED_TO - apart) / (CONTRADICTED_TO - CONTRADICTED_FROM), 0.0, 1.0);
}
