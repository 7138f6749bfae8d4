"""The window itself: events in, pictures out, the actions and the table of controls."""
