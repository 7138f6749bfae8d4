// The input of the fill, measured pixels of the filtered picture (BASE), and the weights that let gaps be filled from the
// background (BACKGROUND).

#ifdef BACKGROUND
uniform vec2 wider;  // factor and offset of the level that the four samples belong to

// Weight of each of four samples: 0 where its depth feature is clearly nearer than the farthest one and its surface's point
// spacing is clearly smaller than the level's pixels.
vec4 background(vec4 features) {
    float farthest = max(max(features.x, features.y), max(features.z, features.w));
    precise vec4 nearer = clamp((farthest - features) * NEARER_SCALE - NEARER_START, 0.0, 1.0);
    precise vec4 wide = clamp(features * wider.x + wider.y, 0.0, 1.0);
    precise vec4 counts = 1.0 - nearer * wide;
    return counts;
}
#endif

#ifdef BASE
uniform sampler2D raw;
uniform sampler2D depth;
uniform sampler2D mask;       // the keep-mask, or the confidence of each pixel
uniform float feature_scale;  // 1 / (focal length in pixels x point spacing)
#ifdef NOISE
uniform sampler2D noise;      // 0 where nothing is measured
#endif

// The pixel's weight, 0 where nothing is measured; v its colour 0..1 and depth feature, times the weight.
float measured(ivec2 at, out vec4 v) {
    v = vec4(0.0);
    float weight = texelFetch(mask, at, 0).x;
    if (weight == 0.0) return 0.0;
    float feature = log2(texelFetch(depth, at, 0).x * feature_scale) * FEATURE_SCALE;
    v = vec4(texelFetch(raw, at, 0).xyz, clamp(feature, -FEATURE_LIMIT, FEATURE_LIMIT));
    if (weight < 1.0) v *= weight;
    return weight;
}
#endif
