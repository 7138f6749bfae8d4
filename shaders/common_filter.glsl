// The depth filter's decision for one block.  Reference implementation: model/depth_filter.py, _hiding_threshold.

float narrower(float best, float a, float b) {
    return a > 0.0 && b > 0.0 ? min(best, abs(a - b) * 0.5) : best;
}

// The inverse depth below which a pixel of a block is hidden by the blocks around it; 0 where none is.
// Arguments: near (x) and support (y) of the block and of its neighbours, from east over south.
// tolerance: 1 - tolerance x strength, slope share x strength.
float hiding_threshold(vec2 own, vec2 e, vec2 se, vec2 s, vec2 sw, vec2 w, vec2 nw, vec2 n, vec2 ne, vec2 tolerance) {
    // A surface in every direction: of each two consecutive neighbours the nearer one, and of those the farthest.
    float front = min(min(min(max(e.x, se.x), max(se.x, s.x)), min(max(s.x, sw.x), max(sw.x, w.x))),
                      min(min(max(w.x, nw.x), max(nw.x, n.x)), min(max(n.x, ne.x), max(ne.x, e.x))));
    if (front <= 0.0) return 0.0;
    float across = narrower(narrower(narrower(EMPTY, e.x, w.x), ne.x, nw.x), se.x, sw.x);
    float along = narrower(narrower(narrower(EMPTY, s.x, n.x), sw.x, nw.x), se.x, ne.x);
    precise float limit = front * SAME_SURFACE_FACTOR;
    bool shared_surface = own.x >= limit;
    float count = shared_surface ? own.y : 0.0;
    count += e.x >= limit ? e.y : 0.0;
    count += se.x >= limit ? se.y : 0.0;
    count += s.x >= limit ? s.y : 0.0;
    count += sw.x >= limit ? sw.y : 0.0;
    count += w.x >= limit ? w.y : 0.0;
    count += nw.x >= limit ? nw.y : 0.0;
    count += n.x >= limit ? n.y : 0.0;
    count += ne.x >= limit ? ne.y : 0.0;
    precise float slope = (across + along) * tolerance.y;
    precise float value = front * tolerance.x - slope;
    bool sparse = count < SUPPORT_LIMIT || (shared_surface && count < SUPPORT_LIMIT_SHARED);
    return sparse ? max(value, 0.0) : 0.0;
}
