"""Observed orders in h and dt, held against those the methods declare."""
