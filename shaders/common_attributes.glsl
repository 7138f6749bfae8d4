// The attributes of a packed point (viewer/grid/scene.py): its second word holds 16 bits of intensity above the z coordinate.

uint point_intensity(uint second, uint third) { return second >> 16; }
uint point_class(uint second, uint third) { return 0u; }
