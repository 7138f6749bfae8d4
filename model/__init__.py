"""pointglass's network and everything that trains and judges it.  Never imports ``viewer``."""
