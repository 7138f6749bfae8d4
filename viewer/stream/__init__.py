"""Packed points on their way from the cache to the GPU: reading chunks, residency and eviction, prefetch; no OpenGL here."""
