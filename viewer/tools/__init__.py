"""Work on scenes and pictures that needs no window: camera files, export, the demo."""
