"""The Stations tool: markers, photographs, passers-by."""
