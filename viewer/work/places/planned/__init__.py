"""Places of a publication, planned over a scan: on its floors, over a landscape, around a thing."""
