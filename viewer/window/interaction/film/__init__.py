"""The Film tool."""
