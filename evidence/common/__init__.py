"""What the scripts share: recordings, splits, records, pages, pictures."""
