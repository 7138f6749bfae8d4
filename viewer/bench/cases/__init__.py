"""One module a bench."""
