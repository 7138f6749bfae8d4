"""What a PNG says of how its picture was made, whether pictures are finished, photographs in a view.  No OpenGL."""
