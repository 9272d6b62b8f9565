"""The spatial cache on the device: which cell a vertex lies in, and how its guide draws directions."""
