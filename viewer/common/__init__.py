"""What every room uses: errors in words, text for a person, progress, paths, files written beside and renamed."""
