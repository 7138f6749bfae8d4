"""The picture in the window: the renderer of the scene, the canvas, and photographs over a view."""
