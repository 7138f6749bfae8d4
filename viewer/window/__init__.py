"""The interactive window: glfw and imgui around the same ``render`` that makes every other picture.

    shell (window, loop, events in) -> panels, interaction (tools) -> saving -> viewport (renderer, canvas)
    -> session (state: scene, work, loading) -> planning (the picture to make) -> flight, file_dialog -> kit

Arrows are imports; tests/unit/program/test_architecture.py holds them.  Nothing here decides a pixel of the scan's picture:
what the window shows at rest is what ``pointglass render`` writes for the same camera, size and settings.  Only ``shell``,
``panels``, ``file_dialog`` and what ``kit`` draws need a window; ``viewport`` needs OpenGL; ``session``, ``planning`` and
``flight`` need neither.
"""
