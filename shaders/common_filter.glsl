// The depth filter's decision for one block.  Reference implementation: model/reference/depth_filter.py, _hiding_threshold.
//
// A block of the pyramid is a vec2: nearest inverse depth (x); and, in one number (y), how many level-0 pixels lie on its surface,
// times CHILDREN, plus how many of its four children hold them.  CHILDREN is above the 36 of nine blocks, so sums stay apart, and
// float keeps them exactly as far as they are compared.

float narrower(float best, float a, float b) {
    return a > 0.0 && b > 0.0 ? min(best, abs(a - b) * 0.5) : best;
}

// A surface in every direction: of each two consecutive neighbours, from east over south, the nearer one, and of those the
// farthest.  0 where there is none.
float front_around(float e, float se, float s, float sw, float w, float nw, float n, float ne) {
    return min(min(min(max(e, se), max(se, s)), min(max(s, sw), max(sw, w))),
               min(min(max(w, nw), max(nw, n)), min(max(n, ne), max(ne, e))));
}

float slope_around(float e, float se, float s, float sw, float w, float nw, float n, float ne) {
    float across = narrower(narrower(narrower(EMPTY, e, w), ne, nw), se, sw);
    float along = narrower(narrower(narrower(EMPTY, s, n), sw, nw), se, ne);
    return across + along;
}

// The inverse depth below which a point is hidden behind a surface.  tolerance: 1 - tolerance x strength, slope share x strength.
float behind(float front, float slope, vec2 tolerance) {
    precise float share = slope * tolerance.y;
    precise float value = front * tolerance.x - share;
    return max(value, 0.0);
}

// The inverse depth below which a pixel of a block is hidden by the blocks around it; 0 where none is.
// tolerance: as above; the third is the first where points are clumped.
float hiding_threshold(vec2 own, vec2 e, vec2 se, vec2 s, vec2 sw, vec2 w, vec2 nw, vec2 n, vec2 ne, vec3 tolerance) {
    float front = front_around(e.x, se.x, s.x, sw.x, w.x, nw.x, n.x, ne.x);
    if (front <= 0.0) return 0.0;
    precise float limit = front * SAME_SURFACE_FACTOR;
    bool shared_surface = own.x >= limit;
    float total = shared_surface ? own.y : 0.0;
    total += e.x >= limit ? e.y : 0.0;
    total += se.x >= limit ? se.y : 0.0;
    total += s.x >= limit ? s.y : 0.0;
    total += sw.x >= limit ? sw.y : 0.0;
    total += w.x >= limit ? w.y : 0.0;
    total += nw.x >= limit ? nw.y : 0.0;
    total += n.x >= limit ? n.y : 0.0;
    total += ne.x >= limit ? ne.y : 0.0;
    float count = floor(total * (1.0 / CHILDREN)), held = total - count * CHILDREN;
    if (count >= (shared_surface ? SUPPORT_LIMIT_SHARED : SUPPORT_LIMIT)) return 0.0;
    bool clumped = 56.0 * count >= CLUMPED * (56.0 * held + held * held);  // whole numbers and a quarter: exact
    float slope = slope_around(e.x, se.x, s.x, sw.x, w.x, nw.x, n.x, ne.x);
    return behind(front, slope, vec2(clumped ? tolerance.z : tolerance.x, tolerance.y));
}
