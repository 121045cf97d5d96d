"""The audit of the article: what it says, row by row, against what this project computes."""
