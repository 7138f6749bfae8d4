"""One writer a format of an export: whole records copied, or columns."""
