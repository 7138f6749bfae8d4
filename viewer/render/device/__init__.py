"""The OpenGL context, what it can do, and what is made with it: shaders, buffers, read-back."""
