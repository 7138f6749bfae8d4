// The marks of points for the compute rasteriser.  Host side: viewer/render/raster/mark_pages.py.
#ifdef MARKED
layout(std430, binding = MARKS_BINDING) readonly buffer Marks { uint marked[]; };  // a byte for each point
uint mark_of(uint index) { return mark_entry(marked[index >> 2] >> 8u * (index & 3u) & 255u); }
#else
uint mark_of(uint index) { return 0u; }
#endif
