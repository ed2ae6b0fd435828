"""What a file says becomes metres, y up, sides as named; once for all formats."""
