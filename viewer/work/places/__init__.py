"""Places in a scan: where one stands, walks and looks, and the measured point under a pixel."""
