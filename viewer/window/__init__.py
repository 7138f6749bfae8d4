"""The interactive window: glfw and imgui around the same ``render`` that makes every other picture.

    app (window, loop) -> viewport (Renderer, canvas) -> session (state) -> flight, view_settings, picture_plan, loading
    input (events in)     panels, hud, dialogs (drawn from the session's state, over the viewport's picture)

Arrows are imports.  Nothing here decides a pixel of the scan's picture: what the window shows at rest is what
``pointglass render`` writes for the same camera, size and settings.  Only ``app``, ``input``, ``theme``, ``panels``, ``hud``
and ``dialogs`` need a window; ``viewport`` and ``present`` need OpenGL; the session and its parts need neither.
"""
