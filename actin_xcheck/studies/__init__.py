"""Studies: each asks for runs and says what the answers mean."""
