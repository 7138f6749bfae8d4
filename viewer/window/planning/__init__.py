"""Which picture is to be made next: settings chosen, layout of the window, and what a moving picture leaves out.  No OpenGL."""
