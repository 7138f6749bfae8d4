"""Registration: the rigid transformation that brings one scan to its place beside another, by pairs, by ICP, to a floor."""
