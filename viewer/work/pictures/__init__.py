"""Pictures as a project shows them, and what a PNG says of how it was made."""
