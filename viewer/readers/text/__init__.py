"""Points as text: XYZ and its relatives, PTS, PTX, ESRI grids."""
