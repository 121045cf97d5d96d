"""What is measured against: not part of the package, run by hand."""
