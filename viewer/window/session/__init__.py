"""The state of a window without the window: scene, work, loading, saving, recovery."""
