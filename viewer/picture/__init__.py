"""What a picture is, as values: camera, settings, colours and tones, clips, background.  No OpenGL, no scan, no window."""
