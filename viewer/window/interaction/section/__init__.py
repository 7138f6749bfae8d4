"""The Section tool."""
