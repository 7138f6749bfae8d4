"""The Notes tool: notes at measured points, and their files."""
