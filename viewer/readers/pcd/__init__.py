"""PCD, text, binary and compressed."""
