"""Infrastructure shared by ``model`` and ``viewer``: atomic writes, threads, signals, memory, compiled loops, colour curves."""
