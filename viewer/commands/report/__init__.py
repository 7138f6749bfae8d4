"""The report of a project: its viewpoints, notes and measurements with pictures as a PDF; its notes as BCF or CSV."""
