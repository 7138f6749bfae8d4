"""How the camera moves: keys, mouse, gamepad, glides, walking, where it starts."""
