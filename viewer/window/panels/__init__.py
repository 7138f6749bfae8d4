"""The panels, drawn from the state of the session."""
