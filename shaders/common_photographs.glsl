// Constants and records of photographs; viewer/render/photographs/photo_pool.py packs them.  Reference implementation:
// model/reference/photo_colours.py.
layout(std430, binding = PHOTOS_BINDING) readonly buffer Photos { uint words[]; };
layout(std430, binding = PHOTO_RECORDS_BINDING) readonly buffer Records { uint records[]; };

float number(int photo, int at) { return uintBitsToFloat(records[photo * RECORD + at]); }
int whole(int photo, int at) { return int(records[photo * RECORD + NUMBERS + at]); }
vec4 lens_of(int photo) {
    return vec4(number(photo, LENS), number(photo, LENS + 1), number(photo, LENS + 2), number(photo, LENS + 3));
}
vec3 three(int photo, int at) { return vec3(number(photo, at), number(photo, at + 1), number(photo, at + 2)); }

// A place in the view frame in the photograph's.
vec3 in_photograph(int photo, vec3 place) {
    return vec3(dot(three(photo, TURN), place), dot(three(photo, TURN + 3), place), dot(three(photo, TURN + 6), place))
        + three(photo, SHIFT);
}

// From the photograph's place to a place in the view frame.
vec3 from_photograph(int photo, vec3 place) {
    vec3 shift = three(photo, SHIFT);
    return place + shift.x * three(photo, TURN) + shift.y * three(photo, TURN + 3) + shift.z * three(photo, TURN + 6);
}
