// Whether photographs differ, on average around a pixel, from what they come over: 0 where they do, to 1.  After
// common_blocks.glsl.  Reference implementation: model/reference/photo_colours.py, CONTRADICTED.
uniform sampler2D block_apart;  // of photo_apart.comp

float uncontradicted(ivec2 at) {
    vec4 around = between_blocks(block_apart, at);
    float apart = 255.0 * max(abs(around.r), max(abs(around.g), abs(around.b))) / max(around.a, 1e-6);
    return clamp((CONTRADICTED_TO - apart) / (CONTRADICTED_TO - CONTRADICTED_FROM), 0.0, 1.0);
}
