"""What a person works on: the document and its history, projects, measurements.  No window, no OpenGL."""
