"""What stored runs prove: claims, uncertainties, observed orders."""
