"""Notes: texts at places, with a status, a link and a picture; their files, and how they are drawn over pictures."""
