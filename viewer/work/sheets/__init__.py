"""Sheets of plans, elevations and sections: paper and its layout, lines traced along what is cut, drawings as DXF."""
