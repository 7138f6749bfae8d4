"""The interactive window: glfw and imgui around the same ``render`` that makes every other picture.

    app (window, loop) -> session (state) -> Renderer -> present (texture to screen) -> panels (drawn from state)

Nothing here decides a pixel of the scan's picture: what the window shows at rest is what ``pointglass render`` writes
for the same camera, size and settings.  Only ``app``, ``theme``, ``panels``, ``hud`` and ``dialogs`` need a window.
"""
