"""What a person keeps: F12, F9, stills rendered beside the window."""
