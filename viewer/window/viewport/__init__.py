"""The picture in the window: which one is wanted, which is shown, and how it is refined."""
