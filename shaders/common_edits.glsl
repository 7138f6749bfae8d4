// Edits of points: hidden stations and clips remove them, the look colours them by an attribute, dimmed ghosts are faded.
// Included only in programs of pictures with edits (EDITED).  Host side: viewer/render/raster/edit_block.py.

layout(std140, binding = EDITS_BINDING) uniform Edits {
    vec4 clip_rows[3 * MOST_CLIPS];  // xyz: view frame, w: offset; a point is inside where all three rows give -1..1
    uvec4 clip_groups;   // x: how many clips; bits of the clips: y: boxes that keep, z: slabs that keep, w: that remove
    uvec4 hidden[2];     // a bit for each station
    vec4 upward;         // xyz: the axis of BY_ALONG in the view frame; w: the eye along it, above the ramp's lower end
    vec4 ramp;           // x: lower end, y: 255 / (upper - lower end); zw: of a scan with classes, lowest intensity and step
    uvec4 mode;          // x: what colours points, BY_... (viewer.picture.colour_modes.PointValue); y: 1 where points have classes; z: 1 + station to be dimmed; w: 1 where classes are hidden
    uvec4 table[64];     // 256 colours, r | g << 8 | b << 16
    uvec4 hidden_classes[2];  // a bit for each class
    uvec4 marks[64];     // what each mark of a point says: its class (MARK_HAS_CLASS), MARK_SELECTED, MARK_DROPPED
};

// What the mark of a point says.  code: 0 to 255.
uint mark_entry(uint code) { return marks[code >> 2][code & 3u]; }

uint marked_class(uint second, uint mark) {
    return (mark & uint(MARK_HAS_CLASS)) != 0u ? mark & 255u : point_class(second, mode.y != 0u);
}

bool dropped(vec3 at, uint second, uint station, uint mark) {
    if ((mark & uint(MARK_DROPPED)) != 0u) return true;
    if (mode.w != 0u) {
        uint code = marked_class(second, mark);
        if ((hidden_classes[code >> 7][(code >> 5) & 3u] >> (code & 31u) & 1u) != 0u) return true;
    }
    if ((hidden[station >> 7][(station >> 5) & 3u] >> (station & 31u) & 1u) != 0u) return true;
    uint inside = 0u;
    for (uint i = 0u; i < clip_groups.x; ++i) {
        vec3 place = vec3(dot(clip_rows[3u * i].xyz, at) + clip_rows[3u * i].w,
                          dot(clip_rows[3u * i + 1u].xyz, at) + clip_rows[3u * i + 1u].w,
                          dot(clip_rows[3u * i + 2u].xyz, at) + clip_rows[3u * i + 2u].w);
        if (all(lessThanEqual(abs(place), vec3(1.0)))) inside |= 1u << i;
    }
    return (clip_groups.y != 0u && (inside & clip_groups.y) == 0u) || (clip_groups.z != 0u && (inside & clip_groups.z) == 0u)
        || (inside & clip_groups.w) != 0u;
}

// Reference implementation, to the byte: viewer.render.raster.edit_block.dimmed.
uint dimmed(uint third) {
    uint grey = (77u * (third & 255u) + 150u * (third >> 8 & 255u) + 29u * (third >> 16 & 255u)) >> 8;
    uint level = uint(DIMMED_LEAST) + (grey >> DIMMED_SHIFT);
    return (third & 0xFF000000u) | level * 0x010101u;
}

// The point's third word with the colour of its attribute; unchanged where points are coloured by RGB and not dimmed.
uint by_attribute(uint second, uint third, vec3 at, uint mark) {
    if (mode.z == 1u + (third >> 24)) return dimmed(third);
    if (mode.x == uint(BY_COLOUR)) return third;
    uint row;
    if (mode.x == uint(BY_CLASS)) row = marked_class(second, mark);
    else if (mode.x == uint(BY_STATION)) row = third >> 24;
    else {
        // In the order of viewer/render/raster/point_loops.py, which must choose the same colour.
        precise float along = ((upward.x * at.x + upward.y * at.y) + upward.z * at.z) + upward.w;
        precise float far = sqrt((at.x * at.x + at.y * at.y) + at.z * at.z);
        float above = mode.x == uint(BY_INTENSITY) ? point_intensity(second, mode.y != 0u, ramp.zw) - ramp.x
                    : mode.x == uint(BY_ALONG) ? along
                    : far - ramp.x;  // BY_DISTANCE
        precise float level = above * ramp.y;
        row = uint(clamp(level, 0.0, 255.0) + 0.5);
    }
    return (third & 0xFF000000u) | table[row >> 2][row & 3u];
}

// The same, tinted where the point is selected.  Reference implementation, to the byte: edit_block.tinted.
uint recoloured(uint second, uint third, vec3 at, uint mark) {
    uint word = by_attribute(second, third, at, mark);
    if ((mark & uint(MARK_SELECTED)) == 0u) return word;
    return (word & 0xFF000000u) | ((word >> 1 & 0x7F7F7Fu) + uint(SELECTED_HALF));
}
