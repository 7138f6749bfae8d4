"""Where photographs without a pose were taken: features of photographs matched with those of rendered views."""
