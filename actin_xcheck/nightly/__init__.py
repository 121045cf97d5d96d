"""The whole verification suite as one job of a night: planned, carried out, kept."""
