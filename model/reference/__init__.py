"""What the shaders must equal: plain implementations in torch and NumPy, and the constants that both share."""
