"""Choosing files: the dialog inside the window, the system's own where there is one, and the folders that are remembered.

``file_dialogs.FileDialogs`` is what the rest of the window uses.
"""
