"""Infrastructure shared by ``model`` and ``viewer``: atomic writes, signals, processors, memory, compiled loops, colour."""
