// WEIGHTED: the weight of a point, by the angle between the viewing ray and its scanner's ray.  View frame, the eye at its origin.
// Nothing may be fused or reordered: hence precise.  Reference implementation: model/reference/station_weights.py.

#ifdef WEIGHTED
layout(std140, binding = STATIONS_BINDING) uniform Stations { vec4 stations[256]; };  // view position; w: 1 where known

uint point_weight(vec3 at, uint word) {
    vec4 station = stations[word >> 24];
    if (station.w < 0.5) return uint(UNPLACED);
    vec3 beam = station.xyz - at;
    precise float eye = (at.x * at.x + at.y * at.y) + at.z * at.z;
    precise float scanner = (beam.x * beam.x + beam.y * beam.y) + beam.z * beam.z;
    precise float along = (beam.x * at.x + beam.y * at.y) + beam.z * at.z;
    precise float turned = 0.5 - 0.5 * ((along / eye) * abs(along / scanner));
    precise float square = turned * turned;
    precise float value = ((2.0 * float(HEAVIEST)) * (square * square)) * (scanner / (scanner + eye)) + 0.5;
    return value >= 1.0 ? uint(min(value, float(HEAVIEST) + 0.5)) : 1u;  // NaN is not at least 1
}
#else
uint point_weight(vec3 at, uint word) { return 1u; }
#endif
