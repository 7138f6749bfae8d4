"""Streams packed points from the cache to the GPU: chunk reading, prefetch, residency and eviction; no OpenGL here."""
