"""The report of a comparison: one HTML file that needs nothing beside it, neither files nor a network."""
