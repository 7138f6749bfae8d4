"""The window itself: events in, pictures out, and what actions do."""
