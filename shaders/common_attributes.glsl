// The 16 attribute bits of a packed point (viewer/preprocess/point_attributes.py), above the z coordinate in its second word:
// intensity, or, in a scan with classes, the class in the upper and the quantised intensity in the lower 8 bits.

uint point_class(uint second, bool has_classes) { return has_classes ? second >> 24 : 0u; }

// In the file's values.  quantised: of a scan with classes, lowest intensity and step between stored values.
float point_intensity(uint second, bool has_classes, vec2 quantised) {
    uint bits = second >> 16;
    return has_classes ? roundEven(float(bits & 0xFFu) * quantised.y + quantised.x) : float(bits);
}
