"""What a picture is, as values: camera, settings, views, edits, background, and their description (spec).  No OpenGL."""
