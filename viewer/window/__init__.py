"""The interactive window: glfw and imgui around the same ``render`` that makes every other picture.

    app (window, loop) -> painter (Renderer, canvas) -> session (state) -> flight, choice, picture, loading, notices
    hands (events in)     panels, hud, dialogs (drawn from the session's state, over the painter's picture)

Arrows are imports.  Nothing here decides a pixel of the scan's picture: what the window shows at rest is what
``pointglass render`` writes for the same camera, size and settings.  Only ``app``, ``hands``, ``theme``, ``panels``, ``hud``
and ``dialogs`` need a window; ``painter`` and ``present`` need OpenGL; the session and its parts need neither.
"""
