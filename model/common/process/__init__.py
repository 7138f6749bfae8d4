"""The process: signals, threads, memory, what native code prints."""
